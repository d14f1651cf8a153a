//! Claims of the paper and of the method sheet on the paper's example. Their tolerances cover the sampling error of 500
//! runs on both sides; more runs here leave room for theirs.

use crate::fixture::file;
use crate::simulation::{Ensemble, Plan, paper_design, paper_transition, stay};
use crate::support::numbers;
use residual_diagnosis::async_imm::design::{Form, Mixing};
use serde_json::Value;
use std::sync::LazyLock;

const RUNS: usize = 2000;
const ALL: [usize; 3] = [0, 1, 2];

/// Theorem 1 with the paper's Λ.
static PAPER: LazyLock<Ensemble> = LazyLock::new(|| paper(&ALL, RUNS));

fn paper(sensors: &[usize], runs: usize) -> Ensemble {
    let design = paper_design(Form::BatchUnobserved, Mixing::All, paper_transition());
    Ensemble::new(&design, sensors, Plan::paper(runs))
}

fn default(probability: f64, runs: usize) -> Ensemble {
    let design = paper_design(Form::Sequential, Mixing::SharedChannel, stay(probability));
    Ensemble::new(&design, &ALL, Plan::paper(runs))
}

/// The target of this name: value ± tolerance.
fn assert_target(what: &str, actual: f64, target: &Value) {
    let [value, tolerance] = numbers(target)[..] else {
        panic!("{what}: {target}")
    };
    assert!(
        (actual - value).abs() <= tolerance,
        "{what}: {actual}, expected {value} ± {tolerance}"
    );
}

fn assert_position(ensemble: &Ensemble, target: &Value) {
    let position = |seen: &crate::simulation::Seen| seen.position;
    assert_target(
        "before",
        ensemble.root_mean(10..=16, position),
        &target["position_before"],
    );
    assert_target("peak", ensemble.peak(17..=24, position), &target["position_peak"]);
    assert_target(
        "steady",
        ensemble.root_mean(31..=40, position),
        &target["position_steady"],
    );
}

fn assert_decisions(ensemble: &Ensemble, target: &Value) {
    for (kind, of) in [("delay_s", true), ("false_alarm_runs", false)] {
        for (name, expected) in target[kind].as_object().unwrap() {
            let (threshold, window) = name.split_once(", window ").unwrap();
            let threshold = threshold.strip_prefix("threshold ").unwrap().parse().unwrap();
            let found = ensemble.decisions(2, threshold, window.parse().unwrap());
            assert_target(
                &format!("{kind} {name}"),
                if of { found.delay } else { found.false_alarm_runs },
                expected,
            );
            assert_eq!(found.missed, 0);
        }
    }
}

#[test]
fn the_default_meets_its_statistical_targets() {
    let target = &file("statistical_targets.json")["targets"][0];
    let ensemble = default(0.999, RUNS);
    assert_position(&ensemble, target);
    assert_decisions(&ensemble, target);
    let error = |seen: &crate::simulation::Seen| seen.amplitude[2].0 - 2.0;
    let rmse = ensemble.root_mean(31..=40, |seen| error(seen).powi(2));
    assert_target("amplitude", rmse, &target["amplitude_rmse_mode_2_steady"]);
    let mean = |of: &dyn Fn(&crate::simulation::Seen) -> f64| {
        (31..=40).map(|k| ensemble.mean(k, of)).sum::<f64>() / 10.0
    };
    assert_target("bias", mean(&error), &target["amplitude_bias_mode_2_steady"]);
    assert_target(
        "sigma",
        mean(&|seen| seen.amplitude[2].1),
        &target["mean_sigma_mode_2_steady"],
    );
    for sigmas in 1..=3 {
        let inside = |seen: &crate::simulation::Seen| {
            f64::from(u8::from(error(seen).abs() <= sigmas as f64 * seen.amplitude[2].1))
        };
        let expected = &target["coverage_1_2_3_sigma_steady"][sigmas - 1];
        assert_target(&format!("within {sigmas} sigma"), mean(&inside), expected);
    }
    let mode_0 = ensemble.mean(16, |seen| seen.probability[0]);
    assert_target("normal", mode_0, &target["mean_mode_0_probability_step_16"]);
    let mode_2 = ensemble.mean(40, |seen| seen.probability[2]);
    assert_target("actuator 2", mode_2, &target["mean_mode_2_probability_step_40"]);
}

#[test]
fn a_stay_probability_of_99_percent_meets_its_statistical_targets() {
    let target = &file("statistical_targets.json")["targets"][1];
    let ensemble = default(0.99, RUNS);
    assert_position(&ensemble, target);
    assert_decisions(&ensemble, target);
}

