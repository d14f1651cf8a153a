//! The battery loop (C not of full column rank, single and pair modes) against the reference `battery_bank`.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod support;

use residual_diagnosis::{
    diagnoser::{StepRecord, Verdict},
    model::LinearModel,
    unknown_input_filter::{
        UnknownInputFilterBank, decision::minimal_survivors, gains::UnknownInputFilterGains,
    },
};
use serde_json::Value;
use support::*;

const TOLERANCE: f64 = 1e-9;

/// The bank of the reference; `publish = "all"` does not fit one record with pairs, so that the modes of the bank
/// are checked in two parts.
fn battery_bank(file: &Value, pairs: bool) -> UnknownInputFilterBank {
    let mut options = options(
        r#"
        bank = { fault_free_mode = false, clear_samples = 0, reset = "copy" }
        filter = { initialisation = "prior", outward_rounding = false, generator_order = 30 }
        missing = { policy = "unbounded_fault" }
        "#,
    );
    options.filter.nominal_state_magnitude = Some(vec![2.0; 5]);
    options.parity.certificates = Some(certificates(file));
    if pairs {
        options.bank.simultaneous_faults = vec![1, 2];
        options.filter.publish = residual_diagnosis::unknown_input_filter::options::Publish::Worst;
    }
    let model = LinearModel::new(&battery(), 0.01).unwrap();
    let mut gains = UnknownInputFilterGains::find(&model, &options).unwrap();
    let reference = rows_of_fixed_gains(file);
    for (mode, fixed) in gains.modes.iter_mut().zip(reference) {
        mode.fixed = Some(fixed);
    }
    UnknownInputFilterBank::with_gains(model, &options, &gains).unwrap()
}

fn rows_of_fixed_gains(file: &Value) -> Vec<Vec<Vec<f64>>> {
    let gains = file["fixed_gain"].as_array().unwrap();
    gains
        .iter()
        .map(|gain| numbers(gain).chunks(4).map(<[f64]>::to_vec).collect())
        .collect()
}

fn modes(file: &Value) -> Vec<String> {
    let modes = file["modes"].as_array().unwrap().iter();
    modes
        .map(|mode| {
            integers(mode)
                .iter()
                .map(usize::to_string)
                .collect::<Vec<_>>()
                .join("_")
        })
        .collect()
}

/// The channels of a mode in the order of the reference: projector rows, then matched rows.
fn row_names(mode: &str) -> Vec<String> {
    let others = (0..3)
        .map(|j| j.to_string())
        .filter(|j| !mode.split('_').any(|own| own == j));
    let rows = (0..4)
        .map(|j| format!("output_{j}"))
        .chain(others.map(|j| format!("matched_{j}")));
    rows.map(|row| format!("mode_{mode}_{row}")).collect()
}

/// Runs a scenario; entry k is the instant k.
fn run(
    bank: &mut UnknownInputFilterBank,
    scenario: &Value,
    mut look: impl FnMut(&UnknownInputFilterBank, usize, StepRecord),
) {
    let (y, u) = (rows(&scenario["y"]), rows(&scenario["u"]));
    step(bank, &[0.0; 4], &u[0]);
    for k in 1..=y.len() {
        let record = step(bank, &y[k - 1], u.get(k).unwrap_or(&u[0]));
        look(bank, k, record);
    }
}

#[test]
fn rows_parity_tests_and_sets_agree_until_the_first_alarm() {
    let file = reference("battery_bank.json");
    for scenario in file["scenarios"].as_array().unwrap() {
        let checkpoints = scenario["expected"]["checkpoints"].as_array().unwrap();
        let first_alarm = integers(&scenario["expected"]["alarms_time_mode"][0])[0];
        let (mut checked, mut windows) = (0, 0);
        run(&mut battery_bank(&file, false), scenario, |bank, k, record| {
            let Some(expected) = checkpoints
                .iter()
                .find(|point| point["k"] == k && k <= first_alarm)
            else {
                return;
            };
            checked += 1;
            for (i, mode) in modes(&file).iter().enumerate().take(3) {
                let names = row_names(mode);
                let values = names.iter().map(|name| residual_and_width(bank, &record, name));
                let found: (Vec<f64>, Vec<f64>) = values.unzip();
                let what = format!("mode {mode} at {k}");
                assert_close(&what, &found.1, &numbers(&expected["half_width"][i]), TOLERANCE);
                assert_close(&what, &found.0, &numbers(&expected["residual"][i]), TOLERANCE);
                for parity in expected["parity"][i].as_array().unwrap() {
                    windows += 1;
                    let name = format!("mode_{mode}_parity_{}_10", parity["fault"]);
                    let (residual, half_width) = residual_and_width(bank, &record, &name);
                    let listed = ["residual", "half_width"].map(|field| parity[field].as_f64().unwrap());
                    assert_close(&name, &[residual, half_width], &listed, TOLERANCE);
                }
            }
        });
        assert!(checked > 8 && windows >= 12);
    }
}

#[test]
fn alarms_decisions_and_reset_sets_of_single_and_pair_modes_agree() {
    let file = reference("battery_bank.json");
    for scenario in file["scenarios"].as_array().unwrap() {
        let expected = &scenario["expected"];
        let checkpoints = expected["checkpoints"].as_array().unwrap();
        let mut alarms = Vec::new();
        let mut decisions: Vec<(usize, Verdict, Vec<Vec<usize>>)> = Vec::new();
        run(&mut battery_bank(&file, true), scenario, |bank, k, record| {
            for (i, mode) in modes(&file).iter().enumerate() {
                if channel(bank, &record, &format!("mode_{mode}_worst")).ratio > 1.0 {
                    alarms.push(vec![k, i]);
                }
            }
            let minimal = minimal_survivors(bank.modes(), bank.falsified())
                .map(Vec::from)
                .collect::<Vec<_>>();
            if decisions.last().is_none_or(|last| last.2 != minimal) {
                decisions.push((k, record.verdict(), minimal));
            }
            let Some(point) = checkpoints.iter().find(|point| point["k"] == k) else {
                return;
            };
            for i in 0..6 {
                let (centre, radius) = bank.state_set(i).unwrap();
                let what = format!("mode {i} at {k}");
                assert_close(&what, &centre, &numbers(&point["centre"][i]), TOLERANCE);
                assert_close(&what, &radius, &numbers(&point["radius"][i]), TOLERANCE);
            }
        });
        let listed: Vec<Vec<usize>> = expected["alarms_time_mode"]
            .as_array()
            .unwrap()
            .iter()
            .map(integers)
            .collect();
        assert_eq!(alarms, listed);
        for (found, listed) in decisions
            .iter()
            .zip(expected["decision_changes"].as_array().unwrap())
        {
            assert_eq!(found.0 as u64, listed[0]);
            let verdict = if listed[1] == "none" {
                Verdict::Nominal
            } else {
                Verdict::Isolated
            };
            assert_eq!(found.1, verdict);
            let minimal: Vec<Vec<usize>> = listed[2].as_array().unwrap().iter().map(integers).collect();
            if verdict == Verdict::Isolated {
                assert_eq!(found.2, minimal);
            }
        }
        assert_eq!(
            decisions.len(),
            expected["decision_changes"].as_array().unwrap().len()
        );
    }
}
