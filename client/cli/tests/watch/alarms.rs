//! The alarm log.

use nix::sys::signal::Signal;
use residual_shared::alarm::{AlarmNumber, AlarmState, AlarmTransition};
use residual_shared::clock::monotonic_ns;
use residual_shared::record::Verdict;

use crate::scene::{SECOND, daemon, watch};
use crate::support::Daemon;

fn transition(state: AlarmState, occurrence: u64) -> AlarmTransition {
    AlarmTransition {
        number: AlarmNumber::default(),
        written_ns: 0,
        instant_ns: occurrence * SECOND,
        step: occurrence,
        slot: 0,
        identity: 0,
        state,
        flags: 0,
        verdict: Verdict::Fault as u32,
        occurrence,
        certainly_faulty: 0b10,
        possibly_faulty: 0b11,
        channel: 0,
        ratio: 1.25,
        fault_estimate: f64::NAN,
        fault_estimate_half_width: f64::NAN,
    }
}

#[test]
fn the_alarm_log_shows_transitions_gaps_and_a_new_life_of_the_daemon() {
    let mut daemon = daemon();
    daemon.writer.raise(&transition(AlarmState::Pending, 1));
    let mut terminal = watch(&daemon, &["--interval", "300", "--no-color"], (80, 24));
    terminal.wait_for(&["front", "pending"]);
    daemon.writer.raise(&transition(AlarmState::Raised, 1));
    terminal.wait_for(&["1 alarm ", "raised"]);
    terminal.press("a");
    let text = terminal.wait_for(&["2 1.000 front ▲ raised", "1 1.000 front △ pending"]);
    assert!(!text.contains("missed"), "{text}");
    // More than the ring holds, between two looks: 3 … 202.
    terminal.signal(Signal::SIGSTOP);
    for occurrence in 2..=101 {
        daemon.writer.raise(&transition(AlarmState::Cleared, occurrence));
        daemon.writer.raise(&transition(AlarmState::Isolated, occurrence));
    }
    terminal.signal(Signal::SIGCONT);
    terminal.wait_for(&["202 101.000", "◆ isolated valve", "201 101.000", "● cleared"]);
    terminal.press("\x1b[F");
    let text = terminal.wait_for(&["1 1.000 front"]);
    assert_eq!(
        text.lines().filter(|line| line.contains("△ pending")).count(),
        1,
        "{text}"
    );
    terminal.press("\x1b[A\x1b[A");
    let text = terminal.wait_for(&["missed", "▲ raised"]);
    assert!(
        text.contains("3 … 138: 136 missed"),
        "all that the ring could not hold: {text}"
    );
    terminal.press("\x1b[H");
    // The next life goes on with the numbers.
    daemon.writer = Daemon::create(daemon.directory.path(), "test");
    daemon.writer.heartbeat(monotonic_ns() + 3_600 * SECOND);
    daemon.writer.raise(&transition(AlarmState::Pending, 102));
    terminal.wait_for(&["203 102.000", "△ pending", "202 101.000"]);
    terminal.press("\x1b");
    terminal.wait_for(&["Enter detail"]);
    terminal.press("q");
    assert!(terminal.end().success());
}
