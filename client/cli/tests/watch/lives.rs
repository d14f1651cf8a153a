//! Keys, ends, and the lives of the daemon.

use std::time::Duration;

use nix::sys::signal::Signal;
use residual_shared::clock::monotonic_ns;
use residual_shared::record::Verdict;

use crate::scene::{SECOND, daemon, watch};
use crate::support::Daemon;

#[test]
fn keys_lead_through_the_pages_and_restore_the_terminal() {
    let daemon = daemon();
    let mut terminal = watch(&daemon, &[], (80, 24));
    terminal.wait_for(&["front", "Enter detail"]);
    terminal.press("\x1b[B");
    terminal.settle();
    terminal.press("\r");
    terminal.wait_for(&["rear nominal", "step 42"]);
    terminal.press("\x1b[D");
    terminal.wait_for(&["front isolated", "step 41", "force [N]", "last 60 s"]);
    terminal.press("+");
    terminal.wait_for(&["last 120 s"]);
    terminal.press("--");
    terminal.wait_for(&["last 20 s"]);
    terminal.press("\t");
    terminal.wait_for(&["yaw [rad/s]"]);
    terminal.press("\x1b");
    terminal.wait_for(&["Enter detail", "rear"]);
    terminal.press("q");
    assert!(terminal.end().success());
}

#[test]
fn every_end_restores_the_terminal() {
    let daemon = daemon();
    for keys in ["q", "\x1b", "\x03"] {
        let mut terminal = watch(&daemon, &[], (80, 24));
        terminal.wait_for(&["front"]);
        terminal.press(keys);
        assert!(terminal.end().success(), "{keys:?}");
    }
    for signal in [Signal::SIGINT, Signal::SIGTERM, Signal::SIGHUP] {
        // A signal is obeyed at once, however long the interval.
        let mut terminal = watch(&daemon, &["--diagnoser", "front"], (20, 5));
        terminal.wait_for(&["front"]);
        terminal.signal(signal);
        assert!(terminal.end().success(), "{signal}");
    }
    let mut terminal = watch(&daemon, &["--count", "3"], (80, 24));
    assert!(terminal.end().success());
}

#[test]
fn a_terminal_that_hangs_up_ends_the_view() {
    let daemon = daemon();
    let mut terminal = watch(&daemon, &["--interval", "60000"], (80, 24));
    terminal.wait_for(&["front"]);
    assert!(terminal.hang_up().success());
}

#[test]
fn nothing_is_written_while_nothing_changes() {
    let mut daemon = daemon();
    let mut terminal = watch(&daemon, &[], (120, 40));
    terminal.wait_for(&["front", "rear", "imu"]);
    std::thread::sleep(Duration::from_millis(300));
    assert_eq!(terminal.settle(), 0, "thirty looks");
    daemon.publish_at(monotonic_ns() - 605 * SECOND, 1, 43, Verdict::Nominal, &[]);
    let change = {
        terminal.wait_for(&["43"]);
        terminal.settle()
    };
    assert_eq!(change, 0, "one change is written once");
}

#[test]
fn the_view_follows_the_daemon_through_hang_end_and_restart() {
    let mut daemon = daemon();
    let mut terminal = watch(&daemon, &[], (80, 24));
    terminal.wait_for(&["daemon running", "isolated"]);
    daemon.writer.heartbeat(0);
    terminal.wait_for(&["daemon hung", "✕ front", "dead, isolated"]);
    daemon.writer.close();
    terminal.wait_for(&["daemon closed"]);
    daemon.writer = Daemon::create(daemon.directory.path(), "test");
    daemon.writer.heartbeat(monotonic_ns() + 3_600 * SECOND);
    terminal.wait_for(&["daemon running", "starting"]);
    daemon.publish(1, 7_777, Verdict::Nominal, &[]);
    terminal.wait_for(&["● rear", "7777"]);
    terminal.press("q");
    assert!(terminal.end().success());
}
