//! Missing samples, resets and two faults in turn against the reference `vtol_loss_reset`.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod support;

use residual_diagnosis::diagnoser::Verdict;
use serde_json::Value;
use support::*;

const TOLERANCE: f64 = 1e-9;

fn check(policy_name: &str, policy_options: &str) {
    let file = reference("vtol_loss_reset.json");
    let policies = file["policies"].as_array().unwrap();
    let expected = policies
        .iter()
        .find(|policy| policy["name"] == policy_name)
        .unwrap();
    let options = options(&format!(
        r#"
        bank = {{ fault_free_mode = false, clear_samples = 15 }}
        filter = {{ initialisation = "prior", outward_rounding = false }}
        missing = {policy_options}
        "#
    ));
    let mut bank = bank(&vtol(), &options);
    let (y, u) = (rows(&file["y"]), rows(&file["u"]));
    step(&mut bank, &[0.0; 4], &u[0]);
    let checkpoints = expected["checkpoints"].as_array().unwrap();
    let changes = expected["decision_changes"].as_array().unwrap();
    let mut decision: Option<&Value> = None;
    for (entry, y) in y.iter().enumerate() {
        let record = step(&mut bank, y, u.get(entry + 1).unwrap_or(&u[0]));
        let k = entry + 1;
        let mut worst = Vec::new();
        let mut tested = Vec::new();
        let mut alarm = Vec::new();
        for mode in 0..2 {
            let names = (0..4)
                .map(|j| format!("output_{j}"))
                .chain([format!("matched_{}", 1 - mode)]);
            let channels: Vec<_> = names
                .map(|name| channel(&bank, &record, &format!("mode_{mode}_{name}")))
                .filter(|channel| channel.is_evaluated())
                .collect();
            tested.push(usize::from(!channels.is_empty()));
            alarm.push(usize::from(channels.iter().any(|channel| channel.ratio > 1.0)));
            worst.push(
                channels
                    .iter()
                    .fold(f64::NAN, |most, channel| most.max(channel.ratio)),
            );
        }
        assert_eq!(tested, integers(&expected["tested"][entry]), "tested at {k}");
        assert_eq!(alarm, integers(&expected["alarm"][entry]), "alarm at {k}");
        let falsified: Vec<usize> = bank.falsified().iter().map(|flag| usize::from(*flag)).collect();
        assert_eq!(
            falsified,
            integers(&expected["falsified"][entry]),
            "falsified at {k}"
        );
        let ratios = numbers(&expected["worst_ratio"][entry]);
        for (found, listed) in worst.iter().zip(&ratios).filter(|(found, _)| !found.is_nan()) {
            assert_close(&format!("ratio at {k}"), &[*found], &[*listed], TOLERANCE);
        }
        if let Some(point) = checkpoints.iter().find(|point| point["k"] == k) {
            for mode in 0..2 {
                let void = point["void"][mode] == 1;
                let set = bank.state_set(mode);
                assert_eq!(set.is_none(), void, "void at {k}");
                let Some((centre, radius)) = set else { continue };
                let finite = |values: &[f64]| -> Vec<f64> {
                    values
                        .iter()
                        .map(|value| if value.is_finite() { *value } else { f64::NAN })
                        .collect()
                };
                assert_close(
                    &format!("radius at {k}"),
                    &finite(&radius),
                    &numbers(&point["radius"][mode]),
                    TOLERANCE,
                );
                if radius.iter().all(|value| value.is_finite()) {
                    assert_close(
                        &format!("centre at {k}"),
                        &centre,
                        &numbers(&point["centre"][mode]),
                        TOLERANCE,
                    );
                }
            }
        }
        decision = changes.iter().find(|change| change[0] == k).or(decision);
        match decision.unwrap()[1].as_str().unwrap() {
            "isolated" => {
                let isolated = integers(&decision.unwrap()[2][0])[0];
                assert_eq!(
                    (record.verdict(), record.certainly_faulty),
                    (Verdict::Isolated, 1 << isolated)
                );
            }
            _ if tested == [0, 0] => assert_eq!(record.verdict(), Verdict::NotEvaluated),
            _ => assert_eq!(record.verdict(), Verdict::Nominal),
        }
    }
}

#[test]
fn bounded_faults_bridge_losses_as_listed() {
    check(
        "bounded",
        "{ policy = \"bounded_fault\", fault_bound = [3.0, 3.0] }",
    );
}

#[test]
fn unbounded_faults_bridge_losses_as_listed() {
    check("unbounded", "{ policy = \"unbounded_fault\" }");
}
