//! The state machine against the reference, and the facts that users rely on.

use proptest::collection::vec;
use proptest::prelude::*;
use residual_shared::alarm::{AlarmState, alarm_flags};
use residual_shared::counters::AlarmStatus;
use residual_shared::record::{Channel, StepRecord, Verdict};

use super::reference::{Instant, Reference};
use super::*;
use crate::configuration::SignalReference;

const VERDICTS: [Verdict; 6] = [
    Verdict::Starting,
    Verdict::Nominal,
    Verdict::Fault,
    Verdict::Isolated,
    Verdict::NotEvaluated,
    Verdict::GuaranteeLost,
];

#[derive(Clone, Debug)]
enum Event {
    Step(Box<Instant>),
    Acknowledge,
    Reset,
}

fn instant(verdict: Verdict, ratios: &[f64], faulty: u64) -> Instant {
    let mut record = StepRecord::new(ratios.len());
    record.verdict = verdict as u32;
    record.certainly_faulty = faulty;
    for (channel, &ratio) in record.channels_mut().iter_mut().zip(ratios) {
        *channel = Channel {
            ratio,
            ..Channel::estimate(0.0, 1.0)
        };
    }
    Instant {
        record,
        enabled: ALL_CHANNELS,
    }
}

fn any_rules() -> impl Strategy<Value = Rules> {
    let window = prop_oneof![1_u32..6, Just(64)];
    (
        window,
        1_u32..5,
        prop_oneof![Just(1.0), Just(0.5)],
        any::<bool>(),
        0_u64..6,
    )
        .prop_flat_map(
            |(raise_window, clear_steps, clear_ratio, latch, suppressed_instants)| {
                (1..=raise_window.min(5)).prop_map(move |raise_steps| Rules {
                    raise_steps,
                    raise_window,
                    clear_steps,
                    clear_ratio,
                    latch,
                    suppressed_instants,
                })
            },
        )
}

fn any_event() -> impl Strategy<Value = Event> {
    let ratio = prop_oneof![Just(0.2), Just(0.7), Just(1.0), Just(1.5), Just(f64::NAN)];
    let verdict =
        prop_oneof![3 => Just(1), 3 => Just(2), 2 => Just(3), 1 => Just(4), 1 => Just(5), 1 => Just(0)];
    let step = (
        verdict,
        [ratio.clone(), ratio],
        0_u64..4,
        0_u64..4,
        prop_oneof![4 => Just(0), 1 => Just(2)],
    )
        .prop_map(
            |(verdict, ratios, enabled, faulty, skipped): (usize, _, _, _, u32)| {
                let mut instant = instant(VERDICTS[verdict], &ratios, faulty);
                instant.enabled = enabled;
                instant.record.skipped_instants = skipped;
                Event::Step(Box::new(instant))
            },
        );
    prop_oneof![30 => step, 1 => Just(Event::Acknowledge), 1 => Just(Event::Reset)]
}

/// Whether an alarm may go from one state to the next by a step, an acknowledgement or a reset.
fn is_legal(from: AlarmState, change: &Change) -> bool {
    use AlarmState::{Cleared, Isolated, Pending, Raised};
    let acknowledged = change.flags & alarm_flags::ACKNOWLEDGED != 0;
    match (from, change.state) {
        (Cleared, Pending | Raised)
        | (Pending, Raised | Cleared)
        | (Raised, Isolated | Cleared)
        | (Isolated, Isolated | Cleared) => true,
        (Raised, Raised) => acknowledged,
        _ => false,
    }
}

