//! The pages at several sizes, with and without colour.

mod example;
mod moving;
mod rendered;

use ratatui::crossterm::event::KeyCode;
use ratatui::style::Color;

use crate::number::Number;
use crate::snapshot::ChannelView;
use crate::watch::state::ViewState;
use example::{channel, press, snapshot, watched};
use rendered::{drawn, text};

const SIZES: [(u16, u16); 7] = [(80, 24), (120, 40), (40, 10), (20, 5), (10, 2), (1, 1), (0, 0)];

fn assert_pages(name: &str, state: &ViewState) {
    let colour = if state.has_colour { "colour" } else { "no_colour" };
    for size in SIZES {
        insta::assert_snapshot!(
            format!("{name}_{}x{}_{colour}", size.0, size.1),
            text(&drawn(state, size))
        );
    }
}

#[test]
fn the_list_shows_all_diagnosers_and_inputs_at_every_size() {
    assert_pages("list", &watched(true));
    assert_pages("list", &watched(false));
}

#[test]
fn the_detail_shows_channels_faults_and_a_plot_at_every_size() {
    for has_colour in [true, false] {
        let mut state = watched(has_colour);
        press(&mut state, &[KeyCode::Enter]);
        assert_pages("detail", &state);
    }
}

#[test]
fn the_alarm_log_shows_the_newest_first_and_gaps_as_gaps_at_every_size() {
    for has_colour in [true, false] {
        let mut state = watched(has_colour);
        press(&mut state, &[KeyCode::Char('a')]);
        assert_pages("alarms", &state);
    }
}

#[test]
fn without_colour_nothing_is_coloured_and_every_state_is_a_word() {
    let mut state = watched(false);
    for page in [&[][..], &[KeyCode::Enter], &[KeyCode::Char('a')]] {
        press(&mut state, page);
        let buffer = drawn(&state, (120, 40));
        assert!(
            buffer
                .content
                .iter()
                .all(|cell| cell.fg == Color::Reset && cell.bg == Color::Reset)
        );
    }
    press(&mut state, &[KeyCode::Esc]);
    let shown = text(&drawn(&state, (80, 24)));
    for word in [
        "isolated",
        "nominal",
        "stale, nominal",
        "not evaluated",
        "guarantee lost",
        "starting",
        "running",
    ] {
        assert!(shown.contains(word), "{word}: {shown}");
    }
}

#[test]
fn no_size_and_no_value_makes_a_page_panic() {
    let mut strange = watched(true);
    for (record, value) in [
        (61, f64::MAX),
        (62, f64::MIN),
        (63, f64::NAN),
        (64, f64::INFINITY),
        (65, 5e-324),
    ] {
        let mut snapshot = snapshot(record);
        for shown in snapshot
            .diagnosers
            .iter_mut()
            .flat_map(|diagnoser| &mut diagnoser.channels)
        {
            *shown = ChannelView {
                ratio: Number(value),
                ..channel(&shown.name, "m", value, -value)
            };
        }
        strange.look(Some(snapshot));
    }
    let mut empty = ViewState::new(true);
    let mut no_diagnosers = snapshot(1);
    no_diagnosers.diagnosers.clear();
    let mut pages = vec![];
    for state in [&mut strange, &mut watched(true), &mut empty] {
        for keys in [&[][..], &[KeyCode::Enter], &[KeyCode::Tab], &[KeyCode::Char('a')]] {
            press(state, keys);
            let widths = (0..26).chain([40, 80]);
            for (width, height) in widths.flat_map(|width| (0..14).map(move |height| (width, height))) {
                pages.push(drawn(state, (width, height)).area.area());
            }
        }
    }
    empty.look(Some(no_diagnosers));
    press(&mut empty, &[KeyCode::Down, KeyCode::Enter, KeyCode::Tab]);
    drawn(&empty, (80, 24));
    drawn(&strange, (120, 40));
    assert_eq!(pages.len(), 3 * 4 * 28 * 14);
}
