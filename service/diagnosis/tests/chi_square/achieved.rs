//! What the tests state that they achieve, against exact values and against simulation.

use crate::common::{ALL, assert_near, diagnoser, longitudinal, only, scalar, step, without_calibration};
use crate::plant::Plant;
use residual_diagnosis::{
    achieved::{Achieved, SizeOf},
    chi_square::{ChiSquareOptions, Signature, StabilityGuard, StatisticKind, ThresholdMode},
    gains::file::{Entry, TOLERANCE},
    method::MethodOptions,
};

fn achieved(options: &ChiSquareOptions) -> Achieved {
    options.design(1.0).unwrap().achieved
}

#[test]
fn filter_threshold_and_rate_of_the_stable_example_are_stated() {
    let options = only(without_calibration(scalar(0.8)), StatisticKind::Residual);
    let found = achieved(&options);
    let near =
        |name: &str, found: f64, expected: f64| assert_near(|| name.to_owned(), found, expected, 1e-9, 0.0);
    near(
        "pole",
        found.poles[0].values[0][0],
        0.8 * (1.0 - 0.578050593550836),
    );
    near("P", found.norms[0].value.powi(2), 0.00578050593550836);
    near("S", found.norms[1].value.powi(2), 0.023699523798725357);
    let residual = found
        .thresholds
        .iter()
        .find(|threshold| threshold.channel == "residual")
        .unwrap();
    near("t_1", residual.settled, 7.879438576622419);
    assert_eq!(residual.never_fires, None);
    let alarms = found.false_alarms.as_ref().unwrap();
    near("P_f", alarms.probability_per_instant.unwrap(), 5e-3);
    near("per hour", alarms.expected_per_hour.unwrap(), 18.0);
    // The first innovation is N(f, S): sqrt(t) and the 90 % quantile of a normal variable make 4.0886 deviations.
    let first = found.faults[0].delays[0];
    assert!(
        (first.size / (4.088_585 * 0.023699523798725357_f64.sqrt()) - 1.0).abs() < 1e-5,
        "{first:?}"
    );
    assert_eq!((first.within_s, found.faults[0].assurance), (0.0, 0.9));
    assert_eq!(found.violated(), None);
}

#[test]
fn rates_over_a_run_become_rates_per_instant_and_fixed_thresholds_have_none() {
    let mut options = only(scalar(0.8), StatisticKind::Residual);
    options.threshold.calibration_runs = 300;
    let found = achieved(&options).false_alarms.unwrap();
    let expected = -(0.95_f64.ln()) / 200.0;
    assert!((found.probability_per_instant.unwrap() / expected - 1.0).abs() < 1e-12);
    let fixed = achieved(&only(without_calibration(scalar(0.8)), StatisticKind::Glr))
        .false_alarms
        .unwrap();
    assert_eq!(
        (fixed.probability_per_instant, fixed.expected_per_hour),
        (None, None)
    );
    assert!(fixed.provided_that.contains("`glr`"), "{}", fixed.provided_that);
}

/// Share of runs that alarm within `instants` of the onset of a fault of this size in the sensor.
fn detected(options: &ChiSquareOptions, size: f64, before: usize, instants: usize) -> f64 {
    const RUNS: u64 = 300;
    let alarmed = |seed: &u64| {
        let mut plant = Plant::new(options, *seed);
        let mut diagnoser = diagnoser(options);
        for _ in 0..before {
            step(&mut diagnoser, &plant.next(&[], &[]), &[]);
        }
        (0..instants).any(|_| {
            let mut z = plant.next(&[], &[]);
            z[0] += size;
            let record = step(&mut diagnoser, &z, &[]);
            record.channels().iter().any(|channel| channel.ratio > 1.0)
        })
    };
    (0..RUNS).filter(alarmed).count() as f64 / RUNS as f64
}

#[test]
fn a_fault_of_the_stated_size_is_detected_in_time_with_the_stated_probability() {
    for kind in [
        StatisticKind::Residual,
        StatisticKind::StateWindow,
        StatisticKind::Glr,
    ] {
        let mut options = only(without_calibration(scalar(0.8)), kind);
        options.glr.window_steps = 30;
        let found = achieved(&options);
        let fault = &found.faults[0];
        let delays: Vec<f64> = fault.delays.iter().map(|delay| delay.within_s).collect();
        assert!(
            fault
                .delays
                .is_sorted_by(|a, b| a.size > b.size && a.within_s < b.within_s),
            "{delays:?}"
        );
        for delay in fault.delays.iter().filter(|delay| delay.within_s < 30.0) {
            let share = detected(&options, delay.size, 40, delay.within_s as usize + 1);
            assert!(share > 0.9 - 0.055, "{kind:?} {delay:?}: {share}");
            if kind == StatisticKind::Residual && delay.within_s == 0.0 {
                assert!(share < 0.9 + 0.055, "{share}");
            }
        }
    }
}

