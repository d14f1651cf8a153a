//! The scenario files: whole runs, every number.

use crate::fixture::{Instant, Slot, dense, design, file, flat, inputs, instants, rule, run, slots};
use crate::support::{assert_close, integers, numbers, rows};
use residual_diagnosis::async_imm::design::{Form, ModeTransition};
use serde_json::Value;

fn assert_probabilities(what: &str, actual: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(actual.len(), expected.len());
    for (a, e) in actual.iter().zip(expected) {
        assert!((a - e).abs() <= tolerance, "{what}: {a} instead of {e}");
    }
}

/// Compares a run with the expected values at the listed steps, to a part of the tolerances of the reference.
fn assert_run(what: &str, expected: &Value, run: &[Instant], part: f64) {
    let all: Vec<usize> = (1..=run.len()).collect();
    let steps = if expected["step"].is_null() {
        all
    } else {
        integers(&expected["step"])
    };
    let declared = integers(&expected["declared_mode"]);
    for (row, &step) in steps.iter().enumerate() {
        let (what, instant) = (format!("{what} {step}"), &run[step - 1]);
        let list = |key: &str| numbers(&expected[key][row]);
        assert_probabilities(
            &what,
            &instant.probability,
            &list("mode_probability"),
            1e-8 * part,
        );
        for (l, e) in instant.log_likelihood.iter().zip(list("log_likelihood")) {
            assert!((l - e).abs() <= 1e-7 * part * e.abs().max(1.0), "{what}: {l} {e}");
        }
        assert_close(&what, &instant.mean, &list("fused_state"), 1e-7 * part);
        let variance: Vec<f64> = instant.covariance.diagonal().as_slice().to_vec();
        assert_close(&what, &variance, &list("fused_variance"), 1e-7 * part);
        assert_eq!(instant.declared, declared[row], "{what}");
        assert_eq!(
            instant.detected,
            expected["fault_detected"][row].as_bool().unwrap(),
            "{what}"
        );
        let modes: Vec<usize> = instant.amplitudes.iter().map(|estimate| estimate.mode).collect();
        assert_eq!(modes, integers(&expected["amplitude_mode"][row]), "{what}");
        let values: Vec<f64> = instant.amplitudes.iter().map(|estimate| estimate.value).collect();
        assert_close(&what, &values, &list("amplitude"), 1e-7 * part);
        let deviations: Vec<f64> = instant
            .amplitudes
            .iter()
            .map(|estimate| estimate.standard_deviation)
            .collect();
        assert_close(
            &what,
            &deviations,
            &list("amplitude_standard_deviation"),
            1e-7 * part,
        );
        if !expected["mode_state"].is_null() {
            for (mode, mean) in instant
                .posterior
                .modes
                .iter()
                .zip(rows(&expected["mode_state"][row]))
            {
                assert_close(&what, &mode.mean, &mean, 1e-7 * part);
            }
        }
        let covariances = &expected["mode_covariance_at_step"][step.to_string()];
        for (covariance, mode) in instant
            .mode_covariances
            .iter()
            .zip(covariances.as_array().into_iter().flatten())
        {
            assert_close(&what, &flat(covariance), &numbers(mode), 1e-7 * part);
        }
    }
}

/// Runs one case of a file in a form.
fn run_case(file: &Value, case: &str, form: Option<Form>) -> Vec<Instant> {
    let mut design = design(file, case);
    design.form = form.unwrap_or(design.form);
    run(
        &design,
        rule(file, case),
        &slots(file),
        &instants(file),
        &inputs(file),
    )
}

/// A thousandth of the tolerances: agreement of about 1e-13 is expected, 1e-10 demanded.
const PART: f64 = 1e-3;

#[test]
fn the_papers_example_reproduces_in_every_form_and_mixing() {
    let file = file("paper_seed20170.json");
    for case in ["default", "sequential_all", "paper"] {
        assert_run(case, &file["expected"][case], &run_case(&file, case, None), PART);
    }
    for case in ["default", "sequential_all"] {
        let run = run_case(&file, case, Some(Form::SequentialSquareRoot));
        assert_run(case, &file["expected"][case], &run, PART);
    }
}

