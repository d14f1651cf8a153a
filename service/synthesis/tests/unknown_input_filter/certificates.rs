//! Designed certificates against the reference values and against what a test of the diagnosis makes of them.

use crate::reference_files::{aircraft, mode, plant, reference};
use nalgebra::{DMatrix, DVector};
use residual_diagnosis::model::LinearModel;
use residual_diagnosis::unknown_input_filter::certificate::ParityCertificate;
use residual_diagnosis::unknown_input_filter::modes::{FaultMode, enumerate_modes};
use residual_diagnosis::unknown_input_filter::parity::ParityTest;
use residual_diagnosis::unknown_input_filter::parity_window::ParityWindow;
use residual_synthesis::unknown_input_filter::certificates::{
    CertificateOptions, Designed, FailureReason, design as design_with,
};
use residual_synthesis::unknown_input_filter::floors::FloorError;
use serde_json::Value;

fn design(
    model: &LinearModel,
    modes: &[FaultMode],
    options: &CertificateOptions,
) -> Result<Designed, FloorError> {
    design_with(model, modes, options, &mut |_| ())
}

fn options(lengths: &[usize], pre_samples: usize, nominal: DVector<f64>) -> CertificateOptions {
    CertificateOptions {
        lengths: lengths.to_vec(),
        pre_samples,
        nominal_state: nominal,
    }
}

/// λ or μ, one column an instant.
fn matrix(rows: &[Vec<f64>]) -> DMatrix<f64> {
    DMatrix::from_fn(rows[0].len(), rows.len(), |i, k| rows[k][i])
}

/// The largest miss of an equality, written out, relative to the largest multiplier.
fn miss(certificate: &ParityCertificate, model: &LinearModel) -> f64 {
    let (lambda, mu) = (matrix(&certificate.lambda), matrix(&certificate.mu));
    let mut miss = (certificate.mode.unknown_input_matrix(model.b()).transpose() * &lambda).amax();
    let zero = DVector::zeros(model.state_count());
    for k in 0..mu.ncols() {
        let column = |k: usize| {
            if k < lambda.ncols() {
                lambda.column(k).into()
            } else {
                zero.clone()
            }
        };
        let before: DVector<f64> = if k == 0 { zero.clone() } else { column(k - 1) };
        let dynamics = before - model.a0().transpose() * column(k) - model.c().transpose() * mu.column(k);
        miss = miss.max(dynamics.amax());
    }
    miss / lambda.amax().max(mu.amax())
}

/// h at the nominal state, written out.
fn threshold(certificate: &ParityCertificate, model: &LinearModel, nominal: &DVector<f64>) -> f64 {
    let (lambda, mu) = (matrix(&certificate.lambda), matrix(&certificate.mu));
    (mu.abs().transpose() * model.v()).sum()
        + ((model.d().transpose() * &lambda).abs().transpose() * model.w()).sum()
        + (lambda.abs().transpose() * (model.a_plus() * nominal)).sum()
}

/// Everything that must hold of every certificate.
fn check_certificates(designed: &Designed, model: &LinearModel, nominal: &DVector<f64>) {
    assert!(designed.failures.is_empty(), "{:?}", designed.failures);
    assert_eq!(designed.certificates.len(), designed.floors.len());
    for (certificate, floor) in designed.certificates.iter().zip(&designed.floors) {
        let question = floor.question;
        assert_eq!(
            (
                certificate.mode,
                certificate.fault,
                certificate.length,
                certificate.transitions()
            ),
            (
                question.mode,
                question.actuator,
                question.length,
                question.transitions()
            )
        );
        let miss = miss(certificate, model);
        assert!(miss <= 1e-13, "{question:?}: {miss:e}");
        assert!((threshold(certificate, model, nominal) - 1.0).abs() < 1e-12);
        let test = ParityTest::new(certificate, model, true).unwrap();
        assert!((floor.floor * test.gain() / 2.0 - 1.0).abs() < 1e-12 && test.gain() > 0.0);
    }
}

/// Compares with `lp_floors`, each entry a design of its own; returns how many were separable.
fn check_floors(file: &Value, model: &LinearModel, nominal: Option<f64>) -> usize {
    let mut separable = 0;
    for entry in file["lp_floors"].as_array().unwrap() {
        let number = |key: &str| entry[key].as_u64().unwrap() as usize;
        let nominal = nominal.unwrap_or_else(|| entry["nominal_state"].as_f64().unwrap());
        let nominal = DVector::from_element(model.state_count(), nominal);
        let options = options(&[number("L")], number("window") - number("L"), nominal.clone());
        let designed = design(model, &[mode(&entry["mode"])], &options).unwrap();
        check_certificates(&designed, model, &nominal);
        let certificate = designed.certificates.iter().find(|c| c.fault == number("fault"));
        let found = certificate.map(|certificate| 2.0 / certificate.gain(model));
        match (found, entry["floor"].as_f64()) {
            (Some(found), Some(expected)) => {
                assert!((found / expected - 1.0).abs() < 1e-6, "{entry}: {found}");
                separable += 1;
            }
            (found, expected) => {
                assert_eq!(found, expected, "{entry}");
                assert!(
                    designed
                        .not_separable
                        .iter()
                        .any(|q| q.actuator == number("fault"))
                );
            }
        }
    }
    separable
}

