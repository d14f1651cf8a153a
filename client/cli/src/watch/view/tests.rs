//! The view at several sizes, as text.

use std::collections::BTreeMap;
use std::sync::Arc;

use ratatui::Terminal;
use ratatui::backend::TestBackend;
use ratatui::buffer::Buffer;
use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyModifiers};
use ratatui::style::{Color, Modifier};
use residual_client::{
    Alarm, AlarmEvent, AlarmNumber, AlarmState, AlarmTransition, ChannelSpec, NONE, SlotSpec,
};

use crate::number::Number;
use crate::snapshot::{AlarmView, ChannelView, Condition, DiagnoserView, InputView, Snapshot};
use crate::watch::state::ViewState;
use crate::watch::view;

const SIZES: [(u16, u16); 7] = [(80, 24), (120, 40), (40, 10), (20, 5), (10, 2), (1, 1), (0, 0)];

const SECOND: u64 = 1_000_000_000;

fn channel(name: &str, unit: &str, residual: f64, half_width: f64) -> ChannelView {
    ChannelView {
        name: name.into(),
        unit: unit.into(),
        lower: Number(-half_width),
        residual: Number(residual),
        upper: Number(half_width),
        ratio: Number(residual.abs() / half_width),
    }
}

fn diagnoser(name: &str, record: u64, verdict: &'static str, channels: Vec<ChannelView>) -> DiagnoserView {
    let is_fault = matches!(verdict, "fault" | "isolated");
    let evaluated = channels.iter().filter(|channel| !channel.ratio.0.is_nan());
    DiagnoserView {
        name: name.into(),
        method: "chi_square".into(),
        period_ns: SECOND / 100,
        freshness: "fresh",
        record,
        verdict,
        certainly_faulty: if is_fault { vec!["valve".into()] } else { vec![] },
        possibly_faulty: if is_fault {
            vec!["pump".into(), "valve".into()]
        } else {
            vec![]
        },
        fault_estimate: Number(if is_fault { 0.2 } else { f64::NAN }),
        fault_estimate_half_width: Number(if is_fault { 0.04 } else { f64::NAN }),
        step: 1_000 + record,
        instant_ns: 100 * SECOND + record * SECOND,
        flags: if is_fault {
            vec!["input missing", "alarm now"]
        } else {
            vec![]
        },
        worst_channel: evaluated
            .max_by(|left, right| left.ratio.0.total_cmp(&right.ratio.0))
            .cloned(),
        channels,
        counters: BTreeMap::from([("skipped", 3), ("overruns", 0), ("records_dropped", 12)]),
        alarm: AlarmView {
            state: if is_fault {
                AlarmState::Isolated
            } else {
                AlarmState::Cleared
            },
            occurrences: if is_fault { 2 } else { 0 },
            is_latched: is_fault,
        },
        condition: match verdict {
            "fault" | "isolated" => Condition::Faulty,
            "nominal" => Condition::Sound,
            _ => Condition::Unknown,
        },
    }
}

/// The `record`-th look: the residual of the first channel of `steering` swings, and leaves its bounds at last.
fn snapshot(record: u64) -> Snapshot {
    let swing = 2.5 * (record as f64 / 8.0).sin() * record as f64 / 60.0;
    let verdict = if swing.abs() > 2.0 { "isolated" } else { "nominal" };
    let steering = vec![
        channel("yaw rate", "rad/s", swing, 2.0),
        channel("force", "N", 75.0, 100.0),
        ChannelView {
            ratio: Number(f64::NAN),
            ..channel("current", "A", 0.0, 0.0)
        },
        ChannelView {
            lower: Number(f64::NEG_INFINITY),
            ratio: Number(0.0),
            ..channel("energy", "", 1e-9, f64::INFINITY)
        },
    ];
    let quiet = |name: &str, freshness, verdict| DiagnoserView {
        freshness,
        condition: match (freshness, verdict) {
            ("fresh", "nominal") => Condition::Sound,
            _ => Condition::Unknown,
        },
        ..diagnoser(name, record, verdict, vec![channel("level", "m", 0.3, 1.0)])
    };
    let input = |name: &str, lost| InputView {
        name: name.into(),
        signals: vec!["x".into()],
        counters: BTreeMap::from([
            ("accepted", 100 * record),
            ("lost", lost),
            ("non_finite", 2 * lost),
        ]),
    };
    Snapshot {
        instance: "vehicle".into(),
        daemon: "running",
        pid: 4242,
        epoch: 7,
        now_ns: 100 * SECOND + record * SECOND + SECOND / 4,
        diagnosers: vec![
            diagnoser("steering", record, verdict, steering),
            quiet("tank", "fresh", "nominal"),
            quiet("coolant loop", "stale", "nominal"),
            quiet("gyro", "not evaluated", "not evaluated"),
            quiet("bank", "fresh", "guarantee lost"),
            DiagnoserView {
                record: 0,
                freshness: "starting",
                ..diagnoser("rear", 0, "starting", vec![])
            },
        ],
        inputs: vec![input("imu", 0), input("wheel speeds", 5)],
    }
}

