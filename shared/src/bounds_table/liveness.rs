//! Whether the daemon behind a table lives.

use std::time::Duration;

use super::layout::STATE_RUNNING;

/// How often the daemon gives a sign of life, nanoseconds: 100 ms.
///
/// Rare enough to cost nothing (one store), often enough that a dead daemon is noticed within human reaction
/// time.
pub const HEARTBEAT_PERIOD_NS: u64 = 100_000_000;

/// Age of the last sign of life from which the daemon counts as hung or killed, nanoseconds: 500 ms.
///
/// Five missed heartbeats: a loaded machine without real-time priority delays a thread by tens of milliseconds
/// now and then, by half a second practically never.
pub const HUNG_AFTER_NS: u64 = 5 * HEARTBEAT_PERIOD_NS;

/// Whether the daemon behind a table lives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Liveness {
    /// It gave a sign of life within [`HUNG_AFTER_NS`].
    Running,
    /// It gave no sign of life for this long: stopped, killed, or kept from running.
    Hung(Duration),
    /// It has ended, or another one has taken its place, or it ran before the machine's last boot.
    Closed,
}

impl Liveness {
    /// The liveness at the moment `now_ns` of CLOCK_MONOTONIC, from the header words `STATE` and `HEARTBEAT`.
    pub(super) fn judge(state: u64, heartbeat_ns: u64, now_ns: u64) -> Self {
        // A heartbeat that came after `now_ns` was read gives the age 0.
        let age_ns = now_ns.saturating_sub(heartbeat_ns);
        if state != STATE_RUNNING {
            Self::Closed
        } else if age_ns > HUNG_AFTER_NS {
            Self::Hung(Duration::from_nanos(age_ns))
        } else {
            Self::Running
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::layout::STATE_CLOSED;
    use super::*;

    #[test]
    fn a_daemon_is_hung_from_five_missed_heartbeats_on() {
        let at = |age_ns| Liveness::judge(STATE_RUNNING, 1_000, 1_000 + age_ns);
        assert_eq!(at(HUNG_AFTER_NS), Liveness::Running);
        let late = HUNG_AFTER_NS + 1;
        assert_eq!(at(late), Liveness::Hung(Duration::from_nanos(late)));
        assert_eq!(Liveness::judge(STATE_RUNNING, 5, 1), Liveness::Running);
    }

    #[test]
    fn only_the_running_state_is_alive() {
        for state in [0, STATE_CLOSED, u64::MAX] {
            assert_eq!(Liveness::judge(state, 0, 0), Liveness::Closed);
        }
    }
}
