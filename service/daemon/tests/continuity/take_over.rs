//! Engines that take over from each other, as at a reload.

use proptest::prelude::*;
use residual_shared::alarm::{AlarmState, alarm_flags};
use residuald::identities::Identities;
use residuald::runtime::engine::Engine;

use crate::counting_allocator::allocations;
use crate::fixture::{Records, Said, Setup, assert_same, samples};

/// At which sample the configuration is exchanged, and what the new one is like.
#[derive(Clone, Debug)]
struct Reload {
    moment: f64,
    /// Order of the inputs and of the diagnosers, by the rank of these numbers.
    inputs: Vec<u32>,
    diagnosers: Vec<u32>,
    /// For every diagnoser: absent, changed, or as it is.
    fate: Vec<u8>,
}

fn reload() -> impl Strategy<Value = Reload> {
    let numbers = || prop::collection::vec(any::<u32>(), 32);
    let fate = prop::collection::vec(0_u8..4, 32);
    (0.05..0.95, numbers(), numbers(), fate).prop_map(|(moment, inputs, diagnosers, fate)| Reload {
        moment,
        inputs,
        diagnosers,
        fate,
    })
}

fn ranked(numbers: &[u32], count: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..count).collect();
    order.sort_by_key(|&index| numbers[index]);
    order
}

impl Reload {
    /// The new setup: every second diagnoser stays as it is, the others may be absent or changed.
    fn setup(&self, all: &Setup) -> Setup {
        let absent = |slot: usize| slot % 2 == 1 && self.fate[slot] == 0;
        let order: Vec<usize> = ranked(&self.diagnosers, all.diagnosers.len())
            .into_iter()
            .filter(|&slot| !absent(slot))
            .collect();
        let mut setup = all.arranged(&ranked(&self.inputs, all.configuration.inputs.len()), &order);
        for (place, &slot) in order.iter().enumerate() {
            if slot % 2 == 1 && self.fate[slot] == 1 {
                setup.configuration.diagnosers[place].priority += 1;
            }
        }
        setup
    }
}

/// The records of the diagnosers that every setup has unchanged, by name.
fn of_unchanged(all: &Setup, records: Records) -> Vec<Said> {
    let names: Vec<&str> = (all.configuration.diagnosers.iter().step_by(2))
        .map(|diagnoser| diagnoser.name.as_str())
        .collect();
    let mut list = records.list;
    list.retain(|said| names.contains(&said.diagnoser.as_str()));
    list.sort_by(|one, other| (&one.diagnoser, one.record.step).cmp(&(&other.diagnoser, other.record.step)));
    list
}

/// The transitions of the alarms of the same diagnosers, as text by name: most have numbers that are NaN.
fn alarms_of_unchanged(all: &Setup, records: &Records) -> Vec<String> {
    let names: Vec<&str> = (all.configuration.diagnosers.iter().step_by(2))
        .map(|diagnoser| diagnoser.name.as_str())
        .collect();
    let alarms = records.alarms.iter();
    let mut list: Vec<_> = alarms
        .filter(|(name, _)| names.contains(&name.as_str()))
        .collect();
    list.sort_by_key(|(name, _)| name);
    list.iter().map(|alarm| format!("{alarm:?}")).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(8))]

    #[test]
    fn diagnosers_that_stay_the_same_do_not_notice_that_engines_take_over_from_each_other(
        seed in any::<u64>(),
        mut reloads in prop::collection::vec(reload(), 1..12),
    ) {
        reloads.sort_by(|one, other| one.moment.total_cmp(&other.moment));
        let all = Setup::all();
        let samples = samples(seed, 3);
        let (mut undisturbed, mut engine) = (all.engine(), all.engine());
        let (mut expected, mut records) = (all.records(), all.records());
        let mut setup = all.clone();
        let mut identities = Identities::of(&setup.configuration, &setup.diagnosers);
        let mut reloads = reloads.iter().peekable();
        for (number, sample) in samples.iter().enumerate() {
            while let Some(reload) = reloads.next_if(|reload| reload.moment * samples.len() as f64 <= number as f64) {
                let new = reload.setup(&all);
                let new_identities = Identities::of(&new.configuration, &new.diagnosers);
                let same = new_identities.correspondence(&identities);
                prop_assert!(same.kept.iter().flatten().count() >= all.diagnosers.len().div_ceil(2));
                let mut next = new.engine();
                let (allocated, ()) = allocations(|| next.take_over(&mut engine, &same, sample.now_ns));
                prop_assert_eq!(allocated, 0);
                engine = next;
                records.names = new.records().names;
                (setup, identities) = (new, new_identities);
            }
            all.feed(&mut undisturbed, sample, &mut expected);
            setup.feed(&mut engine, sample, &mut records);
        }
        // No diagnoser, however it changed, missed an instant of a life that it had.
        for said in &records.list {
            prop_assert_eq!(said.record.skipped_instants, 0);
        }
        let counters = |setup: &Setup, engine: &Engine, name: &str| {
            let slot = setup.configuration.diagnosers.iter().position(|d| d.name == name).unwrap();
            *engine.schedule_counters().nth(slot).unwrap()
        };
        for diagnoser in all.configuration.diagnosers.iter().step_by(2) {
            prop_assert_eq!(
                counters(&setup, &engine, &diagnoser.name),
                counters(&all, &undisturbed, &diagnoser.name)
            );
        }
        for (input, counters) in all.configuration.inputs.iter().zip(undisturbed.input_counters()) {
            let place = setup.configuration.inputs.iter().position(|new| new.name == input.name).unwrap();
            prop_assert_eq!(engine.input_counters().nth(place).unwrap(), counters);
        }
        prop_assert_eq!(alarms_of_unchanged(&all, &records), alarms_of_unchanged(&all, &expected));
        assert_same("after reloads", &of_unchanged(&all, records), &of_unchanged(&all, expected));
    }
}

