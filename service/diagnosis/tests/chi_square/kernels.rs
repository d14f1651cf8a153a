//! The building blocks against `kernels.json`.

use crate::common::{assert_near, diagnoser, file, longitudinal, only, scalar, without_calibration};
use crate::support::{integers, numbers, rows};
use nalgebra::DMatrix;
use residual_diagnosis::{
    chi_square::{QuadraticForm, StatisticKind, chi_square_upper_quantile, non_centrality, stability},
    covariance::semidefinite_factor,
    matrix::Matrix,
    tables,
};
use serde_json::Value;
use statrs::distribution::{ContinuousCDF, Normal};

fn dense(value: &Value) -> DMatrix<f64> {
    tables::matrix("", &rows(value)).unwrap()
}

#[test]
fn quadratic_forms_agree_in_value_and_rank() {
    let kernels = file("kernels.json");
    let tolerance = kernels["rank_tolerance"].as_f64().unwrap();
    for case in kernels["quadratic_form"].as_array().unwrap() {
        let factor = Matrix::from(&dense(&case["factor"]));
        let mut form = QuadraticForm::new(factor.rows(), tolerance);
        form.factor(&factor);
        let name = || case["name"].to_string();
        assert_eq!(form.degrees() as u64, case["dof"].as_u64().unwrap(), "{}", name());
        let beta = numbers(&case["difference"]);
        let expected = case["statistic"].as_f64().unwrap();
        assert_near(name, form.evaluate(&beta), expected, 1e-8, 1e-12);
        let whitened = form.whitening().to_dense() * nalgebra::DVector::from_vec(beta);
        assert_near(name, whitened.norm_squared(), expected, 1e-8, 1e-12);
    }
}

#[test]
fn quantiles_agree_to_the_last_digits() {
    let kernels = file("kernels.json");
    for (probability, expected) in kernels["chi_square_upper_quantile"].as_object().unwrap() {
        let Ok(probability) = probability.parse() else {
            continue;
        };
        for (i, expected) in numbers(expected).into_iter().enumerate() {
            let found = chi_square_upper_quantile(probability, i + 1);
            assert_near(|| format!("{probability} {}", i + 1), found, expected, 1e-14, 0.0);
        }
    }
    assert_near(
        || "5e-3, 1".into(),
        chi_square_upper_quantile(5e-3, 1),
        7.879438576622419,
        1e-15,
        0.0,
    );
}

#[test]
fn the_stability_guard_gives_the_expected_verdicts() {
    for case in file("kernels.json")["stability_guard"].as_array().unwrap() {
        let factor = |name: &str| semidefinite_factor(&dense(&case[name])).unwrap();
        let (noise, start) = (factor("process_noise"), factor("initial_covariance"));
        let n = noise.nrows();
        let excitation = DMatrix::from_fn(
            n,
            2 * n,
            |i, j| if j < n { noise[(i, j)] } else { start[(i, j - n)] },
        );
        let found = stability(
            &dense(&case["transition"]),
            &excitation,
            &dense(&case["measurement"]),
        )
        .unwrap();
        let name = || case["name"].to_string();
        assert_eq!(
            found.verdict.name(),
            case["verdict"].as_str().unwrap(),
            "{}",
            name()
        );
        let radii = [found.spectral_radius, found.effective_spectral_radius];
        for (found, entry) in radii
            .into_iter()
            .zip(["spectral_radius", "effective_spectral_radius"])
        {
            assert_near(name, found, case[entry].as_f64().unwrap(), 1e-6, 0.0);
        }
    }
}

