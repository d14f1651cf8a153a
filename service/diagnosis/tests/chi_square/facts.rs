//! Exact facts of the method sheet, section 8(a), and the arithmetic of calibration.

use crate::common::{
    assert_near, diagnoser, longitudinal, only, quarter_car, scalar, square, step, steps_only,
    without_calibration,
};
use residual_diagnosis::chi_square::{
    ChiSquareOptions, StabilityGuard, StatisticKind, ThresholdMode, chi_square_upper_quantile, non_centrality,
};

#[test]
fn the_steady_filter_of_the_stable_example_has_the_printed_values() {
    let design = diagnoser(&only(without_calibration(scalar(0.8)), StatisticKind::Residual))
        .design()
        .clone();
    let steady = design.report.steady_state.unwrap();
    let (k, s) = (steady.gain[0], steady.innovation_covariance[0]);
    for (name, found, expected) in [
        ("P-", steady.prediction_covariance[0], 0.013699523798725355),
        ("S", s, 0.023699523798725357),
        ("K", k, 0.578050593550836),
        ("P", steady.covariance[0], 0.00578050593550836),
        ("T", k * k * s / (1.0 - 0.64), 0.021997271842269427),
        ("P_s", k * k * s / (1.0 - 0.64) + steady.covariance[0], 1.0 / 36.0),
    ] {
        assert_near(|| name.to_owned(), found, expected, 1e-9, 0.0);
    }
}

/// P_s = T + P of the plain propagator after so many steps without data to speak of.
fn plain_propagator_covariance(a: f64, steps: usize) -> f64 {
    let mut options = only(without_calibration(scalar(a)), StatisticKind::StatePlain);
    options.statistics.stability_guard = StabilityGuard::Warn;
    let mut diagnoser = diagnoser(&options);
    (0..steps).for_each(|_| {
        step(&mut diagnoser, &[0.0], &[]);
    });
    let (_, factor) = diagnoser.difference(StatisticKind::StatePlain).unwrap();
    square(factor)[0] + square(diagnoser.covariance_factor())[0]
}

#[test]
fn the_propagator_of_the_other_examples_grows_as_printed() {
    for k in [1, 17, 200] {
        assert_near(
            || format!("{k}"),
            plain_propagator_covariance(-1.0, k),
            0.01 * k as f64,
            1e-9,
            0.0,
        );
    }
    assert_near(
        || "1.1".into(),
        plain_propagator_covariance(1.1, 200),
        1.717334001310678e15,
        1e-9,
        0.0,
    );
    assert_near(
        || "0.8".into(),
        plain_propagator_covariance(0.8, 200),
        1.0 / 36.0,
        1e-9,
        0.0,
    );
}

#[test]
fn the_filters_of_the_other_examples_become_as_printed() {
    let steady = |a| {
        let design = diagnoser(&only(without_calibration(scalar(a)), StatisticKind::Residual))
            .design()
            .clone();
        design.report.steady_state.unwrap()
    };
    let golden = (5.0_f64.sqrt() - 1.0) / 2.0;
    assert_near(|| "K".into(), steady(-1.0).gain[0], golden, 1e-9, 0.0);
    assert_near(
        || "P".into(),
        steady(-1.0).covariance[0],
        0.01 * golden,
        1e-9,
        0.0,
    );
    assert_near(
        || "P".into(),
        steady(1.1).covariance[0],
        0.006394799353235017,
        1e-9,
        0.0,
    );
}

#[test]
fn a_constant_sensor_fault_shows_in_plain_and_residual_in_the_printed_ratio() {
    for (a, ratio) in [(0.5, 3.0), (0.95, 39.0), (-0.5, 1.0 / 3.0)] {
        let mut options = without_calibration(scalar(a));
        options.statistics.enabled = vec![StatisticKind::Residual, StatisticKind::StatePlain];
        options.statistics.decision = vec![StatisticKind::Residual];
        let mut last = 0.0;
        non_centrality(&options, &vec![vec![1.0]; 2000], |outcome| {
            last = outcome.plain.value / outcome.residual.value;
        })
        .unwrap();
        assert_near(|| format!("a = {a}"), last, ratio, 1e-9, 0.0);
    }
}

