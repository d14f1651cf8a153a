//! The paper's form and the Kalman-type baseline against the reference files and the paper's figures.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod support;

use residual_diagnosis::{
    diagnoser::{StepRecord, Verdict},
    model::ModelOptions,
    unknown_input_filter::UnknownInputFilterBank,
};
use serde_json::Value;
use support::*;

const TOLERANCE: f64 = 1e-9;

fn paper_bank(model: &ModelOptions, s: Option<Vec<Vec<f64>>>, test: &str) -> UnknownInputFilterBank {
    let mut options = options(&format!(
        r#"
        bank = {{ fault_free_mode = false, reset = "none" }}
        filter = {{ form = "paper", initialisation = "prior", test = "{test}" }}
        "#
    ));
    options.filter.s = s;
    bank(model, &options)
}

fn vtol_paper_bank(test: &str) -> UnknownInputFilterBank {
    let s = rows(&reference("vtol_design.json")["model"]["S"]);
    paper_bank(&vtol(), Some(s), test)
}

/// Residuals and half widths of all outputs, mode by mode.
fn output_rows(bank: &UnknownInputFilterBank, record: &StepRecord, outputs: usize) -> (Vec<f64>, Vec<f64>) {
    let modes = bank.modes().to_vec();
    let names = modes
        .iter()
        .flat_map(|mode| (0..outputs).map(|j| format!("mode_{}_output_{j}", mode.label())));
    names.map(|name| residual_and_width(bank, record, &name)).unzip()
}

/// \[k, mode, output\] of all alarms at this instant.
fn alarms(bank: &UnknownInputFilterBank, record: &StepRecord, k: usize) -> Vec<Vec<usize>> {
    let mut out = Vec::new();
    for mode in 0..bank.modes().len() {
        for name in alarming_channels(
            bank,
            record,
            &format!("mode_{}_output", bank.modes()[mode].label()),
        ) {
            out.push(vec![k, mode, name.rsplit('_').next().unwrap().parse().unwrap()]);
        }
    }
    out
}

#[test]
fn every_residual_half_width_and_alarm_of_both_cases_agrees() {
    for (file, isolated) in [("vtol_case1.json", 0), ("vtol_case2.json", 1)] {
        let case = reference(file);
        let mut bank = vtol_paper_bank("printed");
        let mut found = Vec::new();
        let mut last = None;
        for (k, y) in rows(&case["y"]).iter().enumerate() {
            let record = step(&mut bank, y, &[0.0, 0.0]);
            if k == 0 {
                continue;
            }
            let (residual, half_width) = output_rows(&bank, &record, 4);
            assert_close(
                &format!("residual {k}"),
                &residual,
                &numbers(&case["paper"]["residual"][k - 1]),
                TOLERANCE,
            );
            let expected = numbers(&case["paper"]["half_width"][k - 1]);
            assert_close(&format!("half width {k}"), &half_width, &expected, TOLERANCE);
            found.extend(alarms(&bank, &record, k));
            last = Some((record.verdict(), record.certainly_faulty));
        }
        let expected: Vec<Vec<usize>> = case["paper"]["alarms"]
            .as_array()
            .unwrap()
            .iter()
            .map(integers)
            .collect();
        assert_eq!(found, expected);
        assert_eq!(last, Some((Verdict::Isolated, 1 << isolated)));
    }
}

#[test]
fn mean_half_widths_are_those_of_fact_13() {
    let case = reference("vtol_case1.json");
    let mut bank = vtol_paper_bank("printed");
    let mut sum = vec![0.0; 8];
    for (k, y) in rows(&case["y"]).iter().enumerate() {
        let record = step(&mut bank, y, &[0.0, 0.0]);
        if (21..=100).contains(&k) {
            let (_, half_width) = output_rows(&bank, &record, 4);
            sum.iter_mut()
                .zip(half_width)
                .for_each(|(sum, h)| *sum += h / 80.0);
        }
    }
    let fact = [
        0.0450707768,
        0.0674645569,
        0.0482084853,
        0.068467152,
        0.0418569815,
        0.0465714482,
        0.0694218867,
        0.0752073799,
    ];
    for (found, expected) in sum.iter().zip(fact) {
        assert!((found - expected).abs() < 1e-9, "{found} instead of {expected}");
    }
    assert_close(
        "mean",
        &sum,
        &numbers(&case["paper"]["mean_half_width_k21_100"]),
        TOLERANCE,
    );
}

