//! A daemon to watch, and the terminal it is watched on.

use residual_shared::clock::monotonic_ns;
use residual_shared::counters::{InputCounters, ScheduleCounters};
use residual_shared::record::{Channel, Verdict};

use crate::support::Daemon;
use crate::terminal::Terminal;

/// Nanoseconds.
pub const SECOND: u64 = 1_000_000_000;

/// The channels of `front`: one beyond its bound, one not evaluated.
pub const FAULT: [Channel; 2] = [
    Channel {
        lower: -2.0,
        residual: 2.5,
        upper: 2.0,
        ratio: 1.25,
    },
    Channel::NOT_EVALUATED,
];

/// A daemon that lives for an hour to come.
pub fn living_daemon() -> Daemon {
    let daemon = Daemon::start();
    daemon.writer.heartbeat(monotonic_ns() + 3_600 * SECOND);
    daemon
}

/// A daemon with a fault in `front`, ten minutes old so that the shown age rests while a test runs.
pub fn daemon() -> Daemon {
    let mut daemon = living_daemon();
    let then = monotonic_ns() - 605 * SECOND;
    daemon.publish_at(then, 0, 41, Verdict::Isolated, &FAULT);
    daemon.publish_at(then, 1, 42, Verdict::Nominal, &[]);
    let counters = ScheduleCounters {
        steps: 40,
        skipped: 3,
        overruns: 2,
        ..Default::default()
    };
    daemon.writer.publish_schedule_counters(0, &counters);
    let counters = InputCounters {
        accepted: 1_000,
        lost: 8,
        ..Default::default()
    };
    daemon.writer.publish_input_counters(0, &counters);
    daemon
}

/// Starts `residual watch` on a terminal of its own.
pub fn watch(daemon: &Daemon, options: &[&str], size: (u16, u16)) -> Terminal {
    let mut command = daemon.command(&["watch"]);
    if !options.contains(&"--interval") {
        command.args(["--interval", "10"]);
    }
    command
        .args(options)
        .env("TERM", "xterm-256color")
        .env_remove("NO_COLOR");
    Terminal::start(command, size)
}