fn changes_of(lifecycle: &mut Lifecycle, event: &Event) -> Vec<Change> {
    match event {
        Event::Step(instant) => lifecycle.advance(&instant.record, instant.enabled).collect(),
        Event::Acknowledge => lifecycle.acknowledge().into_iter().collect(),
        Event::Reset => lifecycle.reset().into_iter().collect(),
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(600))]

    #[test]
    fn it_does_what_the_definitions_say_with_legal_transitions_and_rising_occurrences(
        rules in any_rules(), events in vec(any_event(), 1..150),
    ) {
        let (mut lifecycle, mut reference) = (Lifecycle::new(rules), Reference::new(rules));
        let (mut state, mut occurrence) = (AlarmState::Cleared, 0);
        for (number, event) in events.iter().enumerate() {
            let changes = changes_of(&mut lifecycle, event);
            let expected = match event {
                Event::Step(instant) => reference.advance(**instant),
                Event::Acknowledge => reference.acknowledge().into_iter().collect(),
                Event::Reset => reference.reset().into_iter().collect(),
            };
            prop_assert_eq!(&changes, &expected, "event {} of {:?}", number, rules);
            for change in &changes {
                prop_assert!(is_legal(state, change), "{:?} -> {:?}", state, change);
                occurrence += u64::from(change.state == AlarmState::Raised && !state.is_active());
                prop_assert_eq!(change.occurrence, occurrence);
                state = change.state;
            }
            prop_assert_eq!(lifecycle.state(), state);
        }
    }

    #[test]
    fn a_saved_and_restored_alarm_goes_on_as_an_uninterrupted_one(
        rules in any_rules(), events in vec(any_event(), 1..120), cut in 0_usize..120,
    ) {
        let mut whole = Lifecycle::new(rules);
        let mut interrupted = Lifecycle::new(rules);
        for (number, event) in events.iter().enumerate() {
            if number == cut {
                let saved = serde_json::to_string(&interrupted.save()).unwrap();
                interrupted = Lifecycle::new(rules);
                interrupted.restore(&serde_json::from_str(&saved).unwrap());
            }
            prop_assert_eq!(changes_of(&mut whole, event), changes_of(&mut interrupted, event));
        }
    }

    #[test]
    fn what_the_table_shows_of_an_active_alarm_is_enough_to_go_on(
        rules in any_rules(), events in vec(any_event(), 1..120),
    ) {
        let mut lifecycle = Lifecycle::new(rules);
        let (mut status, mut isolated) = (AlarmStatus::default(), None);
        for event in &events {
            for change in changes_of(&mut lifecycle, event) {
                status.state = change.state as u64;
                status.flags = change.flags.into();
                status.occurrences = change.occurrence;
                let Event::Step(instant) = event else { continue };
                isolated = (change.state == AlarmState::Isolated).then_some(instant.record.certainly_faulty);
            }
        }
        let mut restored = Lifecycle::new(rules);
        restored.restore(&LifecycleState::shown(&status, isolated));
        prop_assert_eq!(restored.state(), lifecycle.state());
        let (was, is) = (lifecycle.save(), restored.save());
        prop_assert_eq!(
            (is.acknowledged, is.occurrences, is.isolated),
            (was.acknowledged, was.occurrences, was.isolated)
        );
    }
}

/// Steps with these ratios of one channel; above 1 the verdict is `Fault`.
fn states(lifecycle: &mut Lifecycle, ratios: impl IntoIterator<Item = f64>) -> Vec<(usize, AlarmState)> {
    let step = |ratio: f64| {
        let verdict = if ratio > 1.0 {
            Verdict::Fault
        } else {
            Verdict::Nominal
        };
        instant(verdict, &[ratio], 0)
    };
    let mut states = vec![];
    for (number, ratio) in ratios.into_iter().enumerate() {
        let changes = lifecycle.advance(&step(ratio).record, ALL_CHANNELS);
        states.extend(changes.map(|change| (number, change.state)));
    }
    states
}