#[test]
fn slots_four_instants_apart_detect_a_fault_of_the_stated_size_whenever_it_sets_in() {
    let mut options = only(without_calibration(scalar(0.8)), StatisticKind::Glr);
    options.glr.window_steps = 30;
    let close = achieved(&options).faults[0].detectable.unwrap();
    options.glr.onset_stride_steps = 4;
    let found = achieved(&options);
    assert!(found.faults[0].detectable.unwrap() > close);
    for before in 40..44 {
        for delay in found.faults[0]
            .delays
            .iter()
            .filter(|delay| delay.within_s < 30.0)
        {
            let share = detected(&options, delay.size, before, delay.within_s as usize + 1);
            assert!(share > 0.9 - 0.055, "{before} {delay:?}: {share}");
        }
    }
}

#[test]
fn sizes_without_a_formula_are_not_stated() {
    let found = achieved(&only(without_calibration(scalar(0.8)), StatisticKind::Cusum));
    let fault = &found.faults[0];
    assert_eq!(fault.detectable, None);
    assert!(found.is_not_stated(SizeOf::Detectable, &fault.fault));
    assert!(found.not_stated[0].because.contains("`cusum`"));
    let found = achieved(&only(without_calibration(scalar(0.8)), StatisticKind::Glr));
    let fault = &found.faults[0];
    assert!(fault.detectable.is_some() && !found.is_not_stated(SizeOf::Detectable, &fault.fault));
    assert!(found.is_not_stated(SizeOf::Isolable, &fault.fault));
}

#[test]
fn confirmation_takes_time_and_size() {
    let options = only(without_calibration(scalar(0.8)), StatisticKind::Residual);
    let mut confirmed = options.clone();
    confirmed.alarm.confirm_steps = 3;
    let (plain, confirmed) = (achieved(&options), achieved(&confirmed));
    let (plain, confirmed) = (plain.faults[0].delays[0], confirmed.faults[0].delays[0]);
    assert!(plain.within_s == 0.0 && confirmed.within_s >= 2.0 && confirmed.size > plain.size);
}

#[test]
fn one_sensor_tells_its_own_fault_from_one_of_the_process_only_by_the_second_sample() {
    let mut options = only(without_calibration(scalar(0.8)), StatisticKind::Glr);
    options.glr.signatures = vec![Signature::SensorStep, Signature::ProcessStep];
    options.glr.process_fault_input = vec![vec![1.0]];
    let found = achieved(&options);
    assert_eq!(found.faults.len(), 2);
    assert_eq!(found.isolability.len(), 2);
    assert!(
        found.isolability.iter().all(|pair| pair.instants == Some(2)),
        "{:?}",
        found.isolability
    );
    // At a = 0 both leave the same trace but for the first sample's scale: with a unit process fault they are equal.
    options.model.transition = vec![vec![0.0]];
    let found = achieved(&options);
    assert!(
        found.isolability.iter().all(|pair| pair.instants.is_none()),
        "{:?}",
        found.isolability
    );
}

#[test]
fn what_is_stated_of_all_statistics_is_verified_from_a_gains_file() {
    let mut options = longitudinal();
    options.statistics.enabled = ALL.to_vec();
    options.statistics.decision = ALL.to_vec();
    options.statistics.stability_guard = StabilityGuard::Warn;
    options.threshold.mode = ThresholdMode::PerInstant;
    let found = options.find_gains(0.1).unwrap();
    let designed = options.with_gains(0.1, &found.gains).unwrap();
    assert_eq!(designed.achieved.faults.len(), 2);
    let entry = Entry {
        name: "tests".to_owned(),
        method: ChiSquareOptions::METHOD.to_owned(),
        sample_time_s: 0.1,
        inputs: String::new(),
        warnings: Vec::new(),
        solver: Vec::new(),
        gains: toml::Table::new(),
        achieved: designed.achieved,
    };
    let again = options.with_gains(0.1, &found.gains).unwrap();
    entry.verify(&again.achieved, TOLERANCE).unwrap();
    options.model.measurement_noise_covariance[0][0] *= 1.01;
    let other = options.with_gains(0.1, &found.gains).unwrap();
    assert!(entry.verify(&other.achieved, TOLERANCE).is_err());
}
