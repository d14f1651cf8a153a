//! The assumption cases of the reference, and each warning on a plant that deserves it.

use super::*;
use crate::model::ModelOptions;
use crate::unknown_input_filter::modes::enumerate_modes;
use serde_json::Value;

const VTOL: &str = include_str!("../../../tests/reference/unknown_input_filter/vtol_design.json");
const BATTERY: &str = include_str!("../../../tests/reference/unknown_input_filter/battery_bank.json");

type Rows = Vec<Vec<f64>>;

fn plant(a: Rows, b: Rows, c: Rows) -> LinearModel {
    let measurement_noise_bound = vec![0.1; c.len()];
    LinearModel::new(
        &ModelOptions {
            a,
            b,
            c,
            measurement_noise_bound,
            ..ModelOptions::default()
        },
        1.0,
    )
    .unwrap()
}

fn identity(n: usize) -> Rows {
    (0..n)
        .map(|i| (0..n).map(|j| f64::from(u8::from(i == j))).collect())
        .collect()
}

fn entry<T: serde::de::DeserializeOwned>(value: &Value, key: &str) -> T {
    serde_json::from_value(value[key].clone()).unwrap()
}

fn reference_plant(text: &str) -> LinearModel {
    let model = serde_json::from_str::<Value>(text).unwrap()["model"].clone();
    plant(entry(&model, "A0"), entry(&model, "B"), entry(&model, "C"))
}

fn case(name: &str) -> Value {
    let reference: Value = serde_json::from_str(VTOL).unwrap();
    let cases = reference["assumption_cases"].as_array().unwrap();
    cases.iter().find(|case| case["case"] == name).unwrap().clone()
}

fn check(model: &LinearModel, pairs: bool) -> Result<CheckReport, CheckError> {
    let modes = enumerate_modes(model.actuator_count(), true, pairs);
    check_modes(model, &UnknownInputFilterOptions::default(), &modes)
}

fn mode(actuators: &[usize]) -> FaultMode {
    FaultMode::from_actuators(actuators).unwrap()
}

#[test]
fn the_reference_plants_pass_without_a_warning() {
    let reference: Value = serde_json::from_str(VTOL).unwrap();
    let report = check(&reference_plant(VTOL), false).unwrap();
    assert_eq!(report.testable, [true; 3]);
    assert_eq!(report.warnings, []);
    let sigma_min = reference["isolability_sigma_min"].as_f64().unwrap();
    assert_eq!(report.isolability.len(), 2);
    for pair in &report.isolability {
        assert!(
            pair.samples == Some(1) && (pair.sigma_min - sigma_min).abs() < 1e-12,
            "{pair:?}"
        );
    }
    let battery = check(&reference_plant(BATTERY), true).unwrap();
    assert_eq!(battery.warnings, []);
    assert_eq!(battery.isolability.len(), 3 * 2 + 3);
}

#[test]
fn the_refusals_of_the_reference_carry_their_names() {
    for name in ["fault not visible", "no test row", "dependent fault columns"] {
        let case = case(name);
        let b: Rows = entry(&case, "F");
        let model = plant(identity(b.len()), b, entry(&case, "C"));
        let all: Vec<usize> = (0..model.actuator_count()).collect();
        let options = UnknownInputFilterOptions::default();
        let error = check_modes(&model, &options, &[mode(&all)]).unwrap_err();
        let found = format!("{error:?}");
        let expected = case["error"].as_str().unwrap();
        assert!(found.starts_with(expected), "{found} instead of {expected}");
        assert!(!error.key().is_empty());

        let mut allowing = UnknownInputFilterOptions::default();
        allowing.bank.allow_untestable_modes = true;
        let report = check_modes(&model, &allowing, &[mode(&all)]).unwrap();
        assert_eq!(report.testable, [false]);
        assert!(matches!(report.warnings[0], CheckWarning::UntestableMode { .. }));
    }
}

#[test]
fn an_s_that_inverts_c_makes_the_test_vacuous() {
    let model = reference_plant(VTOL);
    let strip = model.strip_gain().unwrap();
    let scaled = |factor: f64| -> UnknownInputFilterOptions {
        let mut options = UnknownInputFilterOptions::default();
        options.filter.form = Form::Paper;
        options.filter.s = Some(
            (0..4)
                .map(|i| (0..4).map(|j| factor * strip[(i, j)]).collect())
                .collect(),
        );
        options
    };
    let modes = enumerate_modes(2, true, false);
    let error = check_modes(&model, &scaled(1.0), &modes).unwrap_err();
    assert!(matches!(error, CheckError::VacuousTest { .. }) && error.key() == "filter.S");
    assert!(check_modes(&model, &scaled(0.99), &modes).is_ok());
}

