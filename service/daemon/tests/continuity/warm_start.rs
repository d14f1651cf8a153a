//! A snapshot, and an engine that goes on from it.

use proptest::prelude::*;
use residuald::runtime::engine::Engine;
use residuald::runtime::snapshot::{Progress, Snapshot, parts};
use residuald::runtime::warm_start::{LONGEST_GAP_NS, NoWarmStart};

use crate::counting_allocator::allocations;
use crate::fixture::{EPOCH_NS, SECOND_NS, Setup, assert_same, samples, step_before};

/// A whole snapshot, written in one go.
fn snapshot(engine: &Engine) -> Snapshot {
    let mut snapshot = Snapshot::default();
    loop {
        match engine.save(&mut snapshot, || true) {
            Progress::Whole => return snapshot,
            Progress::NoRoom => snapshot.grow(),
            Progress::Unfinished => panic!("there was time"),
        }
    }
}

/// A new engine of the setup that goes on from a snapshot at `now_ns`; all parts fit, and every diagnoser skips
/// as many instants as `skipped` says for its period.
fn restored(setup: &Setup, snapshot: &Snapshot, now_ns: u64, skipped: impl Fn(u64) -> u64) -> Engine {
    let mut engine = setup.engine();
    let parts = parts(snapshot.bytes()).unwrap();
    let (diagnosers, inputs) = parts.split_at(setup.diagnosers.len());
    assert_eq!(inputs.len(), setup.configuration.inputs.len());
    for (input, part) in inputs.iter().enumerate() {
        assert!(engine.restore_input(input, part));
    }
    for (slot, part) in diagnosers.iter().enumerate() {
        let period_ns = setup.configuration.diagnosers[slot].period_ns;
        assert_eq!(
            engine.restore_diagnoser(slot, part, now_ns),
            Ok(skipped(period_ns))
        );
    }
    engine
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(6))]

    #[test]
    fn an_engine_goes_on_from_its_snapshot_as_if_nothing_had_happened(
        seed in any::<u64>(),
        moments in prop::collection::vec(0.0..1.0, 1..4),
    ) {
        let setup = Setup::all();
        let samples = samples(seed, 4);
        let (mut uninterrupted, mut engine) = (setup.engine(), setup.engine());
        let (mut expected, mut records) = (setup.records(), setup.records());
        let mut moments: Vec<usize> = moments.iter().map(|m| (m * samples.len() as f64) as usize).collect();
        moments.sort_unstable();
        for (number, sample) in samples.iter().enumerate() {
            if moments.contains(&number) {
                // Whatever is due at this moment has been done, so nothing is skipped.
                step_before(&mut uninterrupted, sample.now_ns + 1, &mut expected);
                step_before(&mut engine, sample.now_ns + 1, &mut records);
                engine = restored(&setup, &snapshot(&engine), sample.now_ns, |_| 0);
            }
            setup.feed(&mut uninterrupted, sample, &mut expected);
            setup.feed(&mut engine, sample, &mut records);
        }
        assert_same("after a restart", &records.list, &expected.list);
        prop_assert_eq!(format!("{:?}", records.alarms), format!("{:?}", expected.alarms));
        prop_assert!(engine.input_counters().eq(uninterrupted.input_counters()));
        prop_assert!(engine.schedule_counters().eq(uninterrupted.schedule_counters()));
    }
}

#[test]
fn instants_that_passed_are_skipped_as_they_are_by_an_engine_that_stood_still() {
    let mut all = Setup::all();
    // An engine that may not catch up skips all but the latest instant.
    all.configuration.daemon.catch_up_limit = 0;
    let samples = samples(3, 6);
    let inputs: Vec<usize> = (0..all.configuration.inputs.len()).collect();
    for slot in 0..all.diagnosers.len() {
        let setup = all.arranged(&inputs, &[slot]);
        let margin_ns = setup.longest_margin_ns();
        let (mut standing, mut engine) = (setup.engine(), setup.engine());
        let (mut expected, mut records) = (setup.records(), setup.records());
        // Every period fits a whole number of times into a second.
        let (stop_ns, go_on_ns) = (EPOCH_NS + 2 * SECOND_NS, EPOCH_NS + 4 * SECOND_NS + margin_ns);
        for sample in samples.iter().filter(|sample| sample.now_ns < stop_ns) {
            setup.feed(&mut standing, sample, &mut expected);
            setup.feed(&mut engine, sample, &mut records);
        }
        let done_ns = stop_ns + margin_ns + 1;
        step_before(&mut standing, done_ns, &mut expected);
        step_before(&mut engine, done_ns, &mut records);
        let mut engine = restored(&setup, &snapshot(&engine), go_on_ns, |period_ns| {
            2 * SECOND_NS / period_ns - 1
        });
        expected.list.clear();
        records.list.clear();
        standing.step_due(go_on_ns, || 0, &mut expected);
        step_before(&mut engine, go_on_ns + 1, &mut records);
        for sample in samples.iter().filter(|sample| sample.now_ns > go_on_ns) {
            setup.feed(&mut standing, sample, &mut expected);
            setup.feed(&mut engine, sample, &mut records);
        }
        assert!(expected.list.len() >= 2, "{}", expected.names[0]);
        assert!(
            expected.list[0].record.skipped_instants > 0,
            "{}",
            expected.names[0]
        );
        assert_same("after a gap", &records.list, &expected.list);
    }
}

