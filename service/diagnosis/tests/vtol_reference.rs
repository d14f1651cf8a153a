//! The aircraft example in the default form against the reference files `vtol_case1` and `vtol_case2`.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod support;

use residual_diagnosis::{diagnoser::Verdict, unknown_input_filter::UnknownInputFilterBank};
use serde_json::Value;
use support::*;

const TOLERANCE: f64 = 1e-9;

const OPTIONS: &str = r#"
    bank = { fault_free_mode = FAULT_FREE, reset = "none", clear_samples = 0 }
    filter = { initialisation = "prior", outward_rounding = false }
    missing = { policy = "unbounded_fault" }
"#;

fn default_bank(fault_free: bool, with_certificates: bool) -> UnknownInputFilterBank {
    let design = reference("vtol_design.json");
    let mut options = options(&OPTIONS.replace("FAULT_FREE", &fault_free.to_string()));
    options.filter.s = Some(rows(&design["model"]["S"]));
    if with_certificates {
        options.parity.certificates = Some(certificates(&design));
    }
    bank(&vtol(), &options)
}

fn check_rows(case: &Value, section: &str, prefixes: &[&str], names: &[&str]) {
    let section = &case[section];
    let mut bank = default_bank(true, false);
    let y = rows(&case["y"]);
    step(&mut bank, &y[0], &[0.0, 0.0]);
    let listed = integers(&section["k"]);
    for (k, y) in y.iter().enumerate().skip(1) {
        let record = step(&mut bank, y, &[0.0, 0.0]);
        let Some(position) = listed.iter().position(|listed| *listed == k) else {
            continue;
        };
        let mut found = (Vec::new(), Vec::new());
        for prefix in prefixes {
            for name in names {
                let matched = ["matched_0", "matched_1"]
                    .iter()
                    .find(|row| *name == "matched" && bank.description_has(&format!("{prefix}_{row}")));
                let name = format!("{prefix}_{}", matched.unwrap_or(name));
                let (residual, half_width) = residual_and_width(&bank, &record, &name);
                found.0.push(residual);
                found.1.push(half_width);
            }
        }
        assert_close(
            &format!("residual at {k}"),
            &found.0,
            &numbers(&section["residual"][position]),
            TOLERANCE,
        );
        assert_close(
            &format!("half width at {k}"),
            &found.1,
            &numbers(&section["half_width"][position]),
            TOLERANCE,
        );
    }
}

trait HasChannel {
    fn description_has(&self, name: &str) -> bool;
}

impl HasChannel for UnknownInputFilterBank {
    fn description_has(&self, name: &str) -> bool {
        use residual_diagnosis::diagnoser::Diagnoser;
        self.description()
            .channels
            .iter()
            .any(|channel| channel.name == name)
    }
}

const OUTPUTS: [&str; 4] = ["output_0", "output_1", "output_2", "output_3"];

#[test]
fn residuals_and_half_widths_of_the_single_modes_agree() {
    for file in ["vtol_case1.json", "vtol_case2.json"] {
        let names = [OUTPUTS.as_slice(), &["matched"]].concat();
        check_rows(&reference(file), "default", &["mode_0", "mode_1"], &names);
    }
}

#[test]
fn residuals_and_half_widths_of_the_fault_free_mode_agree() {
    for file in ["vtol_case1.json", "vtol_case2.json"] {
        let names = [OUTPUTS.as_slice(), &["matched_0", "matched_1"]].concat();
        check_rows(&reference(file), "fault_free_mode", &["mode_fault_free"], &names);
    }
}

#[test]
fn fault_estimates_and_parity_tests_agree() {
    for file in ["vtol_case1.json", "vtol_case2.json"] {
        let case = reference(file);
        let section = &case["default"];
        let mut bank = default_bank(false, true);
        let y = rows(&case["y"]);
        // The windows of the reference start at y[1]: the strip bound, not y[0], bounds the state there.
        step(&mut bank, &y[0], &[0.0, 0.0]);
        let listed = integers(&section["k"]);
        for (k, y) in y.iter().enumerate().skip(1) {
            let record = step(&mut bank, y, &[0.0, 0.0]);
            let Some(position) = listed.iter().position(|listed| *listed == k) else {
                continue;
            };
            let (mut centre, mut radius) = (Vec::new(), Vec::new());
            for mode in 0..2 {
                let estimate = channel(&bank, &record, &format!("mode_{mode}_fault_estimate_{mode}"));
                centre.push(estimate.residual);
                radius.push((estimate.upper - estimate.lower) / 2.0);
                let expected = [&section["parity_residual"], &section["parity_half_width"]]
                    .map(|field| numbers(&field[position][mode]));
                for (i, length) in [1, 3, 10, 30].iter().enumerate() {
                    if expected[0][i].is_nan() {
                        continue;
                    }
                    let name = format!("mode_{mode}_parity_{}_{length}", 1 - mode);
                    let (residual, half_width) = residual_and_width(&bank, &record, &name);
                    assert_close(
                        &name,
                        &[residual, half_width],
                        &[expected[0][i], expected[1][i]],
                        TOLERANCE,
                    );
                }
            }
            assert_close(
                "estimate",
                &centre,
                &numbers(&section["fault_estimate"][position]),
                TOLERANCE,
            );
            assert_close(
                "radius",
                &radius,
                &numbers(&section["fault_estimate_radius"][position]),
                TOLERANCE,
            );
        }
    }
}

#[test]
fn alarms_and_decisions_agree() {
    for file in ["vtol_case1.json", "vtol_case2.json"] {
        let case = reference(file);
        let mut bank = default_bank(true, true);
        let mut without_fault_free = default_bank(false, true);
        let y = rows(&case["y"]);
        step(&mut bank, &y[0], &[0.0, 0.0]);
        step(&mut without_fault_free, &y[0], &[0.0, 0.0]);
        let mut alarms = vec![Vec::new(); 5];
        let mut decisions = Vec::new();
        for (k, y) in y.iter().enumerate().skip(1) {
            let record = step(&mut bank, y, &[0.0, 0.0]);
            let single = step(&mut without_fault_free, y, &[0.0, 0.0]);
            for (i, prefix) in ["mode_0", "mode_1"].iter().enumerate() {
                let names = alarming_channels(&bank, &record, prefix);
                let parity = names.iter().filter(|name| name.contains("parity")).count();
                if names.len() > parity {
                    alarms[i].push(k);
                }
                if parity > 0 {
                    alarms[2 + i].push(k);
                }
            }
            if !alarming_channels(&bank, &record, "mode_fault_free").is_empty() {
                alarms[4].push(k);
            }
            decisions.push((k, single.verdict(), single.certainly_faulty));
        }
        let mut expected: Vec<Value> = case["default"]["own_alarms_first_last_count"]
            .as_array()
            .unwrap()
            .clone();
        expected.extend(
            case["default"]["parity_alarms_first_last_count"]
                .as_array()
                .unwrap()
                .clone(),
        );
        expected.push(case["fault_free_mode"]["alarms_first_last_count"].clone());
        for (found, expected) in alarms.iter().zip(expected) {
            let found = found
                .first()
                .map(|first| vec![*first, found[found.len() - 1], found.len()]);
            assert_eq!(found, expected.as_array().map(|_| integers(&expected)), "{file}");
        }
        decisions.dedup_by_key(|(_, verdict, faulty)| (*verdict, *faulty));
        let isolated = integers(&case["default"]["decision_changes"][1][2][0])[0];
        assert_eq!(
            decisions,
            [(1, Verdict::Nominal, 0), (102, Verdict::Isolated, 1 << isolated)],
            "{file}"
        );
    }
}
