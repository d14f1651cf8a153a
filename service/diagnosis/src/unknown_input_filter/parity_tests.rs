//! Parity tests against the reference files, against their own definition and at the edge of their bounds.

use super::*;
use crate::model::ModelOptions;
use serde::Deserialize;
use serde_json::Value;

#[derive(Deserialize)]
struct Plant {
    #[serde(rename = "A0")]
    a0: Vec<Vec<f64>>,
    #[serde(rename = "B")]
    b: Vec<Vec<f64>>,
    #[serde(rename = "C")]
    c: Vec<Vec<f64>>,
    #[serde(rename = "D")]
    d: Vec<Vec<f64>>,
    #[serde(rename = "A_plus")]
    a_plus: Vec<Vec<f64>>,
    disturbance_bound: Vec<f64>,
    noise_bound: Vec<f64>,
}

const VTOL: &str = include_str!("../../tests/reference/unknown_input_filter/vtol_design.json");
const CASES: [&str; 2] = [
    include_str!("../../tests/reference/unknown_input_filter/vtol_case1.json"),
    include_str!("../../tests/reference/unknown_input_filter/vtol_case2.json"),
];
const BATTERY: &str = include_str!("../../tests/reference/unknown_input_filter/battery_bank.json");

fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap()
}

fn number<T: serde::de::DeserializeOwned>(value: &Value) -> T {
    serde_json::from_value(value.clone()).unwrap()
}

fn model(reference: &Value) -> LinearModel {
    let plant: Plant = number(&reference["model"]);
    let options = ModelOptions {
        a: plant.a0,
        b: plant.b,
        c: plant.c,
        d: plant.d,
        a_uncertainty: plant.a_plus,
        disturbance_bound: plant.disturbance_bound,
        measurement_noise_bound: plant.noise_bound,
        ..ModelOptions::default()
    };
    LinearModel::new(&options, 1.0).unwrap()
}

/// The certificates of a reference file with the gain and the constant threshold listed there.
fn certificates(reference: &Value) -> Vec<(ParityCertificate, f64, f64)> {
    let list: Vec<Value> = number(&reference["certificates"]);
    list.iter()
        .map(|entry| {
            let certificate = ParityCertificate {
                mode: number(&entry["mode"]),
                fault: number(&entry["fault"]),
                length: number(&entry["L"]),
                mu: number(&entry["mu"]),
                lambda: number(&entry["lambda"]),
            };
            assert_eq!(certificate.transitions(), number::<usize>(&entry["window"]));
            (certificate, number(&entry["gain"]), number(&entry["h0"]))
        })
        .collect()
}

fn assert_close(found: f64, expected: f64, scale: f64, what: &str) {
    assert!(
        (found - expected).abs() <= 1e-9 * scale,
        "{what}: {found} instead of {expected}"
    );
}

#[test]
fn gains_and_constant_thresholds_are_those_of_the_reference() {
    let mut checked = 0;
    for text in [VTOL, BATTERY] {
        let reference = json(text);
        let model = model(&reference);
        for (certificate, gain, constant) in certificates(&reference) {
            let test = ParityTest::new(&certificate, &model, false).unwrap();
            assert_close(test.gain(), gain, gain, "gain");
            assert_close(test.constant_half_width(), constant, constant, "h0");
            checked += 1;
        }
    }
    assert!(checked >= 14, "{checked}");
}

