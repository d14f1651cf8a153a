//! Steps a case through its recording, again and again.

use std::hint::black_box;

use anyhow::Result;
use residual_diagnosis::diagnoser::{Diagnoser, PacketHeader, Packets, StepInput, StepRecord, Verdict};

use super::Case;
use super::recording::Recording;

/// A diagnoser with its input.
pub struct Stepper {
    diagnoser: Box<dyn Diagnoser>,
    recording: Recording,
    record: StepRecord,
    /// The instant of the last step; the first step is that of the first sample.
    instant: u64,
    headers: Vec<PacketHeader>,
    values: Vec<f64>,
}

/// Instants begin here, as the clock of a machine that has run for a while.
const EPOCH_NS: u64 = 1_000_000_000_000;

impl Stepper {
    /// The diagnoser of a case before its first step.
    ///
    /// # Errors
    /// The case cannot be designed.
    pub fn new(case: &Case) -> Result<Self> {
        let watched = case.watched()?;
        let diagnoser = case.design(&watched)?.diagnoser;
        let before_the_first = watched.recording.instants.len() as u64 - 1;
        Ok(Self {
            record: StepRecord::new(diagnoser.description().channels.len()),
            diagnoser,
            recording: watched.recording,
            instant: before_the_first,
            headers: Vec::new(),
            values: Vec::new(),
        })
    }

    /// Instants after which the input repeats.
    pub fn period(&self) -> usize {
        self.recording.instants.len()
    }

    /// Lays out the packets of the next step, which is the engine's work, not the diagnoser's.
    pub fn prepare(&mut self) {
        self.instant += 1;
        self.headers.clear();
        self.values.clear();
        let now_ns = EPOCH_NS + self.instant * self.recording.period_ns;
        for packet in &self.recording.instants[self.place()].packets {
            self.headers.push(PacketHeader {
                source: packet.source,
                sequence: self.instant,
                time_ns: now_ns - packet.before_ns,
                start: self.values.len(),
                length: packet.values.len(),
            });
            self.values.extend_from_slice(&packet.values);
        }
        self.record.flags = 0;
    }

    /// Does the step that was prepared.
    pub fn step(&mut self) {
        let sample = &self.recording.instants[self.place()];
        let input = StepInput {
            instant_ns: EPOCH_NS + self.instant * self.recording.period_ns,
            measurements: &sample.measurements,
            commands: &sample.commands,
            packets: Packets::new(&self.headers, &self.values),
        };
        self.diagnoser
            .step(black_box(&input), black_box(&mut self.record));
    }

    /// Prepares and does so many steps.
    pub fn steps(&mut self, count: usize) {
        for _ in 0..count {
            self.prepare();
            self.step();
        }
    }

    /// What the last step said.
    pub fn verdict(&self) -> Verdict {
        self.record.verdict()
    }

    fn place(&self) -> usize {
        (self.instant % self.recording.instants.len() as u64) as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::steps::cases;

    /// Baselines that guarantee nothing, and alarm on these plants.
    const BASELINES: [&str; 3] = [
        "unknown_input_filter kalman_3sigma n=4",
        "reduced_order_observer paper n=4",
        "reduced_order_observer interval n=4",
    ];

    /// Four periods are longer than any start-up, window or filling of a set.
    #[test]
    fn every_mode_runs_and_says_nominal_without_a_fault() {
        for case in cases().into_iter().filter(|case| case.states == 4) {
            let mut stepper = Stepper::new(&case).unwrap();
            stepper.steps(4 * stepper.period());
            let name = case.name();
            if !BASELINES.contains(&name.as_str()) {
                assert_eq!(stepper.verdict(), Verdict::Nominal, "{name}");
            }
        }
    }
}
