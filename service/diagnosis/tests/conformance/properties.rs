//! The properties of every diagnoser.

use crate::allocation::allocations;
use crate::case::{Case, record};
use crate::plant::Sample;
use residual_diagnosis::diagnoser::{
    Diagnoser, PacketHeader, Packets, RestoreError, StepInput, StepRecord, Verdict, flags,
};
use residual_shared::record::{MAX_CHANNELS, MAX_FAULTS};
use std::collections::HashSet;
use xxhash_rust::xxh3::xxh3_64;

/// Steps of a test run; the fault acts in its second half.
const STEPS: usize = 400;

/// The samples of a run: complete ones, ones without anything, and a fault in the second half.
fn samples(case: &Case, seed: u64) -> Vec<Sample> {
    let mut plant = (case.plant)(seed);
    let sample = |k: usize| {
        let mut sample = plant.next(k >= STEPS / 2);
        if k % 97 == 96 {
            sample.lose_everything();
        }
        sample
    };
    (0..STEPS).map(sample).collect()
}

/// The records of a run; calls `before` ahead of every step.
fn run(
    case: &Case,
    diagnoser: &mut Box<dyn Diagnoser>,
    samples: &[Sample],
    first: usize,
    mut before: impl FnMut(usize, &mut Box<dyn Diagnoser>),
) -> Vec<StepRecord> {
    let step = |(place, sample): (usize, &Sample)| {
        let k = first + place;
        before(k, diagnoser);
        let mut record = record(diagnoser.as_ref());
        case.step(diagnoser.as_mut(), k, sample, &mut record);
        record
    };
    samples.iter().enumerate().map(step).collect()
}

fn assert_same_bits(what: &str, one: &[StepRecord], other: &[StepRecord]) {
    assert_eq!(one.len(), other.len());
    for (k, (one, other)) in one.iter().zip(other).enumerate() {
        assert!(one.same_bits(other), "{what}, record {k}: {one:?}\n{other:?}");
    }
}

/// The state of a diagnoser, which writes as much as it says, and into a list with room without allocating.
fn saved(diagnoser: &dyn Diagnoser) -> Vec<u8> {
    let size = diagnoser.state_size();
    let mut state = Vec::with_capacity(size);
    assert_eq!(allocations(|| diagnoser.save(&mut state)), 0);
    assert_eq!(state.len(), size);
    state
}

/// Channel names are unique, counts fit a record and never change.
pub fn description_is_sound(case: &Case) {
    let mut diagnoser = case.diagnoser();
    let description = diagnoser.description().clone();
    assert!((1..=MAX_CHANNELS).contains(&description.channels.len()));
    assert!(description.faults.len() <= MAX_FAULTS);
    let names: HashSet<_> = description.channels.iter().map(|channel| &channel.name).collect();
    assert_eq!(names.len(), description.channels.len(), "{description:?}");
    assert!(names.iter().all(|name| !name.trim().is_empty()));
    let faults: HashSet<_> = description.faults.iter().collect();
    assert_eq!(faults.len(), description.faults.len(), "{description:?}");
    if let Some(rules) = &description.packets {
        assert_eq!(
            rules.sensor_rows.iter().sum::<usize>(),
            description.measurement_count
        );
    }
    let samples = samples(case, 1);
    assert_eq!(samples[0].measurements.len(), description.measurement_count);
    assert_eq!(samples[0].commands.len(), description.command_count);
    let records = run(case, &mut diagnoser, &samples, 1, |_, _| {});
    for record in &records {
        assert_eq!(record.channels().len(), description.channels.len());
    }
    diagnoser.reset();
    assert_eq!(*diagnoser.description(), description);
}

/// Two diagnosers, and a copy, say the same about the same samples.
pub fn repetition_gives_equal_bits(case: &Case) {
    let samples = samples(case, 2);
    let mut first = case.design_anew();
    let mut copy = first.boxed_clone();
    let records = run(case, &mut first, &samples, 1, |_, _| {});
    assert_same_bits(
        "again",
        &records,
        &run(case, &mut case.design_anew(), &samples, 1, |_, _| {}),
    );
    assert_same_bits("copy", &records, &run(case, &mut copy, &samples, 1, |_, _| {}));
}