#[test]
fn residuals_and_half_widths_follow_the_reference_runs() {
    let design = json(VTOL);
    let model = model(&design);
    let certificates = certificates(&design);
    for text in CASES {
        let case = json(text);
        let measurements: Vec<Vec<f64>> = number(&case["y"]);
        let instants: Vec<usize> = number(&case["default"]["k"]);
        let u: Vec<f64> = number(&case["u"]);
        let residuals: Vec<Vec<Vec<Option<f64>>>> = number(&case["default"]["parity_residual"]);
        let half_widths: Vec<Vec<Vec<Option<f64>>>> = number(&case["default"]["parity_half_width"]);
        let mut compared = 0;
        for (i, mode) in [[0], [1]].iter().enumerate() {
            let mode = FaultMode::from_actuators(mode).unwrap();
            let tests: Vec<ParityTest> = [1, 3, 10, 30]
                .iter()
                .map(|&length| {
                    let wanted =
                        |c: &&(ParityCertificate, f64, f64)| c.0.mode == mode && c.0.length == length;
                    ParityTest::new(&certificates.iter().find(wanted).unwrap().0, &model, false).unwrap()
                })
                .collect();
            let mut window = ParityWindow::new(&model, 30, false);
            let unknown = vec![f64::INFINITY; 4];
            for (k, y) in measurements.iter().enumerate().skip(1) {
                window.push(y, &u, &unknown);
                let Some(position) = instants.iter().position(|&instant| instant == k) else {
                    continue;
                };
                for (l, test) in tests.iter().enumerate() {
                    let found = test.evaluate(&window);
                    let expected = residuals[position][i][l].zip(half_widths[position][i][l]);
                    assert_eq!(found.is_some(), expected.is_some(), "k = {k}, window {l}");
                    if let (Some((r, h)), Some((expected_r, expected_h))) = (found, expected) {
                        assert_close(r, expected_r, expected_h, "residual");
                        assert_close(h, expected_h, expected_h, "half width");
                        compared += 1;
                    }
                }
            }
        }
        assert!(compared >= 100, "{compared}");
    }
}

/// Drives the window of a certificate with the noise and disturbance that stretch its residual most.
fn adjoint_ratio(certificate: &ParityCertificate, model: &LinearModel, outward_rounding: bool) -> f64 {
    let test = ParityTest::new(certificate, model, outward_rounding).unwrap();
    let mut window = ParityWindow::new(model, certificate.transitions(), outward_rounding);
    let sign = |value: f64| if value < 0.0 { -1.0 } else { 1.0 };
    let mut x = DVector::zeros(model.state_count());
    let mut u = DVector::zeros(model.actuator_count());
    let own = certificate.mode.actuators().next();
    for (k, mu) in certificate.mu_columns().iter().enumerate() {
        let noise = mu.map(sign).component_mul(model.v());
        window.push(
            (model.c() * &x + noise).as_slice(),
            u.as_slice(),
            x.abs().as_slice(),
        );
        if let Some(lambda) = certificate.lambda.get(k) {
            let lambda = DVector::from_column_slice(lambda);
            let d = (model.d().transpose() * lambda)
                .map(sign)
                .component_mul(model.w());
            u = DVector::from_fn(u.len(), |j, _| (0.7 * k as f64 + j as f64).sin());
            let mut own_fault = DVector::zeros(u.len());
            if let Some(j) = own {
                own_fault[j] = 5.0 * (0.3 * k as f64).cos();
            }
            x = model.a0() * x + model.b() * (&u + own_fault) + model.d() * d;
        }
    }
    let (r, h) = test.evaluate(&window).unwrap();
    r.abs() / h
}

#[test]
fn the_worst_noise_reaches_the_half_width_and_with_outward_rounding_never_exceeds_it() {
    for text in [VTOL, BATTERY] {
        let mut reference = json(text);
        let nx = reference["model"]["A0"].as_array().unwrap().len();
        reference["model"]["A_plus"] = serde_json::to_value(vec![vec![0.0; nx]; nx]).unwrap();
        let model = model(&reference);
        for (certificate, ..) in certificates(&reference) {
            let plain = adjoint_ratio(&certificate, &model, false);
            assert!((plain - 1.0).abs() < 1e-9, "{plain}");
            let outward = adjoint_ratio(&certificate, &model, true);
            assert!(outward <= 1.0 && outward > 1.0 - 1e-8, "{outward}");
        }
    }
}

