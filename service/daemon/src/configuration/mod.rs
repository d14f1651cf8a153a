//! The configuration of the daemon: a TOML file that is loaded, checked and, where it is wrong, refused with
//! file, line, column, the reason and what to do about it.
//!
//! | module | what |
//! |---|---|
//! | `schema` | sections, keys and defaults as written in the file |
//! | `deserialise`, `refusal`, `locate` | from text to sections, every mistake with its place |
//! | `validate` | from sections to [`Configuration`] |
//! | [`load`] | the whole way |
//! | [`method`], [`build`], [`gains`] | the diagnosis methods, their gains, and the construction of the diagnosers |
//! | `enabling` | the channels that enable conditions speak of |
//! | `warnings` | what is accepted but deserves a second look |
//!
//! `deploy/config/README.md` documents every key, `deploy/config/vtol.toml` is a complete example.

pub mod build;
mod deserialise;
mod enabling;
pub mod error;
pub mod gains;
pub mod load;
mod locate;
pub mod method;
mod refusal;
mod schema;
mod suggest;
mod validate;
mod warnings;

pub use error::{ConfigurationError, Mistake};
pub use load::Loaded;
pub use method::MethodConfiguration;

use crate::lifecycle::Rules;
use residual_shared::names::{Instance, InstanceName};
use std::path::PathBuf;

/// A configuration that passed every check.
#[derive(Clone, Debug, PartialEq)]
pub struct Configuration {
    /// `[daemon]`.
    pub daemon: DaemonSection,
    /// `[realtime]`.
    pub realtime: RealtimeSection,
    /// `[[input]]`, in the order of the file.
    pub inputs: Vec<InputConfiguration>,
    /// `[[diagnoser]]`, in the order of the file; at least one.
    pub diagnosers: Vec<DiagnoserConfiguration>,
    /// `[replay]`.
    pub replay: Option<ReplayConfiguration>,
}

/// `[daemon]`: the instance and what it offers to others.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DaemonSection {
    /// Name of the instance.
    pub instance: InstanceName,
    /// Absolute path of the directory, on a tmpfs, for the instance's files.
    pub runtime_directory: PathBuf,
    /// Group identifier of the bounds table; `None`: the group of the process.
    pub group: Option<u32>,
    /// Permission bits of the bounds table; nobody but the owner may write.
    pub mode: u32,
    /// A record older than this many periods is stale, >= 1.
    pub stale_after_periods: u32,
    /// Steps that a late diagnoser may be behind before instants are skipped.
    pub catch_up_limit: u32,
    /// Filter of the log, in the syntax of `tracing`.
    pub log: String,
    /// Step records buffered for recorders, >= 1.
    pub record_queue: usize,
    /// Alarm transitions kept for clients, a power of two.
    pub alarm_capacity: u32,
    /// File with the gains of all diagnosers; `None`: they are found at the start.
    pub gains_file: Option<PathBuf>,
    /// File that keeps the states of all diagnosers over a restart; `None`: every start is from nothing.
    pub checkpoint_file: Option<PathBuf>,
    /// Time from one checkpoint to the next, nanoseconds; `None`: one at the stop, and when asked for.
    pub checkpoint_period_ns: Option<u64>,
}

impl DaemonSection {
    /// Names and paths of the instance.
    pub fn instance(&self) -> Instance {
        Instance::new(self.instance.clone(), &self.runtime_directory)
    }
}

/// `[realtime]`: how the step thread is scheduled, as far as the system permits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RealtimeSection {
    /// SCHED_FIFO priority, 1 to 99; `None`: the usual scheduling.
    pub fifo_priority: Option<u8>,
    /// The only processor of the step thread; `None`: any.
    pub cpu: Option<usize>,
    /// Whether to lock the process in memory.
    pub lock_memory: bool,
}

/// `[[input]]`: one publish-subscribe service that carries samples.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InputConfiguration {
    /// Name, unique.
    pub name: String,
    /// Names of the elements of a sample, unique within the input; at least one.
    pub signals: Vec<String>,
    /// Units, as many as signals; empty texts where the configuration states none.
    pub units: Vec<String>,
    /// Samples kept until their sampling instant is due, >= 1.
    pub buffer_samples: usize,
    /// A sample stamped further in the future than this is refused, nanoseconds.
    pub max_ahead_ns: u64,
    /// Publishers that may be connected at the same time, >= 1.
    pub max_publishers: usize,
}

/// One element of the samples of one input.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct SignalReference {
    /// Index into [`Configuration::inputs`].
    pub input: usize,
    /// Index into [`InputConfiguration::signals`].
    pub element: usize,
}

/// `[[diagnoser]]`: one method on one plant.
#[derive(Clone, Debug, PartialEq)]
pub struct DiagnoserConfiguration {
    /// Name, unique.
    pub name: String,
    /// Sampling period, nanoseconds.
    pub period_ns: u64,
    /// Offset of the sampling instants from the epoch, nanoseconds, below the period.
    pub phase_ns: u64,
    /// Transport allowance: the step of t_k begins at t_k + margin, nanoseconds.
    pub margin_ns: u64,
    /// Of several diagnosers due at the same moment, the largest priority steps first.
    pub priority: i32,
    /// The rows of C, in order.
    pub measurements: Vec<SignalReference>,
    /// The columns of B, in order.
    pub commands: Vec<SignalReference>,
    /// A command received at t_k acts from t_{k + delay} on.
    pub command_delay_steps: usize,
    /// When its alarm is raised and cleared.
    pub lifecycle: LifecycleConfiguration,
    /// The method with its model and options.
    pub method: MethodConfiguration,
}

/// `[diagnoser.lifecycle]`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LifecycleConfiguration {
    /// When the alarm is raised and cleared.
    pub rules: Rules,
    /// Which channels count only sometimes.
    pub enable: Vec<EnableConfiguration>,
}

/// `[[diagnoser.lifecycle.enable]]`: some channels count only while a signal lies in a range.
#[derive(Clone, Debug, PartialEq)]
pub struct EnableConfiguration {
    /// Names of the channels; `None`: all.
    pub channels: Option<Vec<String>>,
    /// The signal.
    pub signal: SignalReference,
    /// Its lowest and highest value.
    pub range: [f64; 2],
}

impl DiagnoserConfiguration {
    /// The sampling period, seconds.
    pub fn sample_time_s(&self) -> f64 {
        self.period_ns as f64 * 1e-9
    }
}

/// `[replay]`: how a recording in CSV feeds the inputs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ReplayConfiguration {
    /// Column with the time, seconds.
    pub time_column: String,
    /// Column that tells the runs of a file apart.
    pub run_column: Option<String>,
    /// Column that names the kind of each run.
    pub kind_column: Option<String>,
    /// Column that labels real faults; 0 or empty: none.
    pub fault_column: Option<String>,
    /// Time from one row to the next in the replay, nanoseconds; none: as recorded.
    pub row_period_ns: Option<u64>,
    /// What feeds each input; every input at most once.
    pub inputs: Vec<ReplayInput>,
}

/// What feeds one input in a replay.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ReplayInput {
    /// Index into [`Configuration::inputs`].
    pub input: usize,
    /// One expression over the columns per signal.
    pub values: Vec<String>,
    /// A sample is made of every so many rows, >= 1.
    pub every_rows: usize,
    /// The first row that makes a sample, counted from 0, < `every_rows`.
    pub first_row: usize,
}
