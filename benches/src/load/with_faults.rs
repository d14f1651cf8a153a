//! A daemon whose plants are faulty now and then, so that alarms are raised and cleared, with its sensors.

use std::thread::available_parallelism;

use anyhow::Result;

use super::daemon::{Daemon, RealTimeOptions};
use super::fleet::{FleetOptions, Phases, Sharing, instance};
use super::publishers::{PublisherOptions, Publishers};

/// Starts a daemon with `diagnosers` diagnosers, its step thread on `core`, its sensors on the next one; both with
/// SCHED_FIFO where that is permitted.
///
/// # Errors
/// One of the processes does not start.
pub fn with_faults(diagnosers: usize, core: usize, name: &str) -> Result<(Daemon, Publishers)> {
    let fleet = FleetOptions {
        diagnosers,
        inputs: Sharing::Shared,
        phases: Phases::Together,
    };
    let cores = available_parallelism().map_or(1, usize::from);
    let scheduled = RealTimeOptions {
        core: Some(core),
        fifo: Some(50),
    };
    let daemon = Daemon::start(&fleet, &scheduled, instance(name)?)?;
    let publishers = PublisherOptions {
        processes: 1,
        faults: true,
        core: (cores > 1).then_some((core + 1) % cores),
        fifo: Some(40),
    };
    let publishers = Publishers::start(&fleet, &daemon.instance.name, &publishers)?;
    Ok((daemon, publishers))
}