#[test]
fn independent_starts_of_the_propagator_are_not_what_runs_here() {
    // a = 0.8, P_0 = 0.5, k = 1: T = 0.3203 with the common start, 0.3391 with independent ones.
    let mut options = only(without_calibration(scalar(0.8)), StatisticKind::StatePlain);
    options.model.initial_covariance = vec![vec![0.5]];
    let mut diagnoser = diagnoser(&options);
    step(&mut diagnoser, &[0.0], &[]);
    let (_, factor) = diagnoser.difference(StatisticKind::StatePlain).unwrap();
    assert_near(|| "T".into(), square(factor)[0], 0.3203, 0.0, 5e-5);
}

/// An uncorrelated pair of sensors on two independent scalar plants: a residual with two degrees of freedom.
fn two_sensors() -> ChiSquareOptions {
    let mut options = scalar(0.8);
    let model = &mut options.model;
    model.transition = vec![vec![0.8, 0.0], vec![0.0, 0.8]];
    for matrix in [
        &mut model.process_noise_covariance,
        &mut model.measurement_noise_covariance,
    ] {
        *matrix = vec![vec![0.01, 0.0], vec![0.0, 0.01]];
    }
    model.measurement = vec![vec![1.0, 0.0], vec![0.0, 1.0]];
    model.initial_covariance = vec![vec![0.0; 2]; 2];
    options
}

#[test]
fn the_calibrated_residual_threshold_is_the_exact_one() {
    for (options, degrees, steps, expected) in
        [(scalar(0.8), 1, 200, 13.364), (two_sensors(), 2, 250, 16.984)]
    {
        let mut options = only(options, StatisticKind::Residual);
        options.threshold.mode = ThresholdMode::PerRun;
        options.threshold.run_steps = steps;
        let exact = chi_square_upper_quantile(1.0 - 0.95_f64.powf(1.0 / steps as f64), degrees);
        assert_near(|| "exact".into(), exact, expected, 0.0, 5e-4);
        let found = diagnoser(&options).design().thresholds.residual[degrees];
        // 8000 runs: the rate beyond a 5 % quantile is known to 0.24 %, ln(rate) to 0.049, its slope is 0.53.
        assert_near(|| "calibrated".into(), found, exact, 0.0, 4.0 * 0.049 / 0.53);
    }
}

#[test]
fn calibrated_thresholds_lie_where_plant_simulations_put_them() {
    use StatisticKind::{Cusum, Glr, StateWindow};
    let threshold = |mut options: ChiSquareOptions, kind, run_steps| {
        options.threshold.mode = ThresholdMode::PerRun;
        (
            options.threshold.glr,
            options.threshold.cusum,
            options.threshold.bank,
        ) = (0.0, 0.0, 0.0);
        options.threshold.false_alarm_probability = 5e-3;
        options.threshold.calibration_runs = 3000;
        options.threshold.run_steps = run_steps;
        let thresholds = diagnoser(&only(options, kind)).design().thresholds.clone();
        match kind {
            Glr => thresholds.glr,
            Cusum => thresholds.cusum,
            _ => thresholds.bank,
        }
    };
    let mut sharp = scalar(0.8);
    sharp.cusum.reference = 0.5;
    // Values of the sheet, widened by two standard errors of 3000 runs.
    for (name, found, low, high) in [
        ("CUSUM 0.25", threshold(scalar(0.8), Cusum, 200), 12.1, 12.5),
        ("CUSUM 0.5", threshold(sharp, Cusum, 200), 6.9, 7.2),
        (
            "GLR, M = 60",
            threshold(steps_only(scalar(0.8), 60), Glr, 200),
            16.3,
            17.1,
        ),
        ("bank", threshold(scalar(0.8), StateWindow, 200), 1.93, 1.95),
        (
            "longitudinal GLR",
            threshold(steps_only(longitudinal(), 60), Glr, 250),
            18.4,
            18.5,
        ),
        (
            "longitudinal CUSUM",
            threshold(longitudinal(), Cusum, 250),
            13.7,
            14.3,
        ),
    ] {
        println!("{name}: {found:.3}, expected {low} to {high}");
        let error = if found < 3.0 { 0.05 } else { 0.35 };
        assert!(found > low - error && found < high + error, "{name}: {found}");
    }
}

