//! One small configuration per mistake: each refusal names the entry and what to do.

use crate::common::{longitudinal, scalar, switched_quarter_car, without_calibration};
use residual_diagnosis::{
    chi_square::{
        ChiSquareDiagnoser, ChiSquareOptions, OnIsolation, Schedule, Signature, StatisticKind, ThresholdMode,
    },
    method::MethodOptions,
};

/// Spoils right options; the refusal must name `key` and hold `words`.
fn refused(key: &str, words: &str, spoil: impl FnOnce(&mut ChiSquareOptions)) {
    refused_from(without_calibration(scalar(0.8)), key, words, spoil);
}

fn refused_from(
    mut options: ChiSquareOptions,
    key: &str,
    words: &str,
    spoil: impl FnOnce(&mut ChiSquareOptions),
) {
    assert!(options.validate(1.0).is_ok());
    spoil(&mut options);
    let refusal = options.validate(1.0).expect_err(key);
    assert_eq!(refusal.key, key, "{refusal}");
    assert!(
        refusal.message.contains(words) && refusal.message.contains(';'),
        "{refusal}"
    );
    assert!(options.design(1.0).is_err());
}

#[test]
fn matrices_of_a_wrong_shape_are_refused() {
    refused("model.transition", "is missing", |options| {
        options.model.transition.clear()
    });
    refused("model.transition", "2 x 1", |options| {
        options.model.transition = vec![vec![0.8], vec![0.1]]
    });
    refused("model.measurement", "is missing", |options| {
        options.model.measurement.clear()
    });
    refused("model.measurement", "1 x 2", |options| {
        options.model.measurement = vec![vec![1.0, 0.0]]
    });
    refused("model.input", "2 x 1", |options| {
        options.model.input = vec![vec![1.0], vec![1.0]]
    });
    refused("model.feedthrough", "1 x 1", |options| {
        options.model.input = vec![vec![1.0, 1.0]];
        options.model.feedthrough = vec![vec![1.0]];
    });
    refused("model.measurement_noise_covariance", "0 x 0", |options| {
        options.model.measurement_noise_covariance.clear();
    });
    refused("model.process_noise_input", "is missing", |options| {
        options.model.process_noise_covariance = vec![vec![1.0, 0.0], vec![0.0, 1.0]];
    });
    refused("model.initial_covariance", "is missing", |options| {
        options.model.initial_covariance.clear()
    });
    refused("model.initial_state", "length 2", |options| {
        options.model.initial_state = Some(vec![0.0; 2])
    });
    refused("model.initial_input", "length 1", |options| {
        options.model.initial_input = Some(vec![0.0])
    });
    refused("model.transition.1", "1 entries", |options| {
        options.model.transition = vec![vec![1.0, 0.0], vec![1.0]];
    });
}

#[test]
fn entries_that_are_not_finite_are_refused() {
    refused("model.transition", "NaN", |options| {
        options.model.transition = vec![vec![f64::NAN]]
    });
    refused("model.initial_state", "inf", |options| {
        options.model.initial_state = Some(vec![f64::INFINITY])
    });
}

#[test]
fn what_is_no_covariance_is_refused() {
    refused(
        "model.measurement_noise_covariance",
        "not positive definite",
        |options| {
            options.model.measurement_noise_covariance = vec![vec![0.0]];
        },
    );
    refused(
        "model.process_noise_covariance",
        "negative eigenvalue",
        |options| {
            options.model.process_noise_covariance = vec![vec![-1.0]];
        },
    );
    refused("model.initial_covariance", "negative eigenvalue", |options| {
        options.model.initial_covariance = vec![vec![-1.0]];
    });
    refused_from(
        longitudinal(),
        "model.measurement_noise_covariance",
        "not symmetric",
        |options| {
            options.model.measurement_noise_covariance[0][1] = 1e-3;
        },
    );
}

#[test]
fn a_filter_that_does_not_converge_is_refused() {
    refused("model.transition", "not seen by the sensors", |options| {
        options.model.transition = vec![vec![1.0]];
        options.model.measurement = vec![vec![0.0]];
    });
}

