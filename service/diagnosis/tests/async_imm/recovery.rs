//! Numbers that are not finite never stay in the filters.

use crate::servo::{Arrival, servo, settings, step};
use nalgebra::DMatrix;
use residual_diagnosis::async_imm::{AsyncImm, design::Form, plant::Plant};
use residual_diagnosis::diagnoser::{Diagnoser, PacketSource, StepRecord, Verdict, flags};

fn packet(sequence: u64, time_us: i64, value: f64) -> Arrival {
    Arrival {
        at_us: time_us,
        source: PacketSource::Sensor(0),
        sequence,
        time_us,
        values: vec![value],
    }
}

fn assert_finite(record: &StepRecord) {
    for channel in record.channels() {
        assert!(
            [channel.lower, channel.residual, channel.upper]
                .iter()
                .all(|value| value.is_finite()),
            "{:?}",
            record.channels()
        );
    }
}

#[test]
fn a_plant_that_explodes_during_a_long_gap_starts_anew() {
    for form in [Form::Sequential, Form::SequentialSquareRoot] {
        let (_, mut design) = servo();
        design.form = form;
        if let Plant::Constant(plant) = &mut design.plant {
            plant.a = DMatrix::from_row_slice(2, 2, &[0.0, 1.0, 0.0, 5.0]);
        }
        let mut diagnoser = AsyncImm::new(&design, settings(&design, 100_000, 0)).unwrap();
        let first = step(&mut diagnoser, &[packet(1, 100_000, 0.0)], 0, 100_000);
        assert_eq!(first.verdict(), Verdict::Nominal);
        let gap = 3_600_000_000;
        let record = step(&mut diagnoser, &[packet(2, gap, 0.0)], gap - 1, gap);
        assert_eq!(record.verdict(), Verdict::Starting, "{form:?}");
        assert_ne!(record.flags & flags::RESET, 0);
        assert_eq!(diagnoser.counters().interval_rejected, 1);
        assert_finite(&record);
        let next = step(
            &mut diagnoser,
            &[packet(3, gap + 100_000, 0.01)],
            gap,
            gap + 100_000,
        );
        assert_eq!(next.verdict(), Verdict::Nominal);
    }
}

#[test]
fn absurd_samples_leave_everything_finite_and_the_filters_come_back() {
    for form in [
        Form::Sequential,
        Form::SequentialSquareRoot,
        Form::BatchUnobserved,
    ] {
        let (_, mut design) = servo();
        design.form = form;
        design
            .modes
            .iter_mut()
            .for_each(|mode| mode.random_walk_psd.fill(0.0));
        for absurd in [1e6, 1e150, 1e200, f64::MAX, -f64::MAX, f64::MIN_POSITIVE] {
            let mut diagnoser = AsyncImm::new(&design, settings(&design, 100_000, 0)).unwrap();
            for k in 1..400 {
                let time = k * 100_000;
                let value = if k == 5 { absurd } else { 0.0 };
                let record = step(&mut diagnoser, &[packet(k as u64, time, value)], time - 1, time);
                assert_finite(&record);
                let mu: f64 = diagnoser
                    .posterior()
                    .log_probability
                    .iter()
                    .map(|log| log.exp())
                    .sum();
                assert!((mu - 1.0).abs() < 1e-12);
            }
            let mean = &diagnoser.posterior().modes[0].mean;
            assert!(
                mean[0].abs() < 1e-3 * absurd.abs().max(1.0),
                "{form:?} {absurd}: {mean:?}"
            );
        }
    }
}

#[test]
fn lost_likelihoods_are_counted_and_the_predicted_probabilities_kept() {
    let (_, design) = servo();
    let mut diagnoser = AsyncImm::new(&design, settings(&design, 100_000, 0)).unwrap();
    step(&mut diagnoser, &[packet(1, 100_000, 1e200)], 0, 100_000);
    let counters = diagnoser.counters();
    assert_eq!((counters.likelihood_lost, counters.interval_rejected), (1, 1));
    let expected = 0.98 * 0.995024916874584 + 0.02 * 0.004975083125415973;
    assert!((diagnoser.posterior().log_probability[0].exp() - expected).abs() < 1e-12);
}

#[test]
fn a_reset_returns_to_the_prior() {
    let (_, design) = servo();
    let mut diagnoser = AsyncImm::new(&design, settings(&design, 100_000, 1)).unwrap();
    let run = |diagnoser: &mut AsyncImm| -> Vec<StepRecord> {
        (1..20)
            .map(|k| {
                step(
                    diagnoser,
                    &[packet(k as u64, k * 100_000, 0.3)],
                    k * 100_000 - 1,
                    k * 100_000,
                )
            })
            .collect()
    };
    let first = run(&mut diagnoser);
    diagnoser.reset();
    let second = run(&mut diagnoser);
    assert!(first.iter().zip(&second).all(|(one, other)| one.same_bits(other)));
}
