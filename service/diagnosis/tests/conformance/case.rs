//! What a method contributes to the suite.

use crate::plant::{Plant, Sample};
use residual_diagnosis::{
    diagnoser::{Diagnoser, PacketHeader, Packets, StepInput, StepRecord},
    method::{Designed, MethodOptions},
};
use std::sync::{Mutex, OnceLock};

/// What a method says about alarms without a fault.
#[derive(Clone, Copy, Debug)]
pub enum Promise {
    /// None at all, as long as the plant keeps the model's bounds.
    NoFalseAlarm,
    /// A violation of this channel with this probability at each instant, independent of other instants.
    PerInstant {
        /// The channel.
        channel: &'static str,
        /// The configured probability.
        probability: f64,
    },
    /// An alarm within a run of this many instants with this probability.
    PerRun {
        /// The configured probability.
        probability: f64,
        /// Length of a run.
        steps: usize,
        /// Whether the probability is only an upper bound.
        at_most: bool,
    },
    /// The method makes no claim on false alarms; the reason.
    NoClaim(&'static str),
}

/// One method in one mode.
pub struct Case {
    /// The tables of the diagnoser as TOML.
    pub tables: String,
    /// From tables and sampling period (s) to the diagnoser; [`design`] of the method's tables.
    pub design: fn(&str, f64) -> Designed,
    /// The sampling period, nanoseconds.
    pub period_ns: u64,
    /// The plant that keeps the method's assumptions, by seed.
    pub plant: fn(u64) -> Box<dyn Plant>,
    /// Its word on false alarms.
    pub promise: Promise,
    /// What the first design made: designing may take as long as a thousand steps.
    pub designed: OnceLock<Mutex<Box<dyn Diagnoser>>>,
}

/// Designs the diagnoser of a method's tables.
pub fn design<T: MethodOptions>(tables: &str, sample_time_s: f64) -> Designed {
    let tables: T = toml::from_str(tables).unwrap();
    tables.validate(sample_time_s).unwrap();
    tables.design(sample_time_s).unwrap()
}

impl Case {
    /// A diagnoser designed anew, as every start of the daemon does.
    pub fn design_anew(&self) -> Box<dyn Diagnoser> {
        (self.design)(&self.tables, self.period_ns as f64 * 1e-9).diagnoser
    }

    /// A diagnoser without a past: a copy of one that was designed once for all tests of the case.
    pub fn diagnoser(&self) -> Box<dyn Diagnoser> {
        let designed = self.designed.get_or_init(|| Mutex::new(self.design_anew()));
        designed.lock().unwrap().boxed_clone()
    }

    /// The input of instant `k` (from 1 on) as the runtime would hand it over.
    pub fn input<'a>(&self, k: usize, sample: &'a Sample, headers: &'a [PacketHeader]) -> StepInput<'a> {
        StepInput {
            instant_ns: self.instant_ns(k),
            measurements: &sample.measurements,
            commands: &sample.commands,
            packets: Packets::new(headers, &sample.packet_values),
        }
    }

    /// The sampling instant `k`.
    pub fn instant_ns(&self, k: usize) -> u64 {
        1_000_000_000 + k as u64 * self.period_ns
    }

    /// A step at instant `k` with this sample.
    pub fn step(&self, diagnoser: &mut dyn Diagnoser, k: usize, sample: &Sample, record: &mut StepRecord) {
        let headers = sample.headers(self.instant_ns(k), self.period_ns);
        record.flags = 0;
        diagnoser.step(&self.input(k, sample, &headers), record);
    }
}

/// An empty record for a diagnoser.
pub fn record(diagnoser: &dyn Diagnoser) -> StepRecord {
    StepRecord::new(diagnoser.description().channels.len())
}
