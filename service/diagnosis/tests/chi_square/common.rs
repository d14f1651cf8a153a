//! Models and small runners of these tests.

use crate::support::{numbers, reference_of, rows};
use residual_diagnosis::{
    chi_square::{
        ChiSquareDiagnoser, ChiSquareOptions, MatricesOptions, ModelOptions, Schedule, Signature,
        StabilityGuard, StatisticKind, ThresholdMode,
    },
    diagnoser::{Diagnoser, StepInput, StepRecord},
};
use serde_json::Value;

/// Every statistic.
pub const ALL: [StatisticKind; 6] = [
    StatisticKind::Residual,
    StatisticKind::StatePlain,
    StatisticKind::StateWindow,
    StatisticKind::StateTwoPropagator,
    StatisticKind::Glr,
    StatisticKind::Cusum,
];

/// A reference file of this method.
pub fn file(name: &str) -> Value {
    reference_of("chi_square", name)
}

/// The paper's scalar example, x(k) = a x(k-1) + w, z = x + v, q = r = 0.01, x(0) = 0 known.
pub fn scalar(a: f64) -> ChiSquareOptions {
    ChiSquareOptions {
        model: ModelOptions {
            transition: vec![vec![a]],
            process_noise_covariance: vec![vec![0.01]],
            measurement: vec![vec![1.0]],
            measurement_noise_covariance: vec![vec![0.01]],
            initial_covariance: vec![vec![0.0]],
            ..ModelOptions::default()
        },
        ..ChiSquareOptions::default()
    }
}

/// The matrices of a vector reference file; its noise factor G serves as noise input with Q = I.
pub fn matrices(model: &Value) -> MatricesOptions {
    let factor = rows(&model["process_noise_factor"]);
    let noises = factor[0].len();
    let unit = |i: usize| (0..noises).map(|j| f64::from(u8::from(i == j))).collect();
    MatricesOptions {
        transition: rows(&model["transition"]),
        input: rows(&model["input"]),
        process_noise_input: factor,
        process_noise_covariance: (0..noises).map(unit).collect(),
        measurement: rows(&model["measurement"]),
        feedthrough: rows(&model["feedthrough"]),
        measurement_noise_covariance: rows(&model["measurement_noise_covariance"]),
    }
}

/// Puts matrices into the table of the model.
pub fn with_matrices(model: ModelOptions, matrices: MatricesOptions) -> ModelOptions {
    ModelOptions {
        transition: matrices.transition,
        input: matrices.input,
        process_noise_input: matrices.process_noise_input,
        process_noise_covariance: matrices.process_noise_covariance,
        measurement: matrices.measurement,
        feedthrough: matrices.feedthrough,
        measurement_noise_covariance: matrices.measurement_noise_covariance,
        ..model
    }
}

/// Start and settings of a vector reference file, with every statistic on and no calibration.
pub fn reference_options(file: &Value) -> ChiSquareOptions {
    let mut options = without_calibration(ChiSquareOptions {
        model: ModelOptions {
            initial_state: Some(numbers(&file["initial_state"])),
            initial_covariance: rows(&file["initial_covariance"]),
            initial_input: Some(vec![file["known_input"][0].as_f64().unwrap()]),
            ..ModelOptions::default()
        },
        ..ChiSquareOptions::default()
    });
    options.statistics.enabled = ALL.to_vec();
    options.statistics.stability_guard = StabilityGuard::Warn;
    options.statistics.window_steps = crate::support::integers(&file["windows_steps"]);
    options.statistics.two_propagator_reset_steps =
        file["two_propagator_reset_steps"].as_u64().unwrap() as usize;
    options.glr.window_steps = file["glr_window_steps"].as_u64().unwrap() as usize;
    options.cusum.reference = file["cusum_reference"].as_f64().unwrap();
    options.threshold.false_alarm_probability = file["false_alarm_probability"].as_f64().unwrap();
    options
}

/// The longitudinal motion of a vehicle, with or without its known input.
pub fn longitudinal() -> ChiSquareOptions {
    let file = file("longitudinal_dropout.json");
    let mut options = reference_options(&file);
    options.model = with_matrices(options.model, matrices(&file["model"]));
    options
}

/// The quarter car with one damper setting, 1600 N s/m.
pub fn quarter_car() -> ChiSquareOptions {
    let file = file("quarter_car_switched.json");
    let mut options = reference_options(&file);
    options.model = with_matrices(options.model, matrices(&file["models"][1]));
    options
}

/// The quarter car with the switched damper; the last command is the number of the setting.
pub fn switched_quarter_car() -> ChiSquareOptions {
    let file = file("quarter_car_switched.json");
    let mut options = reference_options(&file);
    options.model.schedule = Schedule::Selected;
    options.models = file["models"].as_array().unwrap().iter().map(matrices).collect();
    options
}

/// Fixed thresholds, so that nothing is simulated.
pub fn without_calibration(mut options: ChiSquareOptions) -> ChiSquareOptions {
    options.threshold.mode = ThresholdMode::PerInstant;
    options.threshold.glr = 20.0;
    options.threshold.cusum = 15.0;
    options.threshold.bank = 1.0;
    options
}

/// Options whose only statistic is this one, deciding.
pub fn only(mut options: ChiSquareOptions, kind: StatisticKind) -> ChiSquareOptions {
    options.statistics.enabled = vec![kind];
    options.statistics.decision = vec![kind];
    options
}

/// Sensor steps only.
pub fn steps_only(mut options: ChiSquareOptions, window_steps: usize) -> ChiSquareOptions {
    options.glr.signatures = vec![Signature::SensorStep];
    options.glr.window_steps = window_steps;
    options
}

/// The diagnoser of options that must be right.
pub fn diagnoser(options: &ChiSquareOptions) -> ChiSquareDiagnoser {
    ChiSquareDiagnoser::new(options).unwrap()
}

/// One step.
pub fn step(diagnoser: &mut ChiSquareDiagnoser, z: &[f64], u: &[f64]) -> StepRecord {
    let mut record = StepRecord::new(diagnoser.description().channels.len());
    diagnoser.step(&StepInput::new(z, u), &mut record);
    record
}

/// Fails unless |actual - expected| <= relative |expected| + absolute.
pub fn assert_near(what: impl Fn() -> String, actual: f64, expected: f64, relative: f64, absolute: f64) {
    let limit = relative * expected.abs() + absolute;
    assert!(
        (actual - expected).abs() <= limit,
        "{}: {actual:e} instead of {expected:e}",
        what()
    );
}

/// L L'.
pub fn square(factor: &residual_diagnosis::matrix::Matrix) -> nalgebra::DMatrix<f64> {
    let dense = factor.to_dense();
    &dense * dense.transpose()
}