#[test]
fn three_of_five_raise_at_the_third_violation_and_two_do_not() {
    let rules = Rules {
        raise_steps: 3,
        raise_window: 5,
        ..Rules::default()
    };
    use AlarmState::{Cleared, Pending, Raised};
    let mut alarm = Lifecycle::new(rules);
    let two_of_five = [2.0, 0.0, 0.0, 2.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    assert_eq!(states(&mut alarm, two_of_five), [(0, Pending), (11, Cleared)]);
    assert_eq!(rules.intermittent_delay_steps(), 4);
    assert_eq!(
        states(&mut alarm, [2.0, 0.0, 2.0, 0.0, 2.0]),
        [(0, Pending), (4, Raised)]
    );
    assert_eq!(rules.persistent_delay_steps(), 2);
    assert_eq!(
        states(&mut Lifecycle::new(rules), [2.0; 3]),
        [(0, Pending), (2, Raised)]
    );
}

#[test]
fn a_fault_of_a_million_steps_is_cleared_as_fast_as_one_of_a_step() {
    use AlarmState::{Cleared, Raised};
    for length in [1, 1_000_000] {
        let mut alarm = Lifecycle::new(Rules::default());
        let steps = std::iter::repeat_n(2.0, length).chain([0.0; 10]);
        assert_eq!(states(&mut alarm, steps), [(0, Raised), (length + 4, Cleared)]);
    }
}

#[test]
fn a_residual_that_stays_within_the_hysteresis_never_flaps() {
    let mut alarm = Lifecycle::new(Rules {
        clear_ratio: 0.8,
        clear_steps: 3,
        ..Rules::default()
    });
    // Above 0.8 at least at every third step, and to either side of the bound.
    let ratios = (0..30_000).map(|k| match k % 3 {
        0 => 0.81 + 0.4 * f64::from(k % 7) / 7.0,
        _ => 0.3,
    });
    let changes = states(&mut alarm, ratios);
    assert_eq!(changes.len(), 1, "{changes:?}");
    assert_eq!(changes[0].1, AlarmState::Raised);
}

#[test]
fn a_verdict_that_a_disabled_channel_caused_is_not_heard_and_one_without_guarantee_is() {
    let mut alarm = Lifecycle::new(Rules::default());
    let mut step = |verdict, ratios: &[f64], enabled| {
        let changes = alarm.advance(&instant(verdict, ratios, 0).record, enabled);
        changes.map(|change| change.state).collect::<Vec<_>>()
    };
    assert_eq!(step(Verdict::Fault, &[2.0, 0.1], 0b10), []);
    assert_eq!(
        step(Verdict::Fault, &[0.2, 0.1], 0b11),
        [],
        "latched by the method"
    );
    assert_eq!(step(Verdict::Nominal, &[0.2, 0.1], 0b11), []);
    assert_eq!(
        step(Verdict::GuaranteeLost, &[f64::NAN; 2], 0b11),
        [AlarmState::Raised]
    );
}

#[test]
fn a_channel_counts_while_all_its_conditions_hold_and_not_before_their_first_samples() {
    let condition = |channels, element, range| EnableCondition {
        channels,
        signal: SignalReference { input: 0, element },
        range,
    };
    let enabling = Enabling::new(vec![
        condition(0b01, 0, [1.0, 2.0]),
        condition(0b11, 1, [-1.0, 1.0]),
    ]);
    let enabled = |values: [Option<f64>; 2]| enabling.enabled(|signal| values[signal.element]) & 0b111;
    assert_eq!(enabled([None, None]), 0b100);
    assert_eq!(enabled([Some(1.0), Some(1.0)]), 0b111);
    assert_eq!(enabled([Some(2.1), Some(0.0)]), 0b110);
    assert_eq!(enabled([Some(f64::NAN), Some(0.0)]), 0b110);
    assert_eq!(enabled([Some(1.5), Some(1.1)]), 0b100);
}

#[test]
fn a_latched_alarm_stays_until_somebody_has_seen_it() {
    use AlarmState::{Cleared, Raised};
    let mut alarm = Lifecycle::new(Rules {
        latch: true,
        ..Rules::default()
    });
    let (latched, acknowledged) = (alarm_flags::LATCHED, alarm_flags::ACKNOWLEDGED);
    let change = |state, flags, occurrence| Change {
        state,
        flags,
        occurrence,
    };
    assert_eq!(alarm.acknowledge(), None);
    assert_eq!(
        states(&mut alarm, [2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
        [(0, Raised)]
    );
    assert_eq!(alarm.acknowledge(), Some(change(Cleared, acknowledged, 1)));
    assert_eq!(states(&mut alarm, [2.0, 2.0]), [(0, Raised)]);
    assert_eq!(
        alarm.acknowledge(),
        Some(change(Raised, latched | acknowledged, 2))
    );
    assert_eq!(alarm.acknowledge(), None);
    assert_eq!(states(&mut alarm, [0.0; 5]), [(4, Cleared)]);
    assert_eq!(states(&mut alarm, [2.0, 0.0]), [(0, Raised)]);
    assert_eq!(alarm.reset(), Some(change(Cleared, alarm_flags::RESET, 3)));
    assert_eq!(alarm.reset(), None);
}