#[test]
fn the_printed_test_is_wider_by_the_noise_counted_twice() {
    let file = reference("vtol_variants.json");
    let expected = numbers(&file["printed_minus_tight_half_width"]);
    let mut banks = [vtol_paper_bank("printed"), vtol_paper_bank("tight")];
    for (k, y) in rows(&reference("vtol_case1.json")["y"])
        .iter()
        .enumerate()
        .take(40)
    {
        let widths = banks.each_mut().map(|bank| {
            let record = step(bank, y, &[0.0, 0.0]);
            output_rows(bank, &record, 4).1
        });
        if k > 0 {
            let difference: Vec<f64> = widths[0].iter().zip(&widths[1]).map(|(a, b)| a - b).collect();
            for (found, expected) in difference.iter().zip(&expected) {
                assert!(
                    (found - expected).abs() <= 4.0 * f64::EPSILON,
                    "{found} instead of {expected}"
                );
            }
        }
    }
}

#[test]
fn the_battery_in_the_papers_form_agrees_until_the_last_checkpoint() {
    let file = reference("battery_bank.json");
    for scenario in file["scenarios"].as_array().unwrap() {
        let section = &scenario["paper_mode_single"];
        let mut bank = paper_bank(&battery(), None, "printed");
        let (y, u) = (rows(&scenario["y"]), rows(&scenario["u"]));
        step(&mut bank, &[0.0; 4], &u[0]);
        let expected: Vec<Vec<usize>> = section["alarms_time_mode_output"]
            .as_array()
            .unwrap()
            .iter()
            .map(integers)
            .collect();
        let last = expected[expected.len() - 1][0];
        let mut found = Vec::new();
        for k in 1..=y.len() {
            let record = step(&mut bank, &y[k - 1], u.get(k).unwrap_or(&u[0]));
            if k <= last {
                found.extend(alarms(&bank, &record, k));
            }
            for point in section["checkpoints"]
                .as_array()
                .unwrap()
                .iter()
                .filter(|point| point["k"] == k)
            {
                let (residual, half_width) = output_rows(&bank, &record, 4);
                assert_close(
                    &format!("residual {k}"),
                    &residual,
                    &numbers(&point["residual"]),
                    TOLERANCE,
                );
                assert_close(
                    &format!("half width {k}"),
                    &half_width,
                    &numbers(&point["half_width"]),
                    TOLERANCE,
                );
            }
        }
        assert_eq!(found, expected);
    }
}

#[test]
fn scaling_by_a_power_of_two_scales_every_bound_bit_for_bit() {
    let y = rows(&reference("vtol_case1.json")["y"]);
    let run = |factor: f64| {
        let scale = |list: &[f64]| -> Vec<f64> { list.iter().map(|value| value * factor).collect() };
        let mut model = vtol();
        model.disturbance_bound = scale(&model.disturbance_bound);
        model.measurement_noise_bound = scale(&model.measurement_noise_bound);
        model.initial_state_center = Some(vec![0.25 * factor; 4]);
        model.initial_state_radius = Some(vec![factor; 4]);
        let s = rows(&reference("vtol_design.json")["model"]["S"]);
        let mut bank = paper_bank(&model, Some(s), "printed");
        let mut seen = Vec::new();
        for y in y.iter().take(80) {
            let record = step(&mut bank, &scale(y), &scale(&[0.3, -0.2]));
            let (residual, half_width) = output_rows(&bank, &record, 4);
            seen.extend(residual.iter().zip(half_width).flat_map(|(r, h)| [-h - r, h - r]));
        }
        seen
    };
    let plain = run(1.0);
    for exponent in [-20, 3, 11] {
        let factor = 2.0_f64.powi(exponent);
        assert!(
            run(factor)
                .iter()
                .zip(&plain)
                .all(|(scaled, value)| *scaled == value * factor)
        );
    }
}

/// The fault-free measurements with the disturbance (49) of the paper: .001 in all states, .004 from k = 200 on.
fn fault_free_simulation(baseline: &Value) -> Vec<Vec<f64>> {
    let design = reference("vtol_design.json");
    let [a, c] = ["A0", "C"].map(|name| rows(&design["model"][name]));
    let product = |m: &[Vec<f64>], x: &[f64]| -> Vec<f64> {
        m.iter()
            .map(|row| row.iter().zip(x).map(|(a, b)| a * b).sum())
            .collect()
    };
    let mut x = numbers(&baseline["x0"]);
    let mut y = vec![product(&c, &x)];
    for k in 0..400 {
        let d = if k < 200 { 0.001 } else { 0.004 };
        x = product(&a, &x).iter().map(|x| x + d).collect();
        y.push(product(&c, &x));
    }
    y
}