#[test]
fn certificates_of_the_aircraft_reach_every_reference_floor() {
    assert!(check_floors(&reference("vtol_design.json"), &aircraft(), None) >= 20);
}

#[test]
fn certificates_of_the_battery_reach_every_reference_floor() {
    let file = reference("battery_bank.json");
    let nominal = file["nominal_state"].as_f64().unwrap();
    assert!(check_floors(&file, &plant(&file["model"]), Some(nominal)) >= 8);
}

#[test]
fn certificates_of_the_aircraft_have_few_entries() {
    let model = aircraft();
    let nominal = DVector::from_element(4, 0.3);
    let lengths = [(1, 6), (3, 10), (10, 33), (30, 93)];
    let options = options(&lengths.map(|(length, _)| length), 0, nominal.clone());
    let designed = design(&model, &enumerate_modes(2, false, false), &options).unwrap();
    check_certificates(&designed, &model, &nominal);
    assert_eq!(designed.certificates.len(), 8);
    for certificate in &designed.certificates {
        let (length, most) = *lengths
            .iter()
            .find(|(length, _)| *length == certificate.length)
            .unwrap();
        let entries = certificate
            .mu
            .iter()
            .flatten()
            .filter(|&&entry| entry != 0.0)
            .count();
        let commands = model.b().transpose() * matrix(&certificate.lambda);
        let size = commands.amax();
        let commands = commands
            .iter()
            .filter(|&&entry| entry.abs() > 1e-12 * size)
            .count();
        println!(
            "{} L {length}: {entries} in mu, {commands} in B'lambda",
            certificate.mode
        );
        assert!(
            entries <= most && commands <= length,
            "{length}: {entries} in mu, {commands} in B'lambda"
        );
    }
}

/// The window after `fault` on the last L transitions, own faults beside, with the noise and the disturbance that
/// stretch the residual by `stretch` (-1, 0 or 1) of what they can.
fn window(certificate: &ParityCertificate, model: &LinearModel, fault: f64, stretch: f64) -> ParityWindow {
    let n = certificate.transitions();
    let mut window = ParityWindow::new(model, n, true);
    let (lambda, mu) = (matrix(&certificate.lambda), matrix(&certificate.mu));
    let sign = |value: f64| if value < 0.0 { -stretch } else { stretch };
    let mut x = DVector::from_element(model.state_count(), 0.1);
    let mut u = DVector::zeros(model.actuator_count());
    for k in 0..=n {
        let v = mu.column(k).map(sign).component_mul(model.v());
        window.push((model.c() * &x + v).as_slice(), u.as_slice(), x.abs().as_slice());
        if k < n {
            let d = (model.d().transpose() * lambda.column(k))
                .map(sign)
                .component_mul(model.w());
            u = DVector::from_fn(u.len(), |j, _| (0.7 * k as f64 + j as f64).sin());
            let mut f = DVector::zeros(u.len());
            certificate
                .mode
                .actuators()
                .for_each(|j| f[j] = 5.0 * (0.3 * k as f64).cos());
            f[certificate.fault] = if k >= n - certificate.length { fault } else { 0.0 };
            x = model.a0() * x + model.b() * (&u + f) + model.d() * d;
        }
    }
    window
}

#[test]
fn the_residual_is_the_fault_times_the_gain_and_the_worst_noise_reaches_the_threshold() {
    for (name, nominal, pre_samples) in [("vtol_design.json", 0.3, 0), ("battery_bank.json", 2.0, 30)] {
        let mut file = reference(name);
        let nx = file["model"]["A0"].as_array().unwrap().len();
        file["model"]["A_plus"] = serde_json::to_value(vec![vec![0.0; nx]; nx]).unwrap();
        let model = plant(&file["model"]);
        let nominal = DVector::from_element(nx, nominal);
        let modes = enumerate_modes(model.actuator_count(), true, false);
        let designed = design(&model, &modes, &options(&[1, 10], pre_samples, nominal.clone())).unwrap();
        check_certificates(&designed, &model, &nominal);
        assert!(designed.certificates.len() >= 8);
        for (certificate, floor) in designed.certificates.iter().zip(&designed.floors) {
            let test = ParityTest::new(certificate, &model, true).unwrap();
            let evaluate = |fault, stretch| {
                test.evaluate(&window(certificate, &model, fault, stretch))
                    .unwrap()
            };
            let (r, _) = evaluate(2.0, 0.0);
            assert!((r / (2.0 * test.gain()) - 1.0).abs() < 1e-9, "{r}");
            for stretch in [-1.0, 1.0] {
                let (r, h) = evaluate(0.0, stretch);
                assert!((stretch * r / h - 1.0).abs() < 1e-8 && r.abs() <= h, "{r} {h}");
            }
            // Above its floor a fault is seen whatever the noise does, below it need not be.
            let alarm = |fault: f64| {
                let (r, h) = evaluate(fault, -1.0);
                r.abs() > h
            };
            assert!(
                alarm(1.0001 * floor.floor) && !alarm(0.9999 * floor.floor),
                "{floor:?}"
            );
        }
    }
}