/// A state saved at any moment, restored into a new diagnoser, goes on as the old one would have.
pub fn saved_state_goes_on(case: &Case) {
    let samples = samples(case, 3);
    let mut states = Vec::new();
    let records = run(case, &mut case.diagnoser(), &samples, 1, |k, diagnoser| {
        if [1, 2, 30, 98, 201, 230, 301].contains(&k) {
            states.push((k, saved(diagnoser.as_ref())));
        }
    });
    let new = case.design_anew();
    for (k, state) in states {
        let mut other = new.boxed_clone();
        // The state that a restore replaces must not matter.
        run(case, &mut other, &samples[..25], 1, |_, _| {});
        other.restore(&state).unwrap();
        assert!(
            saved(other.as_ref()) == state,
            "the state restored at {k} is another one"
        );
        let rest = run(case, &mut other, &samples[k - 1..], k, |_, _| {});
        assert_same_bits(&format!("restored at {k}"), &records[k - 1..], &rest);
    }
}

/// A damaged state, one of another configuration, and no state at all are refused without any effect.
pub fn foreign_state_is_refused(case: &Case) {
    let samples = samples(case, 4);
    let mut diagnoser = case.diagnoser();
    run(case, &mut diagnoser, &samples[..50], 1, |_, _| {});
    let state = saved(diagnoser.as_ref());
    let refused = |bytes: &[u8], diagnoser: &mut Box<dyn Diagnoser>| {
        let error = diagnoser.restore(bytes).unwrap_err();
        assert!(
            saved(diagnoser.as_ref()) == state,
            "the state changed in spite of {error}"
        );
        error
    };
    assert_eq!(
        refused(b"something else", &mut diagnoser),
        RestoreError::NotAState
    );
    for length in [0, 8, 30, state.len() / 2, state.len() - 1] {
        refused(&state[..length], &mut diagnoser);
    }
    let mut changed = state.clone();
    changed[state.len() / 2] ^= 1;
    assert_eq!(refused(&changed, &mut diagnoser), RestoreError::Damaged);
    diagnoser.restore(&state).unwrap();
}

/// Numbers that do no harm where they are expected and all the harm where they are not.
const FORGERIES: [u64; 8] = [
    0,
    1,
    7,
    1 << 32,
    u64::MAX,
    f64::NAN.to_bits(),
    f64::INFINITY.to_bits(),
    f64::MAX.to_bits(),
];

/// A state with a number changed and the right checksum is refused, or the steps after it do not panic.
pub fn forged_state_is_refused_or_survived(case: &Case) {
    let samples = samples(case, 10);
    let new = case.diagnoser();
    let mut diagnoser = new.boxed_clone();
    run(case, &mut diagnoser, &samples[..230], 1, |_, _| {});
    let state = saved(diagnoser.as_ref());
    let content = state.len() - size_of::<u64>();
    let mut accepted = 0;
    for attempt in 0..120 {
        let mut forged = state[..content].to_vec();
        // Spread over the whole state by a step that shares no factor with its length.
        let place = attempt * 7919 % (content - 8);
        forged[place..place + 8].copy_from_slice(&FORGERIES[attempt % FORGERIES.len()].to_le_bytes());
        forged.extend(xxh3_64(&forged).to_le_bytes());
        let mut other = new.boxed_clone();
        if other.restore(&forged).is_ok() {
            accepted += 1;
            run(case, &mut other, &samples[230..270], 231, |_, _| {});
        }
    }
    println!("{accepted} forged states were accepted");
}