/// Where the alarm of each diagnoser stands.
fn last_states(records: &Records) -> Vec<AlarmState> {
    let last = |name: &String| {
        let own = records.alarms.iter().rev().find(|(other, _)| other == name);
        own.map_or(AlarmState::Cleared, |(_, transition)| transition.state)
    };
    records.names.iter().map(last).collect()
}

#[test]
fn a_changed_diagnoser_begins_afresh_with_the_next_instant_and_goes_on_counting_its_alarms() {
    let all = Setup::all();
    let mut engine = all.engine();
    let mut records = all.records();
    // Until an alarm is there to be withdrawn.
    for sample in samples(1, 6) {
        all.feed(&mut engine, &sample, &mut records);
        if last_states(&records).contains(&AlarmState::Raised) {
            break;
        }
    }
    let now_ns = engine.next_due_ns().unwrap();
    let mut changed = all.clone();
    for diagnoser in &mut changed.configuration.diagnosers {
        diagnoser.priority += 1;
    }
    let identities = |setup: &Setup| Identities::of(&setup.configuration, &setup.diagnosers);
    let same = identities(&changed).correspondence(&identities(&all));
    assert!(same.kept.iter().all(Option::is_none));
    assert!(same.inputs.iter().all(Option::is_some));
    let mut next = changed.engine();
    let slots = 0..all.diagnosers.len();
    let occurrences = |engine: &Engine| -> Vec<Option<u64>> {
        slots.clone().map(|slot| engine.occurrences(slot)).collect()
    };
    let raised = occurrences(&engine);
    assert!(raised.iter().any(|count| *count > Some(0)), "{raised:?}");
    next.take_over(&mut engine, &same, now_ns);
    assert_eq!(occurrences(&next), raised);
    let last: Vec<u64> = (records.names.iter())
        .map(|name| {
            let own = records.list.iter().filter(|said| said.diagnoser == *name);
            own.map(|said| said.record.step).max().unwrap()
        })
        .collect();
    let mut after = all.records();
    crate::fixture::step_before(&mut next, now_ns + crate::fixture::SECOND_NS, &mut after);
    for (name, last) in after.names.iter().zip(last) {
        let first = after.list.iter().find(|said| said.diagnoser == *name).unwrap();
        assert_eq!(first.record.step, last + 1, "{name}");
    }
    assert!(next.schedule_counters().all(|counters| counters.skipped == 0));
    let mut withdrawn = Vec::new();
    engine.withdraw_alarms(|slot, transition| withdrawn.push((slot, transition)));
    let states = last_states(&records);
    assert!(
        states.iter().any(|state| *state != AlarmState::Cleared),
        "{states:?}"
    );
    for (slot, state) in states.iter().enumerate() {
        let transition = withdrawn.iter().find(|(withdrawn, _)| *withdrawn == slot);
        assert_eq!(transition.is_some(), *state != AlarmState::Cleared, "{slot}");
        if let Some((_, transition)) = transition {
            assert_eq!(transition.state, AlarmState::Cleared);
            assert_eq!(transition.flags, alarm_flags::WITHDRAWN);
        }
    }
}

#[test]
fn a_diagnoser_that_was_reset_has_no_record_to_show_before_its_next_step() {
    let all = Setup::all();
    let mut engine = all.engine();
    let mut records = all.records();
    for sample in samples(1, 1) {
        all.feed(&mut engine, &sample, &mut records);
    }
    let shown = |engine: &Engine| -> Vec<usize> { engine.latest_records().map(|(slot, _)| slot).collect() };
    let before = shown(&engine);
    let slot = before[0];
    assert!(engine.reset(slot, &mut records));
    assert_eq!(shown(&engine), before[1..]);
    let now_ns = engine.next_due_ns().unwrap() + crate::fixture::SECOND_NS;
    crate::fixture::step_before(&mut engine, now_ns, &mut records);
    assert!(shown(&engine).contains(&slot));
}
