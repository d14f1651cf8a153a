//! CLOCK_MONOTONIC in nanoseconds, and the daemon's time built on it.

use std::time::Duration;

use nix::errno::Errno;
use nix::sys::time::TimeSpec;
use nix::time::{ClockId, ClockNanosleepFlags, clock_gettime, clock_nanosleep};

const NANOSECONDS_PER_SECOND: u64 = 1_000_000_000;

/// CLOCK_MONOTONIC, nanoseconds. The same clock for every process of the machine.
pub fn monotonic_ns() -> u64 {
    // CLOCK_MONOTONIC exists on every Linux; the call cannot fail with a valid clock and pointer.
    clock_gettime(ClockId::CLOCK_MONOTONIC).map_or(0, |time| {
        time.tv_sec() as u64 * NANOSECONDS_PER_SECOND + time.tv_nsec() as u64
    })
}

/// Sleeps until CLOCK_MONOTONIC reaches `deadline_ns`; returns at once when that is past.
///
/// Absolute waiting, so that the time spent between reading the clock and sleeping adds no drift. A signal
/// does not end the sleep early.
pub fn sleep_until_monotonic(deadline_ns: u64) {
    let deadline = TimeSpec::new(
        (deadline_ns / NANOSECONDS_PER_SECOND) as _,
        (deadline_ns % NANOSECONDS_PER_SECOND) as _,
    );
    while clock_nanosleep(
        ClockId::CLOCK_MONOTONIC,
        ClockNanosleepFlags::TIMER_ABSTIME,
        &deadline,
    ) == Err(Errno::EINTR)
    {}
}

/// The daemon's time: CLOCK_MONOTONIC, or a faster or slower copy of it for replays.
///
/// `time = origin + (monotonic − origin) · speed`. Samples, sampling instants and records carry this time;
/// with the speed 1 it *is* CLOCK_MONOTONIC.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DaemonTime {
    /// Where the daemon's time and CLOCK_MONOTONIC agree, nanoseconds.
    pub origin_ns: u64,
    /// Seconds of the daemon's time per second of CLOCK_MONOTONIC, above 0.
    pub speed: f64,
}

impl DaemonTime {
    /// CLOCK_MONOTONIC itself.
    pub const MONOTONIC: Self = Self {
        origin_ns: 0,
        speed: 1.0,
    };

    /// The daemon's time now, nanoseconds.
    pub fn now_ns(&self) -> u64 {
        self.from_monotonic(monotonic_ns())
    }

    /// The daemon's time at a moment of CLOCK_MONOTONIC, nanoseconds.
    pub fn from_monotonic(&self, monotonic_ns: u64) -> u64 {
        if self.speed == 1.0 {
            return monotonic_ns;
        }
        let elapsed = monotonic_ns.saturating_sub(self.origin_ns);
        self.origin_ns + (elapsed as f64 * self.speed) as u64
    }

    /// The moment of CLOCK_MONOTONIC at a daemon's time, nanoseconds.
    pub fn to_monotonic(&self, time_ns: u64) -> u64 {
        if self.speed == 1.0 {
            return time_ns;
        }
        let elapsed = time_ns.saturating_sub(self.origin_ns);
        self.origin_ns + (elapsed as f64 / self.speed) as u64
    }
}

/// A duration in whole nanoseconds.
pub fn nanoseconds(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sleeping_until_the_past_returns_and_until_the_future_waits() {
        sleep_until_monotonic(1);
        let deadline = monotonic_ns() + 2_000_000;
        sleep_until_monotonic(deadline);
        assert!(monotonic_ns() >= deadline);
    }

    #[test]
    fn daemon_time_runs_faster_by_its_speed_and_back() {
        let time = DaemonTime {
            origin_ns: 1_000,
            speed: 4.0,
        };
        assert_eq!(time.from_monotonic(3_000), 9_000);
        assert_eq!(time.to_monotonic(9_000), 3_000);
        assert_eq!(DaemonTime::MONOTONIC.from_monotonic(u64::MAX), u64::MAX);
    }
}
