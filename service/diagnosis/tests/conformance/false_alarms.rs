//! Alarms in fault-free operation: none for a guaranteed method, the configured probability for a statistical one.

use crate::case::{Case, Promise, record};
use residual_diagnosis::diagnoser::{StepRecord, Verdict, flags};

/// Steps by which a claim on probabilities is judged.
const STEPS: usize = 100_000;

/// Steps by which a guarantee is judged, and those of one plant: a new seed after these. Each method has property
/// tests of its guarantee beside these.
const GUARANTEED_STEPS: usize = 40_000;
const GUARANTEED_RUN: usize = 500;

/// Half width of the accepted interval in standard deviations of the binomial distribution: a correct method fails
/// with probability 1e-4.
const DEVIATIONS: f64 = 3.9;

/// Checks the promise of a case.
pub fn are_as_promised(case: &Case) {
    match case.promise {
        Promise::NoFalseAlarm => no_alarm(case),
        Promise::PerInstant { channel, probability } => per_instant(case, channel, probability),
        Promise::PerRun {
            probability,
            steps,
            at_most,
        } => per_run(case, probability, steps, at_most),
        Promise::NoClaim(reason) => println!("no claim: {reason}"),
    }
}

/// Hands every record of a fault-free run to `take`.
fn fault_free(case: &Case, seed: u64, steps: usize, mut take: impl FnMut(&StepRecord)) {
    let mut diagnoser = case.diagnoser();
    let mut plant = (case.plant)(seed);
    let mut record = record(diagnoser.as_ref());
    for k in 1..=steps {
        case.step(diagnoser.as_mut(), k, &plant.next(false), &mut record);
        take(&record);
    }
}

fn no_alarm(case: &Case) {
    let mut evaluated = 0;
    for seed in 0..(GUARANTEED_STEPS / GUARANTEED_RUN) as u64 {
        fault_free(case, 100 + seed, GUARANTEED_RUN, |record| {
            let violated = record.channels().iter().find(|channel| channel.ratio > 1.0);
            assert!(violated.is_none(), "seed {seed}: {violated:?}");
            assert_eq!(record.flags & flags::ALARM_NOW, 0);
            assert!(
                !matches!(
                    record.verdict(),
                    Verdict::Fault | Verdict::Isolated | Verdict::GuaranteeLost
                ),
                "{record:?}"
            );
            evaluated += usize::from(record.verdict() == Verdict::Nominal);
        });
    }
    assert!(
        evaluated * 2 > GUARANTEED_STEPS,
        "only {evaluated} of {GUARANTEED_STEPS} instants were tested"
    );
}

fn per_instant(case: &Case, channel: &str, probability: f64) {
    let names = case.diagnoser();
    let place = names
        .description()
        .channels
        .iter()
        .position(|description| description.name == channel)
        .unwrap_or_else(|| panic!("no channel {channel}: {:?}", names.description()));
    let (mut tested, mut violated) = (0_usize, 0_usize);
    fault_free(case, 100, STEPS, |record| {
        let channel = &record.channels()[place];
        tested += usize::from(channel.is_evaluated());
        violated += usize::from(channel.ratio > 1.0);
    });
    assert!(tested * 2 > STEPS, "only {tested} instants were tested");
    assert_binomial(violated, tested, probability, false);
}

fn per_run(case: &Case, probability: f64, steps: usize, at_most: bool) {
    let runs = STEPS.div_ceil(steps);
    let mut alarmed = 0;
    for seed in 0..runs as u64 {
        let mut alarm = false;
        fault_free(case, 1_000 + seed, steps, |record| {
            alarm |= record.flags & flags::ALARM_NOW != 0
        });
        alarmed += usize::from(alarm);
    }
    assert_binomial(alarmed, runs, probability, at_most);
}

/// Whether `hits` of `trials` agree with a probability.
fn assert_binomial(hits: usize, trials: usize, probability: f64, at_most: bool) {
    let expected = probability * trials as f64;
    let width = DEVIATIONS * (expected * (1.0 - probability)).sqrt() + 1.0;
    let excess = hits as f64 - expected;
    println!("{hits} of {trials}, expected {expected:.1} ± {width:.1}");
    assert!(
        excess <= width && (at_most || excess >= -width),
        "{hits} of {trials} do not agree with the probability {probability}"
    );
}