#[test]
fn faults_that_cannot_be_told_apart_have_no_certificate() {
    let file = reference("vtol_design.json");
    let (mut separable, mut inseparable) = (0, 0);
    let cases = file["assumption_cases"].as_array().unwrap();
    for case in cases.iter().filter(|case| case["lp"].is_array()) {
        let model = plant(case);
        for entry in case["lp"].as_array().unwrap() {
            let length = entry["L"].as_u64().unwrap() as usize;
            let pre_samples = entry["window"].as_u64().unwrap() as usize - length;
            let nominal = DVector::zeros(model.state_count());
            let options = options(&[length], pre_samples, nominal.clone());
            let designed = design(&model, &[mode(&entry["mode"])], &options).unwrap();
            check_certificates(&designed, &model, &nominal);
            let objective = entry["objective"].as_f64().unwrap();
            if objective == 0.0 {
                assert!(designed.certificates.is_empty(), "{entry}");
                assert_eq!(designed.not_separable.len(), 1);
                assert_eq!(designed.not_separable[0].length, length);
                inseparable += 1;
            } else {
                assert!(
                    (2.0 / designed.floors[0].floor / objective - 1.0).abs() < 1e-6,
                    "{entry}"
                );
                separable += 1;
            }
        }
    }
    assert!(separable >= 10 && inseparable >= 5, "{separable} {inseparable}");
}

#[test]
fn the_same_model_gives_the_same_certificates_to_the_last_bit() {
    let file = reference("battery_bank.json");
    let model = plant(&file["model"]);
    let options = options(&[1, 10], 30, DVector::from_element(model.state_count(), 2.0));
    let modes = enumerate_modes(model.actuator_count(), true, false);
    let text = || {
        let designed = design(&model, &modes, &options).unwrap();
        assert!(designed.certificates.len() >= 9);
        // Shortest decimals that read back as the same number: equal texts are equal bits.
        serde_json::to_string(&designed.certificates).unwrap()
    };
    assert_eq!(text(), text());
}

#[test]
fn modes_and_lengths_that_are_listed_twice_count_once() {
    let options = options(&[1, 3, 1], 0, DVector::zeros(4));
    let designed = design(&aircraft(), &[FaultMode::FAULT_FREE; 2], &options).unwrap();
    let found: Vec<_> = designed
        .certificates
        .iter()
        .map(|c| (c.fault, c.length))
        .collect();
    assert_eq!(found, [(0, 1), (0, 3), (1, 1), (1, 3)]);
}

#[test]
fn what_does_not_fit_the_model_is_refused_and_what_cannot_be_computed_is_listed() {
    let model = aircraft();
    let fault_free = [FaultMode::FAULT_FREE];
    let error = design(&model, &fault_free, &options(&[0], 0, DVector::zeros(4))).unwrap_err();
    assert_eq!(error, FloorError::EmptyWindow);
    let error = design(&model, &fault_free, &options(&[1], 0, DVector::zeros(3))).unwrap_err();
    assert!(matches!(error, FloorError::InvalidVector { expected: 4, .. }));
    let unknown = [FaultMode::from_actuators(&[5]).unwrap()];
    let error = design(&model, &unknown, &options(&[1], 0, DVector::zeros(4))).unwrap_err();
    assert_eq!(
        error,
        FloorError::UnknownActuator {
            actuator: 5,
            count: 2
        }
    );

    let mut file = reference("vtol_design.json")["model"].clone();
    for bound in ["disturbance_bound", "noise_bound"] {
        file[bound] = serde_json::to_value([0.0; 4]).unwrap();
    }
    let exact = plant(&file);
    let designed = design(&exact, &fault_free, &options(&[1], 0, DVector::zeros(4))).unwrap();
    assert!(designed.certificates.is_empty() && designed.failures.len() == 2);
    let unlimited = FailureReason::Floor(FloorError::Unlimited { actuator: 0 });
    assert_eq!(designed.failures[0].reason, unlimited);
}
