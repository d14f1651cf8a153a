//! Keys, and what is shown where not everything fits.

use std::collections::BTreeMap;

use ratatui::crossterm::event::KeyCode;
use residual_client::AlarmState;

use super::example::{diagnoser, press, snapshot, transition, watched};
use super::rendered::{drawn, text};
use crate::snapshot::InputView;
use crate::watch::state::ViewState;

#[test]
fn what_is_looked_at_in_the_alarm_log_stays_in_place_when_more_come() {
    let mut state = watched(false);
    press(&mut state, &[KeyCode::Char('a')]);
    let first_row = |state: &ViewState| text(&drawn(state, (80, 24))).lines().nth(2).unwrap().to_owned();
    assert!(first_row(&state).contains("cleared"));
    state.alarms.hear(transition(14, AlarmState::Pending));
    assert!(
        first_row(&state).contains("pending"),
        "at the top the newest is shown"
    );
    press(&mut state, &[KeyCode::Down, KeyCode::Down]);
    let before = first_row(&state);
    assert!(before.contains("isolated"));
    state.alarms.hear(transition(15, AlarmState::Raised));
    assert_eq!(first_row(&state), before);
    press(&mut state, &[KeyCode::End]);
    assert!(
        first_row(&state).contains("unknown"),
        "the diagnoser of the oldest has gone"
    );
    for number in 16..20_000 {
        state.alarms.hear(transition(number, AlarmState::Pending));
    }
    assert_eq!(state.alarms.count(), 10_000);
    press(&mut state, &[KeyCode::Home, KeyCode::Char('a')]);
    assert!(
        text(&drawn(&state, (80, 24))).contains("wheel speeds"),
        "back in the list"
    );
}

#[test]
fn the_selection_stays_with_its_diagnoser_and_channel_over_a_restart_with_others() {
    let mut state = watched(true);
    press(&mut state, &[KeyCode::Enter, KeyCode::Tab]);
    let chosen = |state: &ViewState| {
        let diagnoser = state.diagnoser().unwrap();
        (
            diagnoser.name.clone(),
            diagnoser.channels[state.channel].name.clone(),
        )
    };
    assert_eq!(chosen(&state), ("steering".into(), "force".into()));
    let mut next = snapshot(61);
    next.epoch = 8;
    next.diagnosers.reverse();
    next.diagnosers.last_mut().unwrap().channels.reverse();
    state.look(Some(next));
    assert_eq!(chosen(&state), ("steering".into(), "force".into()));
    let mut gone = snapshot(62);
    gone.diagnosers.truncate(0);
    state.look(Some(gone));
    assert!(state.diagnoser().is_none());
    assert!(text(&drawn(&state, (80, 24))).contains("wheel speeds"));
}

#[test]
fn keys_move_within_the_rows_and_end_the_view_only_from_the_list() {
    let mut state = watched(true);
    press(&mut state, &[KeyCode::Up, KeyCode::Char('k')]);
    assert_eq!(state.selected, 0);
    press(&mut state, &[KeyCode::Down, KeyCode::Char('j')]);
    assert_eq!(state.selected, 2);
    press(&mut state, &[KeyCode::PageDown, KeyCode::Down]);
    assert_eq!(state.selected, 5);
    press(&mut state, &[KeyCode::Home, KeyCode::Enter]);
    let window = state.window_s();
    press(&mut state, &[KeyCode::Char('+')]);
    assert!(state.window_s() > window);
    press(&mut state, &[KeyCode::Char('-'), KeyCode::Char('-')]);
    assert!(state.window_s() < window);
    press(&mut state, &[KeyCode::BackTab]);
    assert_eq!(state.channel, 3);
    press(&mut state, &[KeyCode::Tab]);
    assert_eq!(state.channel, 0);
    assert!(!press(&mut state, &[KeyCode::Esc]), "back to the list");
    assert!(press(&mut state, &[KeyCode::Esc]));
    assert!(press(&mut state, &[KeyCode::Char('q')]));
}

#[test]
fn of_more_rows_than_fit_the_selected_one_is_shown() {
    let mut state = ViewState::new(false);
    let mut many = snapshot(1);
    let names: Vec<_> = (0..100).map(|index| format!("unit {index}")).collect();
    many.diagnosers = names
        .iter()
        .map(|name| diagnoser(name, 1, "nominal", vec![]))
        .collect();
    state.look(Some(many));
    for index in [0, 1, 50, 98, 99] {
        state.selected = index;
        let shown = text(&drawn(&state, (80, 12)));
        let row = shown.lines().find(|line| line.contains("REVERSED")).unwrap();
        assert!(row.contains(&format!("unit {index} ")), "{index}: {shown}");
    }
}

#[test]
fn of_more_inputs_than_fit_those_with_losses_come_first() {
    let mut state = ViewState::new(false);
    let mut many = snapshot(1);
    many.inputs = (0..30)
        .map(|index| InputView {
            name: format!("sensor {index}"),
            signals: vec![],
            counters: BTreeMap::from([("accepted", 9), ("lost", u64::from(index == 27))]),
        })
        .collect();
    state.look(Some(many));
    let shown = text(&drawn(&state, (80, 24)));
    let inputs = shown.split("input ").nth(1).unwrap();
    assert!(inputs.lines().nth(1).unwrap().contains("sensor 27"), "{shown}");
    let shown_inputs = inputs.lines().filter(|line| line.contains("sensor")).count();
    assert!(
        inputs.contains(&format!("… {} more inputs", 30 - shown_inputs)),
        "{shown}"
    );
}

#[test]
fn the_detail_opens_at_the_worst_channel() {
    let mut state = watched(true);
    let mut next = snapshot(61);
    let steering = &mut next.diagnosers[0];
    steering.worst_channel = Some(steering.channels[1].clone());
    state.look(Some(next));
    press(&mut state, &[KeyCode::Enter]);
    assert_eq!(state.channel, 1, "force");
    press(&mut state, &[KeyCode::Right]);
    assert_eq!((state.selected, state.channel), (1, 0), "the only one of tank");
    press(&mut state, &[KeyCode::Left]);
    assert_eq!((state.selected, state.channel), (0, 1));
}
