//! Sleeping until the number of a newer alarm transition appears, and waking the sleepers.
//!
//! The futex lies in the shared file, so the kernel knows it by file and offset: sleepers need no more than a
//! read-only mapping, the daemon needs not know them, and one that is killed leaves nothing behind.

use std::sync::atomic::AtomicU32;
use std::time::Duration;

use rustix::thread::futex::{self, Flags, Timespec};

/// Sleeps while the futex holds `value`, at most for `timeout`. May return early; the caller looks again.
pub(super) fn wait(futex: &AtomicU32, value: u32, timeout: Duration) {
    let timeout = Timespec {
        tv_sec: timeout.as_secs().min(i64::MAX as u64).cast_signed(),
        tv_nsec: i64::from(timeout.subsec_nanos()),
    };
    // Woken, timed out, interrupted by a signal, or the value was another one: all mean "look again".
    let _ = futex::wait(futex, Flags::empty(), value, Some(&timeout));
}

/// Wakes every sleeper. Costs about half a microsecond when there is none.
pub(super) fn wake_all(futex: &AtomicU32) {
    // Only a wrong address makes it fail, and a reference has none.
    let _ = futex::wake(futex, Flags::empty(), i32::MAX.cast_unsigned());
}