#[test]
fn known_losses_beat_unknown_ones() {
    let targets = &file("statistical_targets.json")["targets"];
    let design = paper_design(Form::Sequential, Mixing::All, paper_transition());
    let known = Ensemble::new(&design, &ALL, Plan::paper(RUNS));
    assert_position(&known, &targets[2]);
    assert_decisions(&known, &targets[2]);
    // Paired with Theorem 1: the same samples.
    let position = |seen: &crate::simulation::Seen| seen.position;
    for steps in [10..=16, 17..=24, 31..=40] {
        let ratio = known.root_mean(steps.clone(), position) / PAPER.root_mean(steps.clone(), position);
        assert!((0.8..0.95).contains(&ratio), "{steps:?}: {ratio}");
    }
    let gain = known.decisions(2, 0.5, 1).delay - PAPER.decisions(2, 0.5, 1).delay;
    assert!((gain + 0.34).abs() < 0.12, "{gain}");
}

#[test]
fn theorem_1_meets_its_statistical_targets() {
    let target = &file("statistical_targets.json")["targets"][3];
    assert_position(&PAPER, target);
    assert_decisions(&PAPER, target);
}

#[test]
fn the_probability_of_the_faulty_mode_crosses_one_half_at_21_and_settles_below_1() {
    let mu = |k: usize| PAPER.mean(k, |seen| seen.probability[2]);
    assert!(mu(20) < 0.5 && mu(21) > 0.5, "{} {}", mu(20), mu(21));
    let settled = (31..=40).map(mu).sum::<f64>() / 10.0;
    assert!((settled - 0.81).abs() < 0.05, "{settled}");
    assert!(PAPER.mean(24, |seen| seen.probability[0]) < PAPER.mean(16, |seen| seen.probability[0]));
}

#[test]
fn the_fused_amplitude_converges_to_the_fault() {
    let target = &file("statistical_targets.json")["targets"][3];
    let rmse = PAPER.root_mean(31..=40, |seen| (seen.fused_amplitude - 2.0).powi(2));
    assert_target("fused amplitude", rmse, &target["fused_amplitude_rmse_steady"]);
}

#[test]
fn fusing_beats_each_sensor_in_position_speed_and_fault_but_not_in_the_amplitude_before_the_fault() {
    let target = &file("statistical_targets.json")["targets"][4];
    let singles: Vec<Ensemble> = (0..3).map(|sensor| paper(&[sensor], RUNS)).collect();
    let ordered = [&*PAPER, &singles[0], &singles[1], &singles[2]];
    for (sensor, single) in singles.iter().enumerate() {
        let name = format!("sensor {}", sensor + 1);
        let position = |seen: &crate::simulation::Seen| seen.position;
        assert_target(
            &name,
            single.root_mean(31..=40, position),
            &target["position_steady"][&name],
        );
        assert_target(
            &name,
            single.peak(17..=24, position),
            &target["position_peak"][&name],
        );
        let amplitude = single.root_mean(31..=40, |seen| (seen.fused_amplitude - 2.0).powi(2));
        assert_target(&name, amplitude, &target["fused_amplitude_rmse_steady"][&name]);
        assert_target(
            &name,
            single.decisions(2, 0.5, 1).delay,
            &target["delay_s"][&name],
        );
    }
    for pair in ordered.windows(2) {
        for k in 2..=40 {
            let worse = |of: fn(&crate::simulation::Seen) -> f64| pair[0].mean(k, of) < pair[1].mean(k, of);
            assert!(worse(|seen| seen.position), "position at {k}");
            assert!(worse(|seen| seen.position + seen.velocity), "state at {k}");
        }
        let steady = |of: &Ensemble| of.root_mean(31..=40, |seen| (seen.fused_amplitude - 2.0).powi(2));
        assert!(steady(pair[0]) < steady(pair[1]));
    }
    // Refuted: before the fault the first two sensors do not differ (.373 against .368).
    let before = |of: &Ensemble| of.root_mean(10..=16, |seen| seen.fused_amplitude.powi(2));
    let (one, two) = (before(&singles[0]), before(&singles[1]));
    assert!((one / two - 1.0).abs() < 0.12, "{one} {two}");
}

#[test]
fn the_amplitude_need_not_be_known() {
    for (amplitude, delay) in [(-2.0, 4.1), (1.0, 5.9), (2.0, 4.3), (5.0, 3.1), (10.0, 2.4)] {
        let design = paper_design(Form::BatchUnobserved, Mixing::All, paper_transition());
        let plan = Plan {
            fault: [0.0, amplitude],
            ..Plan::paper(200)
        };
        let found = Ensemble::new(&design, &ALL, plan).decisions(2, 0.5, 1);
        assert!(
            (found.delay - delay).abs() < 0.4 && found.missed <= 2,
            "{amplitude}: {found:?}"
        );
    }
}

#[test]
fn a_single_mode_is_calibrated() {
    let mut design = paper_design(Form::Sequential, Mixing::SharedChannel, stay(1.0));
    design.modes.truncate(1);
    design.prior.mode_probability = vec![1.0];
    let plan = Plan {
        fault: [0.0; 2],
        ..Plan::paper(1000)
    };
    let ensemble = Ensemble::new(&design, &ALL, plan);
    let mean = (1..=40)
        .map(|k| ensemble.mean(k, |seen| seen.normalised))
        .sum::<f64>()
        / 40.0;
    assert!((mean - 4.0).abs() < 0.15, "{mean}");
}
