//! A run of a recording as the sequences u_k, y_k that one diagnoser would see.

use residual_shared::sample::SampleHeader;

use super::mapping::TimedSample;
use crate::configuration::{Configuration, DiagnoserConfiguration};
use crate::runtime::assembler::Assembler;
use crate::runtime::inbox::Inbox;

/// A moment before which no sample lies, so that the first window has a beginning.
const START_NS: u64 = 1_000_000_000_000;

/// Commands and measurements at consecutive sampling instants; NaN where nothing was received.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sequences {
    /// u_k, one vector per instant.
    pub commands: Vec<Vec<f64>>,
    /// y_k, one vector per instant.
    pub measurements: Vec<Vec<f64>>,
}

/// What `diagnoser` would see of the samples (in time order) at its sampling instants from the start of the run
/// to its last sample. No sample is late here.
pub fn sequences(
    configuration: &Configuration,
    diagnoser: &DiagnoserConfiguration,
    samples: &[TimedSample],
) -> Sequences {
    let inbox = |signal_count| Inbox::new(signal_count, samples.len(), u64::MAX);
    let mut inboxes: Vec<Inbox> = configuration
        .inputs
        .iter()
        .map(|input| inbox(input.signals.len()))
        .collect();
    for sample in samples {
        let header = SampleHeader {
            sequence: sample.sequence,
            timestamp_ns: START_NS + sample.time_ns,
        };
        inboxes[sample.input].accept(0, header, &sample.elements, 0);
    }
    let end_ns = START_NS + samples.last().map_or(0, |sample| sample.time_ns);
    let mut assembler = Assembler::new(
        &diagnoser.measurements,
        &diagnoser.commands,
        diagnoser.command_delay_steps,
    );
    let mut seen = Sequences::default();
    let mut instant_ns = START_NS + diagnoser.phase_ns;
    while instant_ns <= end_ns {
        assembler.gather(&mut inboxes, instant_ns - diagnoser.period_ns, instant_ns);
        let input = assembler.step_input();
        seen.commands.push(input.commands.to_vec());
        seen.measurements.push(input.measurements.to_vec());
        instant_ns += diagnoser.period_ns;
    }
    seen
}