#[test]
fn a_blind_plain_test_is_refused_with_its_alternatives() {
    for (a, verdict) in [(1.1, "refused_unstable"), (-1.0, "refused_marginal")] {
        let mut options = without_calibration(scalar(a));
        options.statistics.enabled.push(StatisticKind::StatePlain);
        let refusal = options.validate(1.0).unwrap_err();
        assert_eq!(refusal.key, "statistics.enabled");
        for words in [verdict, "state_window", "glr", "stability_guard"] {
            assert!(refusal.message.contains(words), "{refusal}");
        }
    }
    refused_from(
        switched_quarter_car_stable(),
        "statistics.enabled",
        "unknown",
        |options| {
            options.model.assumed_schedule = None;
        },
    );
}

/// The switched quarter car with a known period, for which the plain test is admitted.
fn switched_quarter_car_stable() -> ChiSquareOptions {
    let mut options = switched_quarter_car();
    options.statistics.stability_guard = residual_diagnosis::chi_square::StabilityGuard::Refuse;
    options.model.assumed_schedule = Some(vec![0, 1, 2]);
    options
}

#[test]
fn factors_that_decay_do_not_make_a_schedule_stable() {
    // Each has the spectral radius 0.5, their product 9.49.
    let mut options = switched_quarter_car_stable();
    let unit = vec![vec![1.0, 0.0], vec![0.0, 1.0]];
    for (model, transition) in options.models.iter_mut().zip([
        [[0.5, 3.0], [0.0, 0.5]],
        [[0.5, 0.0], [3.0, 0.5]],
        [[0.5, 0.0], [0.0, 0.5]],
    ]) {
        model.transition = transition.map(|row| row.to_vec()).to_vec();
        model.measurement = unit.clone();
        model.measurement_noise_covariance = unit.clone();
        model.process_noise_covariance = unit.clone();
        for entry in [
            &mut model.input,
            &mut model.feedthrough,
            &mut model.process_noise_input,
        ] {
            entry.clear();
        }
    }
    options.model.initial_state = None;
    options.model.initial_input = None;
    options.model.initial_covariance = unit;
    options.model.assumed_schedule = Some(vec![2]);
    assert!(options.validate(1.0).is_ok());
    options.model.assumed_schedule = Some(vec![1, 0]);
    let refusal = options.validate(1.0).unwrap_err();
    assert!(
        refusal.message.contains("refused_unstable") && refusal.message.contains("9.49"),
        "{refusal}"
    );
}

#[test]
fn models_and_schedule_must_fit_together() {
    refused("models", "\"selected\"", |options| {
        options.models.push(options.model.matrices())
    });
    refused("models", "is missing", |options| {
        options.model.schedule = Schedule::Selected
    });
    refused("model.schedule", "a program", |options| {
        options.model.schedule = Schedule::External
    });
    refused("model.assumed_schedule", "remove it", |options| {
        options.model.assumed_schedule = Some(vec![0])
    });
    refused_from(switched_quarter_car(), "model", "move them", |options| {
        options.model.transition = vec![vec![1.0]];
    });
    refused_from(
        switched_quarter_car(),
        "model.assumed_schedule",
        "0 to 2",
        |options| {
            options.model.assumed_schedule = Some(vec![3]);
        },
    );
    refused_from(
        switched_quarter_car(),
        "models.1",
        "of another shape",
        |options| {
            options.models[1] = longitudinal().model.matrices();
        },
    );
}

#[test]
fn statistics_that_do_not_fit_are_refused() {
    use StatisticKind::{Glr, Residual, StatePlain};
    refused("statistics.enabled", "none twice", |options| {
        options.statistics.enabled.push(Residual)
    });
    refused("statistics.enabled", "at least one", |options| {
        options.statistics.enabled.clear()
    });
    refused("statistics.decision", "enabled statistics only", |options| {
        options.statistics.decision = vec![StatePlain]
    });
    refused("statistics.report_statistic", "state test", |options| {
        options.statistics.report_statistic = Some(Glr)
    });
    refused("statistics.window_steps", "at least one", |options| {
        options.statistics.window_steps.clear()
    });
    refused("statistics.window_steps", "1 to", |options| {
        options.statistics.window_steps = vec![0, 3]
    });
    refused("statistics.two_propagator_reset_steps", "1 to", |options| {
        options.statistics.two_propagator_reset_steps = 0;
    });
    refused("statistics.enabled", "a record holds 64", |options| {
        options.statistics.window_steps = (1..40).collect();
    });
    refused("cusum.reference", "above 0", |options| {
        options.cusum.reference = 0.0
    });
}