#[test]
fn a_state_is_too_old_after_a_minute_and_the_diagnoser_is_as_it_was() {
    let setup = Setup::all();
    let engine = setup.engine();
    let snapshot = snapshot(&engine);
    let parts = parts(snapshot.bytes()).unwrap();
    let mut late = setup.engine();
    let too_old = late.restore_diagnoser(0, parts[0], EPOCH_NS + LONGEST_GAP_NS + 2 * SECOND_NS);
    assert!(
        matches!(too_old, Err(NoWarmStart::TooLongAgo { .. })),
        "{too_old:?}"
    );
    assert_eq!(late.schedule_counters().next().unwrap().skipped, 0);
    late.begin_at(0, EPOCH_NS + SECOND_NS);
    let mut records = setup.records();
    step_before(&mut late, EPOCH_NS + 2 * SECOND_NS, &mut records);
    let first = records
        .list
        .iter()
        .find(|said| said.diagnoser == records.names[0]);
    let record = &first.unwrap().record;
    assert_eq!(record.instant_ns, EPOCH_NS + SECOND_NS);
    assert_eq!(record.skipped_instants, 0);
}

#[test]
fn a_state_of_another_diagnoser_or_from_the_future_is_refused() {
    let setup = Setup::all();
    let mut engine = setup.engine();
    let mut records = setup.records();
    step_before(&mut engine, EPOCH_NS + SECOND_NS, &mut records);
    let snapshot = snapshot(&engine);
    let parts = parts(snapshot.bytes()).unwrap();
    let mut other = setup.engine();
    for slot in 0..setup.diagnosers.len() {
        for (place, part) in parts.iter().enumerate().filter(|(place, _)| *place != slot) {
            let refused = other.restore_diagnoser(slot, part, EPOCH_NS + SECOND_NS);
            assert!(refused.is_err(), "{place} in {slot}");
        }
        // Some have done no more than their first step.
        if setup.configuration.diagnosers[slot].period_ns < SECOND_NS / 2 {
            let refused = other.restore_diagnoser(slot, parts[slot], EPOCH_NS);
            assert_eq!(refused, Err(NoWarmStart::Damaged), "{slot}");
        }
    }
    assert!(!other.restore_input(0, parts[0]));
    assert!(!other.restore_input(99, parts[parts.len() - 1]));
}

proptest! {
    #[test]
    fn a_forged_snapshot_is_refused_or_survived(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
    ) {
        let setup = Setup::all();
        let mut engine = setup.engine();
        let mut records = setup.records();
        for sample in samples(1, 1) {
            setup.feed(&mut engine, &sample, &mut records);
        }
        let mut bytes = snapshot(&engine).bytes().to_vec();
        for (place, value) in changes {
            let place = place.index(bytes.len());
            bytes[place] = value;
        }
        let now_ns = EPOCH_NS + 2 * SECOND_NS;
        let mut engine = setup.engine();
        if let Some(parts) = parts(&bytes) {
            for (place, part) in parts.iter().enumerate() {
                let _ = match place.checked_sub(setup.diagnosers.len()) {
                    None => engine.restore_diagnoser(place, part, now_ns).is_ok(),
                    Some(input) => engine.restore_input(input, part),
                };
            }
        }
        step_before(&mut engine, now_ns + SECOND_NS, &mut records);
    }
}

#[test]
fn a_snapshot_with_room_is_written_a_part_at_a_time_between_steps_without_allocating() {
    let setup = Setup::all();
    let mut engine = setup.engine();
    let mut records = setup.records();
    for sample in samples(1, 2) {
        setup.feed(&mut engine, &sample, &mut records);
    }
    let count = setup.diagnosers.len() + setup.configuration.inputs.len();
    let mut written = Snapshot::default();
    let mut calls = 0;
    loop {
        calls += 1;
        let (allocated, progress) = allocations(|| engine.save(&mut written, || false));
        assert_eq!(allocated, 0);
        match progress {
            Progress::Whole => break,
            Progress::NoRoom => {
                calls -= 1;
                written.grow();
            }
            Progress::Unfinished => {}
        }
    }
    assert_eq!(
        calls,
        count + 1,
        "one part a call, and one that finds nothing left"
    );
    assert_eq!(written.bytes(), snapshot(&engine).bytes());
}
