//! Scheduling policy, processor and locked memory of the step thread: used when configured and permitted.

use nix::sched::{CpuSet, sched_setaffinity};
use nix::sys::mman::{MlockAllFlags, mlockall};
use nix::unistd::Pid;
use thread_priority::{
    RealtimeThreadSchedulePolicy, ThreadPriority, ThreadPriorityValue, ThreadSchedulePolicy,
    set_thread_priority_and_policy, thread_native_id,
};
use tracing::{info, warn};

use crate::configuration::RealtimeSection;

/// Applies what is configured to the calling thread (and, for memory, to the process).
///
/// What the system does not permit is left out with one warning that says how to permit it: a monitor that
/// runs with more jitter is better than none.
pub fn apply(options: &RealtimeSection) {
    if options.lock_memory {
        match mlockall(MlockAllFlags::MCL_CURRENT | MlockAllFlags::MCL_FUTURE) {
            Ok(()) => info!("memory locked"),
            Err(error) => warn!(%error, "cannot lock memory: raise LimitMEMLOCK or grant CAP_IPC_LOCK"),
        }
    }
    if let Some(cpu) = options.cpu {
        let mut cpus = CpuSet::new();
        match cpus
            .set(cpu)
            .and_then(|()| sched_setaffinity(Pid::from_raw(0), &cpus))
        {
            Ok(()) => info!(cpu, "step thread bound to its processor"),
            Err(error) => warn!(%error, cpu, "cannot bind the step thread: is there such a processor?"),
        }
    }
    if let Some(priority) = options.fifo_priority {
        let policy = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
        let set = ThreadPriorityValue::try_from(priority)
            .map_err(|error| error.to_string())
            .and_then(|value| {
                set_thread_priority_and_policy(
                    thread_native_id(),
                    ThreadPriority::Crossplatform(value),
                    policy,
                )
                .map_err(|error| format!("{error:?}"))
            });
        match set {
            Ok(()) => info!(priority, "step thread runs under SCHED_FIFO"),
            Err(error) => warn!(
                error,
                "cannot use SCHED_FIFO: raise LimitRTPRIO or grant CAP_SYS_NICE"
            ),
        }
    }
}