fn baseline_bank(file: &Value) -> UnknownInputFilterBank {
    let mut options = options(
        r#"
        bank = { fault_free_mode = false, reset = "none", clear_samples = 0 }
        filter = { form = "kalman_3sigma", residual_norm_threshold = 0.2 }
        "#,
    );
    options.filter.initial_covariance = Some(rows(&file["P0"]));
    options.filter.s = Some(rows(&reference("vtol_design.json")["model"]["S"]));
    let mut model = vtol();
    model.initial_state_center = Some(numbers(&file["x0"]));
    bank(&model, &options)
}

#[test]
fn a_changed_disturbance_moves_the_baseline_but_not_the_zonotopes() {
    let file = reference("baseline.json");
    let expected = &file["no_fault_equation_49_noise_free"];
    let y = fault_free_simulation(&file);
    assert_close("simulation", &y[400], &numbers(&expected["y_final"]), TOLERANCE);
    let (mut baseline, mut zonotope) = (baseline_bank(&file), vtol_paper_bank("printed"));
    let mut norms = [[0.0; 2]; 2];
    let (mut widths, mut count) = (vec![0.0; 8], 0);
    for (k, y) in y.iter().enumerate() {
        let record = step(&mut baseline, y, &[0.0, 0.0]);
        for (mode, norms) in norms.iter_mut().enumerate() {
            let norm = channel(&baseline, &record, &format!("mode_{mode}_norm")).residual;
            match k {
                21..200 => norms[0] += norm / 179.0,
                205.. => norms[1] += norm / 196.0,
                _ => {}
            }
        }
        let record = step(&mut zonotope, y, &[0.0, 0.0]);
        count += usize::from(alarm_now(&record));
        if (21..=100).contains(&k) {
            let half_widths = output_rows(&zonotope, &record, 4).1;
            widths
                .iter_mut()
                .zip(half_widths)
                .for_each(|(sum, h)| *sum += h / 80.0);
        }
    }
    for (found, filter) in norms.iter().zip(expected["filters"].as_array().unwrap()) {
        let listed =
            [&filter["mean_norm_k21_199"], &filter["mean_norm_k205_400"]].map(|v| v.as_f64().unwrap());
        assert_close("norms", found, &listed, TOLERANCE);
        assert_close(
            "ratio",
            &[found[1] / found[0]],
            &[filter["ratio"].as_f64().unwrap()],
            TOLERANCE,
        );
    }
    assert_eq!(
        count as u64,
        expected["zonotope_paper_mode"]["alarms"].as_u64().unwrap()
    );
    let listed = numbers(&expected["zonotope_paper_mode"]["mean_half_width_k21_100"]);
    assert_close("half widths", &widths, &listed, TOLERANCE);
}

#[test]
fn innovations_of_the_baseline_agree() {
    let file = reference("baseline.json");
    let case = reference("vtol_case2.json");
    let mut bank = baseline_bank(&file);
    let listed = integers(&file["case2"]["k"]);
    let mut norms = [[0.0; 2]; 2];
    for (k, y) in rows(&case["y"]).iter().enumerate() {
        let record = step(&mut bank, y, &[0.0, 0.0]);
        for mode in 0..2 {
            let names = (0..4).map(|j| format!("mode_{mode}_output_{j}"));
            let innovation: Vec<f64> = names
                .map(|name| residual_and_width(&bank, &record, &name).0)
                .collect();
            let norm = channel(&bank, &record, &format!("mode_{mode}_norm")).residual;
            if (21..=100).contains(&k) {
                norms[0][mode] += norm / 80.0;
            } else if (106..=120).contains(&k) {
                norms[1][mode] += norm / 15.0;
            }
            if let Some(position) = listed.iter().position(|listed| *listed == k) {
                let expected = numbers(&file["case2"]["innovation"][mode][position]);
                assert_close(
                    &format!("innovation {mode} at {k}"),
                    &innovation,
                    &expected,
                    TOLERANCE,
                );
            }
        }
    }
    assert_close(
        "before",
        &norms[0],
        &numbers(&file["case2"]["mean_norm_k21_100"]),
        TOLERANCE,
    );
    assert_close(
        "after",
        &norms[1],
        &numbers(&file["case2"]["mean_norm_k106_120"]),
        TOLERANCE,
    );
}