#[test]
fn settings_of_the_likelihood_ratio_out_of_range_are_refused() {
    refused("glr.window_steps", "1 to", |options| options.glr.window_steps = 0);
    refused("glr.onset_stride_steps", "1 to 120", |options| {
        options.glr.onset_stride_steps = 121
    });
    refused("glr.signatures", "at least one", |options| {
        options.glr.signatures.clear()
    });
    refused("glr.isolation_margin", "above 0", |options| {
        options.glr.isolation_margin = f64::NAN
    });
    refused("glr.process_fault_input", "is missing", |options| {
        options.glr.signatures = vec![Signature::ProcessStep]
    });
    refused("glr.process_fault_input", "process_step", |options| {
        options.glr.process_fault_input = vec![vec![1.0]];
    });
    refused("glr.process_fault_input", "2 x 1", |options| {
        options.glr.signatures.push(Signature::ProcessStep);
        options.glr.process_fault_input = vec![vec![1.0], vec![1.0]];
    });
    refused("glr.process_fault_names", "1 different names", |options| {
        options.glr.signatures.push(Signature::ProcessStep);
        options.glr.process_fault_input = vec![vec![1.0]];
        options.glr.process_fault_names = Some(Vec::new());
    });
}

#[test]
fn thresholds_out_of_range_are_refused() {
    refused("threshold.false_alarm_probability", "0.5", |options| {
        options.threshold.false_alarm_probability = 0.6
    });
    refused("threshold.run_false_alarm_probability", "above 0", |options| {
        options.threshold.run_false_alarm_probability = 0.0;
    });
    refused("threshold.run_steps", "1 to", |options| {
        options.threshold.run_steps = 0
    });
    refused("threshold.calibration_runs", "200 to", |options| {
        options.threshold.calibration_runs = 100
    });
    refused("threshold.glr", "above 0", |options| options.threshold.glr = -1.0);
    refused("threshold.cusum", "above 0", |options| {
        options.threshold.cusum = f64::INFINITY
    });
}

#[test]
fn alarm_rules_that_do_not_fit_are_refused() {
    refused("alarm.confirm_steps", "at least 1", |options| {
        options.alarm.confirm_steps = 0
    });
    refused("alarm.clear_steps", "at least 1", |options| {
        options.alarm.clear_steps = 0
    });
    refused("alarm.max_gap_steps", "at least 1", |options| {
        options.alarm.max_gap_steps = 0
    });
    refused("alarm.on_isolation", "only \"glr\" isolates", |options| {
        options.statistics.enabled = vec![StatisticKind::Residual];
        options.statistics.decision = vec![StatisticKind::Residual];
        options.alarm.on_isolation = OnIsolation::Exclude;
    });
    refused("numerics.rank_tolerance", "above 0", |options| {
        options.numerics.rank_tolerance = 0.0
    });
    refused("numerics.steady_state_tolerance", "above 0", |options| {
        options.numerics.steady_state_tolerance = 1.0;
    });
}

#[test]
fn names_must_be_as_many_as_needed_and_different() {
    refused_from(
        longitudinal(),
        "model.measurement_names",
        "2 different names",
        |options| {
            options.model.measurement_names = Some(vec!["speed".to_owned(); 2]);
        },
    );
    refused("model.state_names", "1 different names", |options| {
        options.model.state_names = Some(Vec::new())
    });
    refused("model.state_units", "1 units", |options| {
        options.model.state_units = Some(Vec::new())
    });
}

#[test]
fn a_threshold_per_run_cannot_be_calibrated_for_unknown_matrices() {
    let mut options = without_calibration(scalar(0.8));
    options.model.schedule = Schedule::External;
    assert!(ChiSquareDiagnoser::new(&options).is_ok());
    let key = |options: &ChiSquareOptions| ChiSquareDiagnoser::new(options).map(|_| ()).unwrap_err().key();
    let mut spoilt = options.clone();
    spoilt.threshold.glr = 0.0;
    assert_eq!(key(&spoilt), "threshold.glr");
    options.threshold.mode = ThresholdMode::PerRun;
    options.statistics.decision = vec![StatisticKind::Residual];
    assert_eq!(key(&options), "threshold.mode");
}

#[test]
fn unknown_keys_and_words_are_refused() {
    let text = "[glr]\nwindow = 3";
    assert!(
        toml::from_str::<ChiSquareOptions>(text)
            .unwrap_err()
            .to_string()
            .contains("window")
    );
    let text = "[statistics]\nenabled = [\"residuals\"]";
    assert!(toml::from_str::<ChiSquareOptions>(text).is_err());
}
