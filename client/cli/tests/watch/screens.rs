//! What is shown.

use residual_shared::clock::monotonic_ns;
use residual_shared::record::{Channel, Verdict};

use crate::scene::{SECOND, daemon, living_daemon, watch};
use crate::terminal::Terminal;

const SIZES: [(u16, u16); 6] = [(80, 24), (120, 40), (40, 10), (20, 5), (10, 2), (1, 1)];

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