#[test]
fn a_missing_sample_restarts_the_window() {
    let reference = json(VTOL);
    let model = model(&reference);
    let (certificate, ..) = certificates(&reference)
        .into_iter()
        .find(|c| c.0.length == 3)
        .unwrap();
    let test = ParityTest::new(&certificate, &model, true).unwrap();
    let mut window = ParityWindow::new(&model, 3, true);
    let (y, u, unknown) = ([0.01; 4], [0.0; 2], [f64::NAN; 4]);
    let evaluated_after = |window: &mut ParityWindow, first: &dyn Fn(&mut ParityWindow)| {
        first(window);
        let mut pushes = 0;
        while test.evaluate(window).is_none() {
            window.push(&y, &u, &unknown);
            pushes += 1;
        }
        pushes
    };
    assert_eq!(evaluated_after(&mut window, &|_| ()), 4);
    assert_eq!(
        evaluated_after(&mut window, &|w| w.push(&[0.0, f64::NAN, 0.0, 0.0], &u, &unknown)),
        4
    );
    assert_eq!(
        evaluated_after(&mut window, &|w| w.push(&y, &[f64::NAN, 0.0], &unknown)),
        3
    );
    assert_eq!(
        evaluated_after(&mut window, &|w| w.push(&y[..3], &u, &unknown)),
        4
    );
    assert_eq!(evaluated_after(&mut window, &ParityWindow::restart), 4);
}

#[test]
fn a_state_bound_after_a_reset_replaces_the_lost_one() {
    let reference = json(BATTERY);
    let model = model(&reference);
    let mut window = ParityWindow::new(&model, 5, true);
    let (y, u) = ([0.0; 4], [0.0; 3]);
    window.push(&y, &u, &[1.0; 5]);
    window.push(&y, &u, &[1.0; 5]);
    assert_eq!(window.complete_transitions(), 1);
    window.push(&y, &u, &[f64::INFINITY; 5]);
    assert_eq!(window.complete_transitions(), 0);
    window.replace_state_bound(&[2.0; 5]);
    window.push(&y, &u, &[1.0; 5]);
    assert_eq!(window.complete_transitions(), 1);
    assert_eq!(
        window.latest(1).unwrap().state_bounds,
        [[2.0; 5], [1.0; 5]].concat()
    );
}

#[test]
fn certificates_that_do_not_belong_to_the_model_are_refused() {
    let reference = json(VTOL);
    let model = model(&reference);
    let (good, ..) = certificates(&reference).remove(0);
    let refused = |change: &dyn Fn(&mut ParityCertificate)| {
        let mut certificate = good.clone();
        change(&mut certificate);
        ParityTest::new(&certificate, &model, true).unwrap_err()
    };
    assert!(matches!(
        refused(&|c| c.mu[0][1] *= 1.0 + 1e-7),
        CertificateError::EqualityViolated { .. }
    ));
    assert!(matches!(
        refused(&|c| c.lambda[0][2] += 1e-6),
        CertificateError::EqualityViolated { .. }
    ));
    assert!(matches!(
        refused(&|c| c.mu[0][1] = f64::NAN),
        CertificateError::NonFinite { .. }
    ));
    assert!(matches!(
        refused(&|c| drop(c.mu.pop())),
        CertificateError::DimensionMismatch { .. }
    ));
    assert!(matches!(
        refused(&|c| c.length = 2),
        CertificateError::FaultLength { .. }
    ));
    assert!(matches!(
        refused(&|c| c.fault = 0),
        CertificateError::FaultInMode { .. }
    ));
    assert!(matches!(
        refused(&|c| c.fault = 2),
        CertificateError::UnknownActuator { .. }
    ));
    let flip = |c: &mut ParityCertificate| {
        c.mu.iter_mut()
            .chain(&mut c.lambda)
            .flatten()
            .for_each(|entry| *entry = -*entry);
    };
    assert!(matches!(refused(&flip), CertificateError::NoResponse { .. }));
}
