//! Polling the diagnosers of a residuald daemon from shared memory.
//!
//! A [`Monitor`] maps the daemon's bounds table read-only. Reading the newest record of a diagnoser makes no
//! system call and allocates nothing; any number of clients may do it, at any rate, without the daemon noticing.
//! When the daemon is started again the monitor finds it by itself.
//!
//! ```
//! # use residual_shared::bounds_table::{Access, SlotSpec, TableSpec, TableWriter};
//! # use residual_shared::clock::{DaemonTime, monotonic_ns};
//! use residual_client::{Freshness, Instance, Monitor, StepRecord};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let directory = tempfile::tempdir_in("/dev/shm")?;
//! # let runtime_directory = directory.path();
//! let instance = Instance::new("vehicle".parse()?, runtime_directory);
//! # let spec = TableSpec {
//! #     instance: "vehicle".into(),
//! #     slots: vec![SlotSpec {
//! #         name: "steering".into(), method: "chi_square".into(), period_ns: 10_000_000, phase_ns: 0,
//! #         margin_ns: 0, channels: vec![], faults: vec![],
//! #     }],
//! #     inputs: vec![], time: DaemonTime::MONOTONIC, schedule_epoch_ns: 0, stale_after_periods: 100, alarm_capacity: 64,
//! # };
//! # let mut daemon =
//! #     TableWriter::create(&instance.bounds_path(), &spec, &Access { group: None, mode: 0o600 })?;
//! # let mut sent = StepRecord::new(0);
//! # sent.verdict = residual_shared::record::Verdict::Nominal as u32;
//! # sent.instant_ns = monotonic_ns();
//! # daemon.publish(0, &sent);
//! let mut monitor = Monitor::open(&instance)?;
//! let steering = monitor.follow("steering")?;
//! let mut record = StepRecord::new(0);
//! let reading = monitor.read_followed(steering, &mut record)?;
//! assert_eq!(reading.freshness, Freshness::Fresh);
//! println!("{}: {:?}", record.verdict().name(), record.worst_channel());
//! # Ok(())
//! # }
//! ```

mod monitor;
mod reading;

pub use monitor::{DaemonState, Followed, Monitor, MonitorError, RETRY_PERIOD_NS};
pub use reading::{Freshness, Reading};
pub use residual_shared::bounds_table::{
    ChannelSpec, Directory, InputSpec, Liveness, OpenError, ReadError, SlotSpec, TableReader, TableSpec,
};
pub use residual_shared::clock::{DaemonTime, monotonic_ns};
pub use residual_shared::counters::{InputCounters, ScheduleCounters};
pub use residual_shared::names::{
    DEFAULT_RUNTIME_DIRECTORY, Instance, InstanceName, InstanceNameError, RUNTIME_DIRECTORY_VARIABLE,
};
pub use residual_shared::record::{Channel, StepRecord, Verdict, flags};
