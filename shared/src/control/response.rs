//! What the daemon says when it has done what it was asked for.

use serde::{Deserialize, Serialize};

/// Most diagnosers in one [`Listing`]: with the longest names, 100 bytes each, they fill a third of an answer.
pub const LIST_PAGE: usize = 64;

/// What the daemon says when it has done what it was asked for.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Response {
    /// To `List`.
    List(Listing),
    /// To `Describe`.
    Description(DiagnoserDescription),
    /// To `Reset`.
    Reset {
        /// How many diagnosers were reset; the next record of each has the flag RESET.
        diagnosers: u32,
    },
    /// To `Acknowledge`.
    Acknowledged {
        /// How many alarms waited for it.
        alarms: u32,
    },
    /// To `Checkpoint`.
    Checkpoint(CheckpointOutcome),
    /// To `Reload`.
    Reload(ReloadOutcome),
    /// To `SetLogLevel`.
    LogLevel {
        /// The filter until now.
        before: String,
        /// The filter from now on.
        now: String,
    },
}

/// The daemon itself and some of its diagnosers.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Listing {
    /// The instance.
    pub instance: String,
    /// Version of the program.
    pub program: String,
    /// Process number.
    pub pid: u32,
    /// Number of the daemon's life; 0 while it is starting.
    pub epoch: u64,
    /// The log filter.
    pub log: String,
    /// Requests so far, this one not included.
    pub requests: ControlCounters,
    /// Number of all diagnosers.
    pub total: u32,
    /// Slot of the first one below.
    pub first: u32,
    /// Diagnosers by slot, at most [`LIST_PAGE`].
    pub diagnosers: Vec<DiagnoserEntry>,
}

/// One line of a list.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct DiagnoserEntry {
    /// Name.
    pub name: String,
    /// Method.
    pub method: String,
    /// Period, nanoseconds.
    pub period_ns: u64,
    /// Number of channels.
    pub channels: u32,
    /// Number of faults.
    pub faults: u32,
    /// Steps done.
    pub steps: u64,
}

/// What became of the control requests.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ControlCounters {
    /// Answered, with success or with an error.
    pub answered: u64,
    /// Rejected: malformed, too long, or of an unknown version.
    pub rejected: u64,
    /// Not obeyed in time, or the client had gone before the answer.
    pub timed_out: u64,
}

/// All that is known of one diagnoser.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct DiagnoserDescription {
    /// Name.
    pub name: String,
    /// Slot in the bounds table.
    pub slot: u32,
    /// Method.
    pub method: String,
    /// Period, nanoseconds.
    pub period_ns: u64,
    /// Offset of the sampling instants from the epoch, nanoseconds.
    pub phase_ns: u64,
    /// Transport allowance, nanoseconds.
    pub margin_ns: u64,
    /// Among diagnosers due at the same moment, the largest steps first.
    pub priority: i32,
    /// Its measurements, as INPUT.SIGNAL.
    pub measurements: Vec<String>,
    /// Its commands, as INPUT.SIGNAL.
    pub commands: Vec<String>,
    /// A command acts so many instants after its reception.
    pub command_delay_steps: u32,
    /// Channels of its records.
    pub channels: Vec<ChannelDescription>,
    /// Faults, by their bit.
    pub faults: Vec<String>,
    /// Options of the fault lifecycle: name and value.
    pub lifecycle: Vec<(String, String)>,
    /// Where the gains come from.
    pub gains: String,
    /// What the design found and what the gains achieve, recomputed from them at the start: name and value.
    pub certificate: Vec<(String, String)>,
    /// What deserves a second look.
    pub warnings: Vec<String>,
    /// How it was scheduled so far.
    pub counters: Vec<Counter>,
}

/// A channel of a diagnoser's records.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ChannelDescription {
    /// Name.
    pub name: String,
    /// Unit; empty for a number without unit.
    pub unit: String,
}

/// A counter.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Counter {
    /// Name.
    pub name: String,
    /// Value.
    pub value: u64,
}

/// What was saved.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct CheckpointOutcome {
    /// The file.
    pub path: String,
    /// Diagnosers whose state it holds.
    pub diagnosers: u32,
    /// Its length, bytes.
    pub bytes: u64,
}

/// What a reload changed.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ReloadOutcome {
    /// Diagnosers: unchanged ones went on with their state, changed ones began anew.
    pub diagnosers: Changes,
    /// Inputs.
    pub inputs: Changes,
}

/// What became of the diagnosers, or of the inputs.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Changes {
    /// How many are as they were.
    pub unchanged: u32,
    /// Names of those that are there as before, but otherwise; the first [`Changes::NAMES`] of them.
    pub changed: Vec<String>,
    /// Names of the new ones, likewise.
    pub added: Vec<String>,
    /// Names of those that are gone, likewise.
    pub removed: Vec<String>,
    /// How many more names there are.
    pub more: u32,
}

impl Changes {
    /// Most names in each list, so that the answer fits.
    pub const NAMES: usize = 100;
}
