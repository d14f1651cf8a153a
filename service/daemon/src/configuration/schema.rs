//! The configuration file as it is written: sections, keys, defaults. Validation turns it into
//! [`super::Configuration`]; `deploy/config/README.md` documents every key.

use serde::Deserialize;
use std::path::PathBuf;

/// The top-level keys.
pub(super) const TOP_LEVEL: [&str; 5] = ["daemon", "realtime", "input", "diagnoser", "replay"];

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Daemon {
    pub instance: String,
    #[serde(default = "default_runtime_directory")]
    pub runtime_directory: PathBuf,
    #[serde(default)]
    pub group: Option<Group>,
    #[serde(default = "default_mode")]
    pub mode: String,
    #[serde(default = "default_stale_after_periods")]
    pub stale_after_periods: u32,
    #[serde(default = "default_catch_up_limit")]
    pub catch_up_limit: u32,
    #[serde(default = "default_log")]
    pub log: String,
    #[serde(default = "default_record_queue")]
    pub record_queue: usize,
    #[serde(default = "default_alarm_capacity")]
    pub alarm_capacity: u32,
    #[serde(default)]
    pub gains_file: Option<PathBuf>,
    #[serde(default)]
    pub checkpoint_file: Option<PathBuf>,
    #[serde(default)]
    pub checkpoint_period_s: Option<f64>,
}

/// A group by name or by number.
#[derive(Debug, Deserialize)]
#[serde(untagged, expecting = "expected the name or the number of a group")]
pub(super) enum Group {
    Number(u32),
    Name(String),
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Realtime {
    pub fifo_priority: Option<i64>,
    pub cpu: Option<usize>,
    pub lock_memory: bool,
}

impl Default for Realtime {
    fn default() -> Self {
        Self {
            fifo_priority: None,
            cpu: None,
            lock_memory: true,
        }
    }
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Input {
    pub name: String,
    pub signals: Vec<String>,
    #[serde(default)]
    pub units: Option<Vec<String>>,
    #[serde(default = "default_buffer_samples")]
    pub buffer_samples: usize,
    #[serde(default = "default_max_ahead_s")]
    pub max_ahead_s: f64,
    #[serde(default = "default_max_publishers")]
    pub max_publishers: usize,
}

/// The key of `[[diagnoser]]` that decides which keys its method has.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct DiagnoserMethod {
    pub method: Method,
}

/// The other keys that every method shares; the rest of `[[diagnoser]]` belongs to its method.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Diagnoser {
    pub name: String,
    pub sample_time_s: f64,
    #[serde(default)]
    pub phase_s: f64,
    #[serde(default)]
    pub margin_s: Option<f64>,
    #[serde(default)]
    pub priority: i32,
    pub measurements: Vec<String>,
    #[serde(default)]
    pub commands: Vec<String>,
    #[serde(default)]
    pub command_delay_steps: usize,
    #[serde(default)]
    pub lifecycle: Lifecycle,
}

/// `[diagnoser.lifecycle]`: when the diagnoser's alarm is raised and cleared. Absent keys have the defaults of
/// [`Rules`](crate::lifecycle::Rules).
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Lifecycle {
    pub raise_steps: Option<u32>,
    pub raise_window: Option<u32>,
    pub clear_steps: Option<u32>,
    pub clear_ratio: Option<f64>,
    pub latch: bool,
    pub startup_suppression_s: f64,
    pub enable: Vec<Enable>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Enable {
    #[serde(default)]
    pub channels: Option<Vec<String>>,
    pub signal: String,
    pub range: [f64; 2],
}

/// The diagnosis methods by name.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Method {
    UnknownInputFilter,
    ReducedOrderObserver,
    AsyncImm,
    HinfFilter,
    ChiSquare,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Replay {
    pub time_column: String,
    #[serde(default)]
    pub run_column: Option<String>,
    #[serde(default)]
    pub kind_column: Option<String>,
    #[serde(default)]
    pub fault_column: Option<String>,
    #[serde(default)]
    pub row_period_s: Option<f64>,
    #[serde(default)]
    pub input: Vec<ReplayInput>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ReplayInput {
    pub input: String,
    pub values: Vec<String>,
    #[serde(default = "default_every_rows")]
    pub every_rows: usize,
    #[serde(default)]
    pub first_row: usize,
}

fn default_runtime_directory() -> PathBuf {
    residual_shared::names::DEFAULT_RUNTIME_DIRECTORY.into()
}

fn default_mode() -> String {
    "0640".to_owned()
}

fn default_stale_after_periods() -> u32 {
    3
}

fn default_catch_up_limit() -> u32 {
    10
}

fn default_log() -> String {
    "info".to_owned()
}

fn default_record_queue() -> usize {
    1024
}

fn default_alarm_capacity() -> u32 {
    1024
}

fn default_buffer_samples() -> usize {
    64
}

fn default_max_ahead_s() -> f64 {
    1.0
}

fn default_max_publishers() -> usize {
    2
}

fn default_every_rows() -> usize {
    1
}
