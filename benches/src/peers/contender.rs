//! Who steps: a diagnoser of this process, or a peer in a process of its own.
//!
//! A peer is started with the file of the problem, says in one line what it is, and obeys lines on its standard input:
//! `check` makes it step through all inputs and write the compared numbers of every step as JSON, `time` makes it step
//! through them twice and write how many nanoseconds of processor time its thread used in the second pass. On a machine
//! with other work that is what the step itself costs; on an idle one it is the time that passes.

use std::hint::black_box;
use std::process::Command;
use std::time::Duration;

use anyhow::Result;
use residual_diagnosis::diagnoser::{Diagnoser, PacketHeader, Packets, StepInput, StepRecord};

use super::cases::Case;
use super::timing::processor_time;
use crate::process::Process;

/// Everything that a diagnoser sees of a run.
#[derive(Clone, Debug, Default)]
pub struct Inputs {
    /// y of every instant.
    pub measurements: Vec<Vec<f64>>,
    /// u of every instant.
    pub commands: Vec<Vec<f64>>,
    /// Packets of every instant, for methods that take packets, and their values.
    pub packets: Vec<(Vec<PacketHeader>, Vec<f64>)>,
    /// The sampling instants.
    pub instants_ns: Vec<u64>,
}

impl Inputs {
    /// Inputs of a method without packets.
    pub fn sampled(measurements: Vec<Vec<f64>>, commands: Vec<Vec<f64>>) -> Self {
        Self {
            packets: vec![(Vec::new(), Vec::new()); measurements.len()],
            instants_ns: vec![0; measurements.len()],
            measurements,
            commands,
        }
    }

    fn steps(&self) -> impl Iterator<Item = StepInput<'_>> {
        (0..self.measurements.len()).map(|k| StepInput {
            instant_ns: self.instants_ns[k],
            measurements: &self.measurements[k],
            commands: &self.commands[k],
            packets: Packets::new(&self.packets[k].0, &self.packets[k].1),
        })
    }
}

/// Who steps.
pub enum Contender {
    /// A diagnoser of this process.
    Own(Box<dyn Diagnoser>),
    /// A program that obeys `check` and `time`.
    Peer(Process),
}

impl Contender {
    /// Starts a peer; returns what it says of itself.
    ///
    /// # Errors
    /// It does not start, or says nothing.
    pub fn start(command: Command) -> Result<(String, Self)> {
        let mut process = Process::start_command(command)?;
        Ok((process.line()?, Self::Peer(process)))
    }

    /// The compared numbers of every step from the start of the run.
    ///
    /// # Errors
    /// The peer has failed.
    pub fn outputs(&mut self, case: &Case) -> Result<Vec<Vec<f64>>> {
        match self {
            Self::Own(diagnoser) => Ok(outputs(&mut **diagnoser, case)),
            Self::Peer(process) => {
                process.tell("check")?;
                process.said()
            }
        }
    }

    /// Steps through the whole run twice; the processor time of the second pass.
    ///
    /// # Errors
    /// The peer has failed.
    pub fn time(&mut self, case: &Case) -> Result<Duration> {
        match self {
            Self::Own(diagnoser) => {
                pass(&mut **diagnoser, case)?;
                pass(&mut **diagnoser, case)
            }
            Self::Peer(process) => {
                process.tell("time")?;
                Ok(Duration::from_nanos(process.said()?))
            }
        }
    }
}

fn outputs(diagnoser: &mut dyn Diagnoser, case: &Case) -> Vec<Vec<f64>> {
    diagnoser.reset();
    let mut record = StepRecord::new(diagnoser.description().channels.len());
    let mut all = Vec::new();
    for input in case.inputs.steps() {
        record.flags = 0;
        diagnoser.step(&input, &mut record);
        let channels = case.compared.iter().map(|&channel| record.channels[channel]);
        let residuals = channels.clone().map(|channel| channel.residual);
        all.push(residuals.chain(channels.map(|channel| channel.upper)).collect());
    }
    all
}

fn pass(diagnoser: &mut dyn Diagnoser, case: &Case) -> Result<Duration> {
    diagnoser.reset();
    let mut record = StepRecord::new(diagnoser.description().channels.len());
    let begin = processor_time()?;
    for input in case.inputs.steps() {
        record.flags = 0;
        diagnoser.step(&input, &mut record);
        black_box(&record);
    }
    Ok(processor_time()?.saturating_sub(begin))
}