#[test]
fn windows_of_five_see_a_constant_accelerometer_fault_of_the_quarter_car_and_windows_of_ten_do_not() {
    let mut options = only(without_calibration(quarter_car()), StatisticKind::StateWindow);
    options.statistics.window_steps = vec![5, 10];
    let report = diagnoser(&options).design().report.clone();
    let accelerometer: Vec<_> = report
        .insensitive_windows
        .iter()
        .filter(|window| window.sensor == 1)
        .collect();
    assert_eq!(accelerometer.len(), 1, "{report:?}");
    assert_eq!(accelerometer[0].window_steps, 10);
    assert_near(|| "ratio".into(), accelerometer[0].ratio, 0.40, 0.0, 0.02);
    assert!(
        report
            .warnings
            .iter()
            .any(|warning| warning.contains("window 10"))
    );
}

#[test]
fn a_constant_bias_at_an_integrator_is_reported_to_leave_no_trace() {
    let fading = |a| {
        let design = diagnoser(&steps_only(without_calibration(scalar(a)), 60))
            .design()
            .clone();
        design.report.fading_modes.len()
    };
    assert_eq!((fading(1.0), fading(0.8)), (1, 0));
}

#[test]
fn the_square_root_form_keeps_the_rank_of_an_unstable_coupled_pair() {
    let mut options = without_calibration(two_sensors());
    options.model.transition = vec![vec![1.1, 0.0], vec![0.2, 0.8]];
    options = only(options, StatisticKind::StatePlain);
    options.statistics.stability_guard = StabilityGuard::Warn;
    let mut diagnoser = diagnoser(&options);
    for k in 1..=200 {
        step(
            &mut diagnoser,
            &[(k as f64).sin() * 0.1, (k as f64).cos() * 0.1],
            &[],
        );
        assert_eq!(diagnoser.outcome().plain.degrees, 2, "step {k}");
    }
}

#[test]
fn small_probabilities_are_extrapolated_with_the_slope_of_the_sheet() {
    let bound = |rate: f64| {
        let mut options = only(scalar(0.8), StatisticKind::Cusum);
        options.threshold.calibration_runs = 400;
        options.threshold.run_false_alarm_probability = rate;
        diagnoser(&options).design().thresholds.cusum
    };
    assert_near(
        || "slope".into(),
        bound(1e-4) - bound(0.05),
        (0.05_f64 / 1e-4).ln() / 0.52,
        1e-12,
        0.0,
    );
}

#[test]
fn statistics_that_decide_together_share_the_run_level_rate() {
    let mut options = scalar(0.8);
    options.glr.window_steps = 30;
    options.threshold.calibration_runs = 2000;
    let design = diagnoser(&options).design().clone();
    let calibration = design.calibration.unwrap();
    let alarmed = |run: usize| {
        calibration
            .statistics
            .iter()
            .zip(&calibration.maxima)
            .any(|(kind, maxima)| match kind {
                StatisticKind::Glr => maxima[run] > design.thresholds.glr,
                _ => maxima[run] > design.thresholds.cusum,
            })
    };
    let rate = (0..2000).filter(|run| alarmed(*run)).count() as f64 / 2000.0;
    assert!((0.0475..=0.0500).contains(&rate), "{rate}");
}
