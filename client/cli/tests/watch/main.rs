//! `residual watch` on a terminal: what it shows at several sizes, its keys, and its ends.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[path = "../support/mod.rs"]
mod support;
mod terminal;

use std::time::Duration;

use nix::sys::signal::Signal;
use residual_shared::alarm::{AlarmNumber, AlarmState, AlarmTransition};
use residual_shared::clock::monotonic_ns;
use residual_shared::counters::{InputCounters, ScheduleCounters};
use residual_shared::record::{Channel, Verdict};

use support::Daemon;
use terminal::Terminal;

const SIZES: [(u16, u16); 6] = [(80, 24), (120, 40), (40, 10), (20, 5), (10, 2), (1, 1)];

const SECOND: u64 = 1_000_000_000;

const FAULT: [Channel; 2] = [
    Channel {
        lower: -2.0,
        residual: 2.5,
        upper: 2.0,
        ratio: 1.25,
    },
    Channel::NOT_EVALUATED,
];

/// A daemon that lives for an hour to come.
fn living_daemon() -> Daemon {
    let daemon = Daemon::start();
    daemon.writer.heartbeat(monotonic_ns() + 3_600 * SECOND);
    daemon
}

/// A daemon with a fault in `front`, ten minutes old so that the shown age rests while a test runs.
fn daemon() -> Daemon {
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

fn watch(daemon: &Daemon, options: &[&str], size: (u16, u16)) -> Terminal {
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

/// The text without what differs from run to run: process, epoch, instant.
fn masked(text: &str) -> String {
    let mut masked = text.to_owned();
    for before in ["process ", "epoch ", "at "] {
        let pieces: Vec<_> = masked.split(before).map(str::to_owned).collect();
        let rest = |piece: &str| {
            let rest =
                piece.trim_start_matches(|character: char| character.is_ascii_digit() || character == '.');
            if rest.len() < piece.len() {
                format!("#{rest}")
            } else {
                rest.into()
            }
        };
        masked = pieces[0].clone();
        for piece in &pieces[1..] {
            masked.push_str(before);
            masked.push_str(&rest(piece));
        }
    }
    masked
}

/// Resizes a running view through all sizes and compares what it shows with the expected text.
fn assert_sizes(terminal: &mut Terminal, page: &str, word: &str) {
    for (columns, rows) in SIZES {
        terminal.resize((columns, rows));
        let words = [word, if page == "list" { "q quit" } else { "Esc back" }];
        let text = terminal.wait_for(if columns < 20 { &["n"] } else { &words });
        insta::assert_snapshot!(format!("{page}_{columns}x{rows}"), masked(&text));
    }
}

#[test]
fn the_list_and_the_detail_are_drawn_anew_at_every_size_with_and_without_colour() {
    let daemon = daemon();
    let mut terminal = watch(&daemon, &[], (80, 24));
    terminal.wait_for(&["front", "rear", "imu"]);
    assert!(terminal.has_colour());
    assert_sizes(&mut terminal, "list", "rear");
    terminal.resize((80, 24));
    terminal.press("\r");
    terminal.wait_for(&["certainly faulty: valve"]);
    assert_sizes(&mut terminal, "detail", "force");
    drop(terminal);
    let mut command = daemon.command(&["watch", "--interval", "10"]);
    command.env("NO_COLOR", "1");
    let mut terminal = Terminal::start(command, (80, 24));
    terminal.wait_for(&["front", "rear", "imu"]);
    assert_sizes(&mut terminal, "list", "rear");
    assert!(!terminal.has_colour());
    terminal.resize((80, 24));
    terminal.press("\r");
    terminal.wait_for(&["certainly faulty: valve"]);
    assert_sizes(&mut terminal, "detail_no_colour", "force");
    assert!(!terminal.has_colour());
    terminal.press("q");
    assert!(terminal.end().success());
}

#[test]
fn no_color_says_the_states_in_words() {
    let daemon = daemon();
    let mut terminal = watch(&daemon, &["--no-color"], (80, 24));
    terminal.wait_for(&["▲ front", "isolated", "▶", "● rear", "nominal", "daemon running"]);
    assert!(!terminal.has_colour());
}

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
fn a_terminal_of_any_size_is_drawn_on_and_one_of_unknown_size_as_a_common_one() {
    let daemon = daemon();
    for (size, word) in [
        ((1, 1), "n"),
        ((19, 30), "needs 20x5"),
        ((0, 0), "rear"),
        ((300, 1), "needs 20x5; q quits"),
    ] {
        let mut terminal = watch(&daemon, &[], size);
        terminal.wait_for(&[word]);
        terminal.press("q");
        assert!(terminal.end().success(), "{size:?}");
    }
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
fn the_plot_follows_the_residual_between_its_bounds() {
    let mut daemon = living_daemon();
    let begin = monotonic_ns() - 620 * SECOND;
    let mut terminal = watch(&daemon, &["--diagnoser", "front", "--no-color"], (80, 24));
    terminal.wait_for(&["front", "starting"]);
    for step in 1..=15_u64 {
        let residual = step as f64 / 6.0;
        let channel = Channel {
            lower: -2.0,
            residual,
            upper: 2.0,
            ratio: residual / 2.0,
        };
        let verdict = if residual > 2.0 {
            Verdict::Fault
        } else {
            Verdict::Nominal
        };
        daemon.publish_at(
            begin + step * SECOND,
            0,
            1_000 + step,
            verdict,
            &[channel, Channel::NOT_EVALUATED],
        );
        terminal.wait_for(&[&(1_000 + step).to_string()]);
    }
    terminal.press("\r");
    terminal.wait_for(&["last 60 s"]);
    terminal.press("--");
    let text = terminal.wait_for(&["last 10 s"]);
    insta::assert_snapshot!("plot_80x24", masked(&text));
    terminal.press("\t");
    terminal.wait_for(&["yaw [rad/s]", "not evaluated within the last 10 s"]);
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
    terminal.wait_for(&["daemon running", "starting"]);
    daemon.publish(1, 7_777, Verdict::Nominal, &[]);
    terminal.wait_for(&["● rear", "7777"]);
    terminal.press("q");
    assert!(terminal.end().success());
}

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
    daemon.writer.raise(&transition(AlarmState::Pending, 102));
    terminal.wait_for(&["203 102.000", "△ pending", "202 101.000"]);
    terminal.press("\x1b");
    terminal.wait_for(&["Enter detail"]);
    terminal.press("q");
    assert!(terminal.end().success());
}