#[test]
fn the_printed_digits_of_the_papers_example_hold() {
    let file = file("paper_seed20170.json");
    let paper = run_case(&file, "paper", None);
    for (k, expected) in [
        (17, 0.1387320195),
        (18, 0.155338190),
        (19, 0.1658719994),
        (20, 0.6052101380),
    ] {
        assert!((paper[k - 1].probability[2] - expected).abs() < 1e-9);
    }
    let first = |run: &[Instant]| 1 + run.iter().position(|instant| instant.declared == 2).unwrap();
    assert_eq!(first(&paper), 20);
    assert!((paper[39].mean[4] - 2.0424538713).abs() < 1e-9);
    let default = run_case(&file, "default", None);
    assert_eq!(first(&default), 22);
    let estimate = default[39].amplitudes[1];
    assert!((estimate.value - 2.009643150774).abs() < 1e-11);
    assert!((estimate.standard_deviation - 0.034405).abs() < 1e-5);
}

#[test]
fn single_sensors_reproduce_in_the_papers_form() {
    let file = file("paper_seed20170.json");
    for sensor in 0..3 {
        let mut design = design(&file, "paper");
        design.sensors = vec![design.sensors[sensor].clone()];
        let own = slots(&file).into_iter().filter(|slot| slot.sensor == sensor);
        let own: Vec<Slot> = own.map(|slot| Slot { sensor: 0, ..slot }).collect();
        let run = run(
            &design,
            rule(&file, "paper"),
            &own,
            &instants(&file),
            &inputs(&file),
        );
        let expected = &file["expected_single_sensor_paper_form"][format!("sensor {}", sensor + 1)];
        let fused: Vec<f64> = run.iter().map(|instant| instant.mean[4]).collect();
        assert_close("amplitude", &fused, &numbers(&expected["fused_amplitude"]), 1e-10);
        let mu: Vec<f64> = run.iter().map(|instant| instant.probability[2]).collect();
        let expected = numbers(&expected["mode_probability_actuator_2"]);
        assert_probabilities("probability", &mu, &expected, 1e-11);
    }
}

#[test]
fn the_long_run_without_fault_reproduces() {
    let file = file("long_fault_free_run.json");
    for case in ["default", "paper"] {
        assert_run(case, &file["expected"][case], &run_case(&file, case, None), PART);
    }
}

#[test]
fn simultaneous_faults_of_the_vehicle_reproduce_with_transition_rates() {
    let file = file("vehicle_simultaneous_faults.json");
    for form in [Form::Sequential, Form::SequentialSquareRoot] {
        let mut design = design(&file, "default");
        design.form = form;
        design.transition = ModeTransition::Rate(dense(&file["mode_transition_rate_per_second"]));
        let run = run(
            &design,
            rule(&file, "default"),
            &slots(&file),
            &instants(&file),
            &inputs(&file),
        );
        assert_run("vehicle", &file["expected"]["default"], &run, PART);
    }
}

#[test]
fn synchronous_samples_without_loss_give_the_textbook_estimator() {
    let file = file("synchronous_textbook.json");
    let expected = &file["expected"]["textbook"];
    for form in [
        Form::Sequential,
        Form::SequentialSquareRoot,
        Form::BatchUnobserved,
    ] {
        let mut design = design(&file, "textbook");
        design.form = form;
        let run = run(
            &design,
            rule(&file, "textbook"),
            &slots(&file),
            &instants(&file),
            &inputs(&file),
        );
        for (row, instant) in run.iter().enumerate() {
            let mu = numbers(&expected["mode_probability"][row]);
            assert_probabilities("textbook", &instant.probability, &mu, 1e-9);
            assert_close(
                "textbook",
                &instant.mean,
                &numbers(&expected["fused_state"][row]),
                1e-9,
            );
            let covariance = &expected["fused_covariance"][(row + 1).to_string()];
            if !covariance.is_null() {
                assert_close("textbook", &flat(&instant.covariance), &numbers(covariance), 1e-9);
            }
        }
    }
}
