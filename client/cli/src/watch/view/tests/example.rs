//! A vehicle to look at.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyModifiers};
use residual_client::{
    Alarm, AlarmEvent, AlarmNumber, AlarmState, AlarmTransition, ChannelSpec, NONE, SlotSpec,
};
use time::OffsetDateTime;

use crate::number::Number;
use crate::snapshot::{AlarmView, ChannelView, Condition, DiagnoserView, InputView, Snapshot};
use crate::watch::alarm_log::Heard;
use crate::watch::state::ViewState;

/// Nanoseconds.
pub const SECOND: u64 = 1_000_000_000;

/// A channel between two equal bounds.
pub fn channel(name: &str, unit: &str, residual: f64, half_width: f64) -> ChannelView {
    ChannelView {
        name: name.into(),
        unit: unit.into(),
        lower: Number(-half_width),
        residual: Number(residual),
        upper: Number(half_width),
        ratio: Number(residual.abs() / half_width),
    }
}

/// A diagnoser after so many records, one a second.
pub fn diagnoser(
    name: &str,
    record: u64,
    verdict: &'static str,
    channels: Vec<ChannelView>,
) -> DiagnoserView {
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
pub fn snapshot(record: u64) -> Snapshot {
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
pub fn transition(number: u64, state: AlarmState) -> Heard {
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
    heard(AlarmEvent::Transition(Alarm {
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
    }))
}

/// An event and a time of day.
fn heard(event: AlarmEvent) -> Heard {
    let second = match &event {
        AlarmEvent::Transition(alarm) => alarm.transition.number.number,
        _ => 0,
    };
    Heard {
        event,
        written: OffsetDateTime::UNIX_EPOCH + Duration::from_secs(1_000_000 + second),
    }
}

/// The state after 60 looks and some alarms.
pub fn watched(has_colour: bool) -> ViewState {
    let mut state = ViewState::new(has_colour);
    state.alarms.hear(transition(2, AlarmState::Cleared));
    state.alarms.hear(heard(AlarmEvent::NewNumbering {
        previous: AlarmNumber { epoch: 6, number: 2 },
        origin: 7,
    }));
    state.alarms.hear(heard(AlarmEvent::Gap { first: 1, last: 9 }));
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

/// Presses the keys; tells whether one of them ended the view.
pub fn press(state: &mut ViewState, keys: &[KeyCode]) -> bool {
    keys.iter()
        .any(|key| state.press(KeyEvent::new(*key, KeyModifiers::NONE)))
}