/// `IsolableAfter` or `NotIsolable` must agree with every objective of the reference that belongs to L = n.
#[test]
fn delayed_isolability_agrees_with_the_linear_programs_of_the_reference() {
    let mut compared = 0;
    for name in ["delayed isolability", "never isolable"] {
        let case = case(name);
        let model = plant(entry(&case, "A0"), entry(&case, "B"), entry(&case, "C"));
        for program in case["lp"].as_array().unwrap() {
            let (window, length): (usize, usize) = (entry(program, "window"), entry(program, "L"));
            let own: Vec<usize> = entry(program, "mode");
            let found = isolability::first_separating_window(&model, mode(&own), 1 - own[0], window);
            if window == length {
                assert_eq!(
                    found.is_some(),
                    program["objective"].as_f64().unwrap() > 1e-9,
                    "{program}"
                );
                compared += 1;
            }
        }
        let report = check(&model, false).unwrap();
        assert_eq!(report.isolability[0].sigma_min, 0.0);
        let delayed = name == "delayed isolability";
        assert!(report.warnings.iter().all(|warning| match warning {
            CheckWarning::IsolableAfter { length, .. } => delayed && *length == 2,
            CheckWarning::NotIsolable { longest, .. } => !delayed && *longest == 12,
            other => panic!("{other:?}"),
        }));
        assert_eq!(report.warnings.len(), 2);
    }
    assert_eq!(compared, 11);
}

#[test]
fn a_chain_of_states_delays_isolation_by_its_length() {
    for chain in 1..=6 {
        // Actuator 1 is actuator 0 and, through a chain of states, an output that actuator 0 never reaches.
        let nx = chain + 2;
        let mut a: Rows = vec![vec![0.0; nx]; nx];
        (1..=chain).for_each(|i| a[i][i + 1] = 0.1);
        a[0][0] = 0.9;
        let mut b = vec![vec![0.0, 0.0]; nx];
        b[0] = vec![1.0, 1.0];
        b[nx - 1][1] = 1.0;
        let mut c = vec![vec![0.0; nx]; 2];
        c[0][0] = 1.0;
        c[1][1] = 1.0;
        let model = plant(a, b, c);
        let found = isolability::first_separating_window(&model, mode(&[0]), 1, 4 * nx);
        assert_eq!(found, Some(chain + 1));
    }
}

#[test]
fn a_growing_state_that_no_test_sees_is_reported() {
    let cut_off = |pole: f64| {
        let mut reference: Value = serde_json::from_str(BATTERY).unwrap();
        let a0 = &mut reference["model"]["A0"];
        for (i, j) in [(0, 1), (1, 0), (1, 2), (2, 1)] {
            a0[i][j] = 0.0.into();
        }
        a0[1][1] = pole.into();
        let model = plant(
            entry(&reference["model"], "A0"),
            entry(&reference["model"], "B"),
            entry(&reference["model"], "C"),
        );
        check(&model, false).unwrap().warnings
    };
    assert_eq!(cut_off(0.99), []);
    let warnings = cut_off(1.01);
    assert_eq!(warnings.len(), 4);
    for warning in warnings {
        let CheckWarning::UnboundedSet { real, imaginary, .. } = warning else {
            panic!("{warning:?}")
        };
        assert!((real - 1.01).abs() < 1e-9 && imaginary.abs() < 1e-9);
        assert!(warning.to_string().contains("grows"));
    }
}

#[test]
fn an_unseen_oscillation_is_reported_once() {
    let rotation = 0.3_f64;
    let (sine, cosine) = rotation.sin_cos();
    let a = vec![
        vec![0.5, 0.0, 0.0],
        vec![0.0, cosine, sine],
        vec![0.0, -sine, cosine],
    ];
    let model = plant(
        a,
        vec![vec![1.0], vec![0.0], vec![0.0]],
        vec![vec![1.0, 0.0, 0.0]; 2],
    );
    let warnings = check(&model, false).unwrap().warnings;
    assert_eq!(warnings.len(), 2);
    let CheckWarning::UnboundedSet { real, imaginary, .. } = warnings[0] else {
        panic!()
    };
    assert!((real - cosine).abs() < 1e-9 && (imaginary - sine).abs() < 1e-9);
}

#[test]
fn eigenvalues_of_a_cyclic_shift_do_not_stall_the_check() {
    let nx = 6;
    let a: Rows = (0..nx)
        .map(|i| (0..nx).map(|j| f64::from(u8::from((i + 1) % nx == j))).collect())
        .collect();
    let mut b = vec![vec![0.0]; nx];
    b[0][0] = 1.0;
    let model = plant(a, b, identity(nx));
    assert_eq!(check(&model, false).unwrap().warnings, []);
}

#[test]
fn a_loss_without_a_way_back_is_announced() {
    let mut options = UnknownInputFilterOptions::default();
    options.missing.policy = MissingPolicy::UnboundedFault;
    let modes = enumerate_modes(3, true, false);
    let battery = check_modes(&reference_plant(BATTERY), &options, &modes).unwrap();
    assert_eq!(
        battery.warnings,
        [CheckWarning::LossNotRecoverable { form: Form::Coupled }]
    );
    assert_eq!(battery.warnings[0].key(), "missing.policy");
    let vtol = check_modes(&reference_plant(VTOL), &options, &modes[..3]).unwrap();
    assert_eq!(vtol.warnings, []);
}