/// A transition of the alarm of `steering`.
fn transition(number: u64, state: AlarmState) -> AlarmEvent {
    let name = |name: &str, unit: &str| ChannelSpec {
        name: name.into(),
        unit: unit.into(),
    };
    let diagnoser = SlotSpec {
        name: "steering".into(),
        method: "chi_square".into(),
        period_ns: SECOND / 100,
        phase_ns: 0,
        margin_ns: 0,
        channels: vec![name("yaw rate", "rad/s")],
        faults: vec!["pump".into(), "valve".into()],
    };
    let is_active = state.is_active();
    AlarmEvent::Transition(Alarm {
        transition: AlarmTransition {
            number: AlarmNumber { epoch: 7, number },
            written_ns: 0,
            instant_ns: (100 + number) * SECOND,
            step: 10 * number,
            slot: 0,
            identity: 0,
            state,
            flags: 0,
            verdict: 0,
            occurrence: 2,
            certainly_faulty: if state == AlarmState::Isolated { 0b10 } else { 0 },
            possibly_faulty: 0b11,
            channel: if is_active { 0 } else { NONE },
            ratio: if is_active { 1.25 } else { f64::NAN },
            fault_estimate: f64::NAN,
            fault_estimate_half_width: f64::NAN,
        },
        diagnoser: (number > 2).then(|| Arc::new(diagnoser)),
    })
}

/// The state after 60 looks and some alarms.
fn watched(has_colour: bool) -> ViewState {
    let mut state = ViewState::new(has_colour);
    state.alarms.hear(transition(2, AlarmState::Cleared));
    state.alarms.hear(AlarmEvent::NewNumbering {
        previous: AlarmNumber { epoch: 6, number: 2 },
        origin: 7,
    });
    state.alarms.hear(AlarmEvent::Gap { first: 1, last: 9 });
    let states = [
        AlarmState::Pending,
        AlarmState::Raised,
        AlarmState::Isolated,
        AlarmState::Cleared,
    ];
    for (number, alarm) in (10..).zip(states) {
        state.alarms.hear(transition(number, alarm));
    }
    for record in 1..=60 {
        state.look(Some(snapshot(record)));
    }
    state
}

fn press(state: &mut ViewState, keys: &[KeyCode]) -> bool {
    keys.iter()
        .any(|key| state.press(KeyEvent::new(*key, KeyModifiers::NONE)))
}

fn drawn(state: &ViewState, (width, height): (u16, u16)) -> Buffer {
    let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
    terminal.draw(|frame| view::draw(frame, state)).unwrap();
    terminal.backend().buffer().clone()
}

/// The characters; behind each line its styles, as runs of a column and what begins there.
fn text(buffer: &Buffer) -> String {
    let mut text = String::new();
    for row in buffer.area.rows() {
        let cells = || row.positions().map(|position| &buffer[position]);
        let symbols: String = cells().map(|cell| cell.symbol()).collect();
        text.push_str(&format!("|{symbols}|"));
        let mut before = (Color::Reset, Modifier::empty());
        for (column, cell) in cells().enumerate() {
            let style = (cell.fg, cell.modifier);
            if style != before {
                let modifier = if cell.modifier.is_empty() {
                    String::new()
                } else {
                    format!("+{:?}", cell.modifier)
                };
                text.push_str(&format!(" {column}:{:?}{modifier}", cell.fg));
                before = style;
            }
        }
        text.push('\n');
    }
    text
}

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
        for channel in snapshot
            .diagnosers
            .iter_mut()
            .flat_map(|diagnoser| &mut diagnoser.channels)
        {
            *channel = ChannelView {
                ratio: Number(value),
                ..self::channel(&channel.name, "m", value, -value)
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
