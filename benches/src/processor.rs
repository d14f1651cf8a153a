//! Pinning to a core, real-time priority.

use anyhow::{Context, Result, anyhow};
use nix::sched::{CpuSet, sched_setaffinity};
use nix::unistd::Pid;
use thread_priority::unix::{
    RealtimeThreadSchedulePolicy, ThreadSchedulePolicy, set_thread_priority_and_policy, thread_native_id,
};
use thread_priority::{ThreadPriority, ThreadPriorityValue};

/// Lets the calling thread run on `core` only.
///
/// # Errors
/// There is no such core, or it may not be used.
pub fn pin(core: usize) -> Result<()> {
    let mut cores = CpuSet::new();
    cores.set(core).with_context(|| format!("no core {core}"))?;
    sched_setaffinity(Pid::from_raw(0), &cores)
        .with_context(|| format!("this thread may not be pinned to core {core}"))
}

/// Gives the calling thread SCHED_FIFO with `priority` (1 to 99).
///
/// # Errors
/// The kernel does not permit it.
pub fn real_time(priority: u8) -> Result<()> {
    let value =
        ThreadPriorityValue::try_from(priority).map_err(|reason| anyhow!("priority {priority}: {reason}"))?;
    let policy = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
    set_thread_priority_and_policy(thread_native_id(), ThreadPriority::Crossplatform(value), policy)
        .map_err(|error| anyhow!("SCHED_FIFO {priority} is not permitted: {error:?}"))
}