/// After a reset a diagnoser is as good as new.
pub fn reset_returns_to_the_start(case: &Case) {
    let samples = samples(case, 5);
    let mut diagnoser = case.diagnoser();
    let new = saved(diagnoser.as_ref());
    let records = run(case, &mut diagnoser, &samples, 1, |_, _| {});
    diagnoser.reset();
    assert!(
        saved(diagnoser.as_ref()) == new,
        "the state after a reset is not the first one"
    );
    let again = run(case, &mut diagnoser, &samples, 1, |_, _| {});
    assert_same_bits("after the reset", &records, &again);
}

/// Inputs that no sensor should send.
fn hostile(case: &Case, sample: &Sample, headers: &[PacketHeader], mut take: impl FnMut(&StepInput<'_>)) {
    let instant_ns = case.instant_ns(STEPS + 1);
    let (ny, nu) = (sample.measurements.len(), sample.commands.len());
    let mut give = |y: &[f64], u: &[f64], headers: &[PacketHeader], values: &[f64]| {
        take(&StepInput {
            instant_ns,
            measurements: y,
            commands: u,
            packets: Packets::new(headers, values),
        });
    };
    for bad in [
        f64::NAN,
        f64::INFINITY,
        f64::NEG_INFINITY,
        f64::MAX,
        -f64::MAX,
        1e200,
        0.0,
        f64::MIN_POSITIVE,
    ] {
        let (y, u, values) = (
            vec![bad; ny],
            vec![bad; nu],
            vec![bad; sample.packet_values.len()],
        );
        give(&y, &u, headers, &values);
        give(&y, &sample.commands, headers, &sample.packet_values);
        give(&sample.measurements, &u, headers, &values);
    }
    give(&[], &[], &[], &[]);
    give(&vec![0.0; ny + 1], &vec![0.0; nu + 1], headers, &[]);
    for time_ns in [0, 1, instant_ns, instant_ns + 1, u64::MAX] {
        let strange: Vec<_> = headers
            .iter()
            .map(|header| PacketHeader { time_ns, ..*header })
            .collect();
        give(
            &sample.measurements,
            &sample.commands,
            &strange,
            &sample.packet_values,
        );
    }
    let doubled: Vec<_> = headers.iter().chain(headers).copied().collect();
    give(
        &sample.measurements,
        &sample.commands,
        &doubled,
        &sample.packet_values,
    );
    let short: Vec<_> = headers
        .iter()
        .map(|header| PacketHeader { length: 0, ..*header })
        .collect();
    give(
        &sample.measurements,
        &sample.commands,
        &short,
        &sample.packet_values,
    );
}

/// Neither panic nor allocation, and a sound record, whatever comes in; nothing received is never "nominal".
pub fn hostile_input_is_survived(case: &Case) {
    let samples = samples(case, 6);
    for begin in [0, 60, STEPS - 1] {
        let mut diagnoser = case.diagnoser();
        run(case, &mut diagnoser, &samples[..begin], 1, |_, _| {});
        let sample = &samples[begin];
        let headers = sample.headers(case.instant_ns(begin + 1), case.period_ns);
        let count = diagnoser.description().channels.len();
        hostile(case, sample, &headers, |input| {
            let mut record = record(diagnoser.as_ref());
            let taken = allocations(|| diagnoser.step(input, &mut record));
            assert_eq!(taken, 0, "allocations with {input:?}");
            assert_eq!(record.channels().len(), count);
            let heard = |values: &[f64]| values.iter().any(|value| value.is_finite());
            let packets = input.packets.iter().any(|packet| heard(packet.values));
            let silent = match diagnoser.description().packets {
                Some(_) => !packets,
                None => !heard(input.measurements) || input.measurements.len() != sample.measurements.len(),
            };
            check_record(&record, silent);
        });
        // A diagnoser that a fault in a driver has blinded can be brought back.
        diagnoser.reset();
        let after = run(case, &mut diagnoser, &samples, 1, |_, _| {});
        let fresh = run(case, &mut case.diagnoser(), &samples, 1, |_, _| {});
        assert_same_bits("after hostile input and reset", &after, &fresh);
    }
}

/// A silent instant is not nominal; nothing tested is not nominal; what is isolated is named.
fn check_record(record: &StepRecord, silent: bool) {
    let evaluated = record.channels().iter().any(|channel| channel.is_evaluated());
    if record.verdict() == Verdict::Nominal {
        assert!(evaluated && !silent, "nominal without a test: {record:?}");
    }
    if record.verdict() == Verdict::Isolated {
        assert_ne!(record.certainly_faulty, 0, "{record:?}");
    }
    assert!(Verdict::from_number(record.verdict).is_some());
}

/// No step, skip or reset allocates: of a new diagnoser, of its copy, of one that took over a state.
pub fn no_step_allocates(case: &Case) {
    let samples = samples(case, 7);
    let new = case.design_anew();
    let copy = new.boxed_clone();
    let mut restored = case.design_anew();
    let mut saver = case.diagnoser();
    run(case, &mut saver, &samples[..60], 1, |_, _| {});
    restored.restore(&saved(saver.as_ref())).unwrap();
    for (what, mut diagnoser) in [("new", new), ("copy", copy), ("restored", restored)] {
        let mut record = record(diagnoser.as_ref());
        for (place, sample) in samples.iter().enumerate() {
            let k = place + 1;
            let headers = sample.headers(case.instant_ns(k), case.period_ns);
            let input = case.input(k, sample, &headers);
            let taken = allocations(|| {
                diagnoser.step(&input, &mut record);
                if k % 71 == 70 {
                    diagnoser.skip(&mut record);
                }
                if k % 301 == 300 {
                    diagnoser.reset();
                }
            });
            assert_eq!(taken, 0, "{what}, step {k}");
        }
    }
}

/// "Ratio above 1" and "residual out of its bounds" are the same, and an alarm has a channel that shows it.
pub fn ratio_agrees_with_bounds(case: &Case) {
    let mut seen = [0; 2];
    for record in run(case, &mut case.diagnoser(), &samples(case, 8), 1, |_, _| {}) {
        let mut violated = false;
        for channel in record.channels().iter().filter(|channel| channel.is_evaluated()) {
            // Estimates are for information and never alarm; at the very bound rounding decides.
            if channel.ratio == 0.0 || (channel.ratio - 1.0).abs() < 1e-6 {
                violated |= channel.ratio > 1.0;
                continue;
            }
            let inside = channel.lower <= channel.residual && channel.residual <= channel.upper;
            assert_eq!(inside, channel.ratio < 1.0, "{channel:?}");
            violated |= !inside;
            seen[usize::from(inside)] += 1;
        }
        if record.flags & flags::ALARM_NOW != 0 {
            assert!(violated, "an alarm that no channel shows: {record:?}");
        }
    }
    assert!(seen[1] > 0, "no channel was evaluated");
    assert!(seen[0] > 0, "the fault of the case violates no bound");
}

/// The fault of the case ends in a verdict, and what is isolated is among what is possible.
pub fn faults_are_reported(case: &Case) {
    let mut diagnoser = case.diagnoser();
    let records = run(case, &mut diagnoser, &samples(case, 9), 1, |_, _| {});
    let known = match diagnoser.description().faults.len() {
        64.. => u64::MAX,
        count => (1 << count) - 1,
    };
    let mut reported = false;
    for (k, record) in records.iter().enumerate() {
        check_record(record, (k % 97) == 96);
        let verdict = record.verdict();
        let fault = matches!(verdict, Verdict::Fault | Verdict::Isolated);
        reported |= fault && k >= STEPS / 2;
        assert_eq!(
            (record.certainly_faulty | record.possibly_faulty) & !known,
            0,
            "{record:?}"
        );
        assert_eq!(record.certainly_faulty & !record.possibly_faulty, 0, "{record:?}");
        assert!(
            record.fault_estimate.is_nan() || record.fault_estimate_half_width >= 0.0,
            "an estimate without its width: {record:?}"
        );
    }
    assert!(reported, "the fault of the case is never reported");
}
