//! What a residuald daemon says, for other programs: newest records, alarms, every record; and what they may ask of it.
//!
//! | use | what | example |
//! |---|---|---|
//! | poll the bounds | [`Monitor`] | `poll` |
//! | wait for alarms | [`AlarmListener`] | `alarms` |
//! | take every step record | `StepRecords`, feature `transport` | `records` |
//! | control the daemon | `Control`, feature `transport` | `control` |
//!
//! The first two read the daemon's bounds table through a read-only mapping: any number of clients, of any user who
//! may read the file, at any rate, without the daemon noticing. Without features the library depends on nothing but
//! thin wrappers of system calls. All of them find the daemon again when it is started anew.
//!
//! # Polling
//! Reading the newest record of a diagnoser makes no system call and allocates nothing.
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
//!
//! # Alarms
//! Every transition comes once and in order; what could not be kept for a slow client comes as a gap with its exact
//! range.
//!
//! ```no_run
//! use std::time::Duration;
//! use residual_client::{AlarmEvent, AlarmListener, AlarmStart, Instance};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let instance = Instance::from_environment("vehicle".parse()?);
//! let mut listener = AlarmListener::open(&instance, AlarmStart::Now)?;
//! while let Some(event) = listener.wait(Duration::from_secs(60)) {
//!     match event {
//!         AlarmEvent::Transition(alarm) => {
//!             let name = alarm.diagnoser_name().unwrap_or("?");
//!             println!("{name}: {}", alarm.transition.state.name());
//!         }
//!         AlarmEvent::Gap { first, last } => println!("{first} to {last} are lost"),
//!         AlarmEvent::NewNumbering { previous, .. } => println!("unknown what came after {previous}"),
//!     }
//! }
//! # Ok(())
//! # }
//! ```
#![cfg_attr(
    feature = "transport",
    doc = r#"
# Control
```no_run
use residual_client::{Control, Instance};

# fn main() -> Result<(), Box<dyn std::error::Error>> {
let control = Control::connect(&Instance::from_environment("vehicle".parse()?))?;
for diagnoser in control.list()?.diagnosers {
    println!("{}: {} steps", diagnoser.name, diagnoser.steps);
}
control.reset("steering")?;
# Ok(())
# }
```

# Every step record
```no_run
use residual_client::{Instance, StepRecords};

# fn main() -> Result<(), Box<dyn std::error::Error>> {
let mut records = StepRecords::open(&Instance::from_environment("vehicle".parse()?))?;
loop {
    records.receive(|header, record| println!("epoch {} slot {}: step {}", header.epoch, header.slot, record.step));
    println!("{} lost so far", records.counts().lost);
    std::thread::sleep(std::time::Duration::from_millis(100));
}
# }
```
"#
)]

mod alarm_event;
mod alarms;
#[cfg(feature = "transport")]
mod control;
mod latest_table;
mod monitor;
mod reading;
#[cfg(feature = "transport")]
mod step_records;

pub use alarm_event::{Alarm, AlarmEvent};
pub use alarms::{AlarmListener, AlarmStart};
#[cfg(feature = "transport")]
pub use control::{Control, DEFAULT_TIMEOUT, LogLevel};
pub use latest_table::{DaemonState, RETRY_PERIOD_NS};
pub use monitor::{Followed, Monitor, MonitorError};
pub use reading::{Freshness, Reading};
pub use residual_shared::alarm::{
    AlarmNumber, AlarmNumberError, AlarmState, AlarmTransition, NONE, alarm_flags,
};
pub use residual_shared::bounds_table::{
    ChannelSpec, Directory, InputSpec, Liveness, OpenError, ReadError, SlotSpec, TableReader, TableSpec,
};
pub use residual_shared::clock::{DaemonTime, monotonic_ns};
#[cfg(feature = "transport")]
pub use residual_shared::control::{
    Alarms, Changes, ChannelDescription, CheckpointOutcome, ControlCounters, ControlError, Counter,
    DiagnoserDescription, DiagnoserEntry, Listing, ReloadOutcome, Request, Response, Which,
};
pub use residual_shared::counters::{AlarmStatus, InputCounters, ScheduleCounters};
pub use residual_shared::names::{
    DEFAULT_RUNTIME_DIRECTORY, Instance, InstanceName, InstanceNameError, RUNTIME_DIRECTORY_VARIABLE,
};
pub use residual_shared::record::{
    Channel, MAX_CHANNELS, MAX_FAULTS, StepRecord, Verdict, fault_names, flags,
};
#[cfg(feature = "transport")]
pub use residual_shared::transport::{RecordHeader, RequestError, TransportError};
#[cfg(feature = "transport")]
pub use step_records::{RecordCounts, StepRecords};

/// What the project's front page shows of Rust compiles.
#[cfg(doctest)]
#[doc = include_str!("../../../README.md")]
struct FrontPage;
