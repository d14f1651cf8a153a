//! The simulation against the statistics that run online, on the same whitened innovations.

use super::{gains::RunGains, simulation::simulate};
use crate::{
    chi_square::{
        ChiSquareOptions, ModelOptions, Schedule, StabilityGuard, StatisticKind,
        construction::check,
        engine::{Detectors, Engine},
        filter::Filter,
        random::Random,
        thresholds::table,
    },
    matrix::{apply, dot},
};

/// Steps of a run: several times what the gains need to become steady.
const STEPS: usize = 160;
const RUNS: usize = 20;

const KINDS: [StatisticKind; 6] = [
    StatisticKind::Residual,
    StatisticKind::StatePlain,
    StatisticKind::StateWindow,
    StatisticKind::StateTwoPropagator,
    StatisticKind::Glr,
    StatisticKind::Cusum,
];

fn options() -> ChiSquareOptions {
    let unit = |size: f64| vec![vec![size, 0.0], vec![0.0, size]];
    let mut options = ChiSquareOptions {
        model: ModelOptions {
            transition: vec![vec![0.7, 0.3], vec![-0.2, 0.5]],
            process_noise_covariance: unit(0.2),
            measurement: vec![vec![1.0, 0.0], vec![1.0, 1.0]],
            measurement_noise_covariance: vec![vec![0.3, 0.1], vec![0.1, 0.2]],
            initial_covariance: unit(1.0),
            ..ModelOptions::default()
        },
        ..ChiSquareOptions::default()
    };
    options.statistics.enabled = KINDS.to_vec();
    options.statistics.window_steps = vec![2, 7];
    options.statistics.two_propagator_reset_steps = 6;
    options.statistics.stability_guard = StabilityGuard::Warn;
    options.glr.window_steps = 18;
    options.glr.onset_stride_steps = 4;
    options.threshold.run_steps = STEPS;
    options.threshold.calibration_runs = RUNS;
    options
}

/// The largest value of each statistic over a run of the online code, on innovations with the whitened values that
/// `draw` gives; chi-square statistics divided by t_d.
fn online(options: &ChiSquareOptions, model_of: impl Fn(usize) -> usize, e: &[Vec<f64>]) -> Vec<f64> {
    let mut options = options.clone();
    options.threshold.calibration_runs = 200;
    let checked = check(&options).unwrap();
    let thresholds = table(options.threshold.false_alarm_probability, 2);
    let mut engine = Engine::new(checked.engine.clone());
    let mut filter = Filter::new(&[0.0; 2], &checked.plant.initial_factor);
    let mut detectors = Detectors::new(&checked.engine);
    let mut best = vec![0.0_f64; KINDS.len()];
    for (i, e) in e.iter().enumerate() {
        let model = &checked.plant.models[model_of(i + 1)];
        // A trial step on zero tells the expected measurement and L_S.
        let (mut trial, mut trial_detectors) = (filter.clone(), detectors.clone());
        engine.step(&mut trial, &mut trial_detectors, model, &[], &[], &[0.0; 2]);
        let update = &engine.outcome.update;
        let mut z = [0.0; 2];
        apply(&update.innovation_factor, e, &mut z);
        z.iter_mut()
            .zip(&update.innovation)
            .for_each(|(z, innovation)| *z -= innovation);
        engine.step(&mut filter, &mut detectors, model, &[], &[], &z);
        let outcome = &engine.outcome;
        assert!((dot(e, e) - outcome.residual.value).abs() < 1e-9);
        let ratio = |value: f64, degrees: usize| value / thresholds[degrees];
        let windows = outcome
            .windows()
            .map(|(_, window)| ratio(window.value, window.degrees));
        let found = [
            ratio(outcome.residual.value, outcome.residual.degrees),
            ratio(outcome.plain.value, outcome.plain.degrees),
            windows.fold(0.0, f64::max),
            ratio(outcome.pair.value, outcome.pair.degrees),
            outcome.likelihood_ratio().map_or(0.0, |best| best.value),
            outcome
                .cusum
                .iter()
                .fold(0.0, |most, value| most.max(value.abs())),
        ];
        best.iter_mut()
            .zip(found)
            .for_each(|(best, found)| *best = best.max(found));
    }
    best
}

/// Compares run by run; the simulation draws 16 runs side by side, sensor by sensor.
fn compare(options: &ChiSquareOptions, model_of: impl Fn(usize) -> usize, steady: bool) {
    let mut checkable = options.clone();
    checkable.threshold.calibration_runs = 200;
    let checked = check(&checkable).unwrap();
    let gains = RunGains::new(&checked.plant, &checked.engine, options, &KINDS).unwrap();
    assert_eq!(gains.repeats(), steady);
    let maxima = simulate(&gains, &KINDS, &checked.engine, &options.threshold);
    let mut random = Random::new(options.threshold.calibration_seed);
    let lanes = 16;
    let mut e = vec![vec![vec![0.0; 2]; STEPS]; lanes];
    for run in 0..RUNS {
        if run % lanes == 0 {
            for k in 0..STEPS {
                for row in 0..2 {
                    e.iter_mut().for_each(|run| run[k][row] = random.normal());
                }
            }
        }
        let expected = online(options, &model_of, &e[run % lanes]);
        for ((kind, maxima), expected) in KINDS.iter().zip(&maxima).zip(expected) {
            let error = (maxima[run] - expected).abs();
            assert!(
                error < 1e-8 * expected,
                "{} run {run}: {} {expected}",
                kind.name(),
                maxima[run]
            );
        }
    }
}

#[test]
fn a_steady_model_gives_the_statistics_that_run_online() {
    compare(&options(), |_| 0, true);
}

#[test]
fn an_assumed_schedule_gives_the_statistics_that_run_online() {
    let mut options = options();
    let first = options.model.matrices();
    let mut second = first.clone();
    second.transition = vec![vec![0.2, -0.5], vec![0.4, 0.9]];
    second.measurement_noise_covariance = vec![vec![1.0, 0.0], vec![0.0, 0.5]];
    options.models = vec![first, second];
    options.model = ModelOptions {
        initial_covariance: options.model.initial_covariance,
        schedule: Schedule::Selected,
        assumed_schedule: Some(vec![0, 0, 1]),
        ..ModelOptions::default()
    };
    compare(&options, |k| usize::from(k % 3 == 0), false);
}