#[test]
fn a_run_on_the_fault_alone_gives_the_non_centralities() {
    let expected = &file("kernels.json")["non_centrality"];
    let instants = integers(&expected["instants"]);
    let mut options = longitudinal();
    options.statistics.window_steps = vec![3, 9, 27];
    let last = *instants.last().unwrap();
    let fault: Vec<Vec<f64>> = (1..=last)
        .map(|k| vec![0.0, if k >= 60 { 0.3 } else { 0.0 }])
        .collect();
    let mut found = Vec::new();
    non_centrality(&options, &fault, |outcome| {
        let mut values = vec![outcome.residual.value, outcome.plain.value, outcome.pair.value];
        values.extend(outcome.windows().map(|(_, window)| window.value));
        found.push(values);
    })
    .unwrap();
    let names = [
        "residual",
        "plain",
        "two_propagator_10",
        "window_3",
        "window_9",
        "window_27",
    ];
    for (i, name) in names.into_iter().enumerate() {
        for (k, expected) in instants.iter().zip(numbers(&expected[name])) {
            assert_near(|| format!("{name} at {k}"), found[k - 1][i], expected, 1e-7, 1e-9);
        }
    }
}

/// P(x² > t) of x ~ N(mean, variance).
fn exceedance(threshold: f64, mean: f64, variance: f64) -> f64 {
    let normal = Normal::standard();
    let (root, deviation) = (threshold.sqrt(), variance.sqrt());
    normal.sf((root - mean) / deviation) + normal.cdf((-root - mean) / deviation)
}

#[test]
fn false_alarm_rates_under_model_error_are_the_exact_ones() {
    let mut options = only(without_calibration(scalar(0.8)), StatisticKind::StatePlain);
    options.threshold.false_alarm_probability = 5e-3;
    let diagnoser = diagnoser(&options);
    let steady = diagnoser.design().report.steady_state.as_ref().unwrap();
    let (gain, s) = (steady.gain[(0, 0)], steady.innovation_covariance[(0, 0)]);
    // T of the steady filter: T = a² T + K² S.
    let t = gain * gain * s / (1.0 - 0.64);
    let threshold = chi_square_upper_quantile(5e-3, 1);
    for case in file("kernels.json")["model_error"]["cases"].as_array().unwrap() {
        let value = |name: &str| case[name].as_f64().unwrap();
        let (a, q, r) = (
            value("true_transition"),
            value("true_process_noise"),
            value("true_measurement_noise"),
        );
        let b = value("unmodelled_input");
        // State (x, x̂, x_s), driven by w, v and the input: mean and covariance in the steady state.
        let (f, k) = (0.8, gain);
        let transition =
            DMatrix::from_row_slice(3, 3, &[a, 0.0, 0.0, k * a, (1.0 - k) * f, 0.0, 0.0, 0.0, f]);
        let noise = DMatrix::from_row_slice(3, 2, &[q.sqrt(), 0.0, k * q.sqrt(), k * r.sqrt(), 0.0, 0.0]);
        let (mut covariance, mut mean) = (DMatrix::zeros(3, 3), DMatrix::zeros(3, 1));
        let drive = DMatrix::from_row_slice(3, 1, &[b, k * b, 0.0]);
        for _ in 0..2000 {
            covariance = &transition * covariance * transition.transpose() + &noise * noise.transpose();
            mean = &transition * mean + &drive;
        }
        // ν = a x + b + w + v - f x̂, β = x_s - x̂.
        let nu = DMatrix::from_row_slice(1, 3, &[a, -f, 0.0]);
        let beta = DMatrix::from_row_slice(1, 3, &[0.0, -1.0, 1.0]);
        let form = |row: &DMatrix<f64>| ((row * &mean)[0], (row * &covariance * row.transpose())[0]);
        let (nu_mean, nu_variance) = form(&nu);
        let residual = exceedance(threshold * s, nu_mean + b, nu_variance + q + r);
        let (beta_mean, beta_variance) = form(&beta);
        let plain = exceedance(threshold * t, beta_mean, beta_variance);
        assert_near(
            || format!("residual, {case}"),
            residual,
            value("residual_rate"),
            1e-8,
            0.0,
        );
        assert_near(
            || format!("plain, {case}"),
            plain,
            value("state_plain_rate"),
            1e-8,
            0.0,
        );
    }
}
