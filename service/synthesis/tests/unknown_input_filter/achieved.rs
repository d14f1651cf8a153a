//! What a bank states that it achieves, against the facts of the method sheet.

use crate::reference_files::reference;
use crate::support::{PERIOD_S, aircraft_tables, design, find, tables};
use nalgebra::DVector;
use residual_diagnosis::achieved::Achieved;
use residual_diagnosis::method::MethodOptions;
use residual_diagnosis::model::LinearModel;
use residual_diagnosis::unknown_input_filter::modes::FaultMode;
use residual_synthesis::bounds::NoiseBounds;
use residual_synthesis::unknown_input_filter::floors::{FloorQuestion, solve};

fn sizes(
    achieved: &Achieved,
    pick: fn(&residual_diagnosis::achieved::FaultSensitivity) -> Option<f64>,
) -> Vec<f64> {
    achieved.faults.iter().map(|fault| pick(fault).unwrap()).collect()
}

fn near(found: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(found.len(), expected.len());
    for (found, expected) in found.iter().zip(expected) {
        assert!(
            (found / expected - 1.0).abs() < tolerance,
            "{found} instead of {expected}"
        );
    }
}

#[test]
fn the_delay_curve_of_the_aircraft_is_that_of_the_linear_programs() {
    let achieved = design(&aircraft_tables("")).achieved;
    let curve = |fault: usize| -> Vec<f64> {
        achieved.faults[fault]
            .delays
            .iter()
            .map(|delay| delay.size)
            .collect()
    };
    // Fault-free mode, x = 0: fact 12 and the table of section 6.
    near(&curve(0)[..1], &[1.08492754], 1e-6);
    near(&curve(1)[..1], &[0.80918960], 1e-6);
    near(&curve(0), &[1.085, 0.604, 0.436, 0.388], 2e-3);
    near(&curve(1), &[0.809, 0.463, 0.339, 0.304], 2e-3);
    for (fault, isolable) in achieved.faults.iter().zip([0.80, 0.51]) {
        let delays: Vec<f64> = fault
            .delays
            .iter()
            .map(|delay| delay.within_s / PERIOD_S)
            .collect();
        near(&delays, &[1.0, 3.0, 10.0, 30.0], 1e-12);
        assert_eq!(fault.detectable, fault.delays.last().map(|delay| delay.size));
        assert!((fault.isolable.unwrap() - isolable).abs() < 5e-3 && fault.assurance == 1.0);
    }
}

#[test]
fn one_step_floors_grow_with_the_nominal_state_as_listed() {
    for (state, row_wise, paper) in [
        (0.0, [2.11, 1.34], [2.97, 1.86]),
        (1.0, [2.88, 1.80], [3.78, 2.37]),
        (3.0, [4.35, 2.72], [5.12, 3.19]),
        (10.0, [9.5, 5.9], [10.2, 6.3]),
    ] {
        let rest = format!(
            "nominal_state_magnitude = {:?}\n[bank]\nfault_free_mode = false\n[parity]\nlengths = []",
            [state; 4]
        );
        let s = "S = [[0.01, 0, 0.01, 0], [0, 0.01, 0, 0.01], [0.01, 0, 0.01, 0], [0, 0.01, 0, 0.01]]";
        let forms = [
            (format!("[filter]\n{rest}"), row_wise),
            (
                format!("[filter]\nform = \"paper\"\ntest = \"printed\"\n{s}\n{rest}"),
                paper,
            ),
        ];
        for (further, expected) in forms {
            let achieved = design(&aircraft_tables(&further)).achieved;
            near(&sizes(&achieved, |fault| fault.detectable), &expected, 1.5e-2);
            assert_eq!(achieved.faults[0].detectable, achieved.faults[0].isolable);
            assert_eq!(achieved.faults[0].delays.len(), 1);
        }
    }
}

#[test]
fn sizes_that_hold_for_a_bounded_state_only_say_so() {
    let mut tables = aircraft_tables("[parity]\nlengths = []");
    let conditions = |achieved: Achieved| -> Vec<String> {
        let faults = achieved.faults.into_iter();
        faults.map(|fault| fault.provided_that).collect()
    };
    let uncertain = conditions(design(&tables).achieved);
    assert!(
        uncertain
            .iter()
            .all(|condition| condition.contains("nominal_state_magnitude")),
        "{uncertain:?}"
    );
    tables.model.a_uncertainty = Vec::new();
    assert_eq!(conditions(design(&tables).achieved), ["", ""]);
}

#[test]
fn row_wise_floors_without_uncertainty_are_those_of_fact_14() {
    let mut tables = aircraft_tables(
        "[bank]\nfault_free_mode = false\n[parity]\nlengths = []\n[filter]\n\
         S = [[0.01, 0, 0.01, 0], [0, 0.01, 0, 0.01], [0.01, 0, 0.01, 0], [0, 0.01, 0, 0.01]]",
    );
    tables.model.a_uncertainty = Vec::new();
    let achieved = design(&tables).achieved;
    near(
        &sizes(&achieved, |fault| fault.detectable),
        &[2.106348757, 1.341139868],
        1e-8,
    );
}

#[test]
fn an_s_near_a_left_inverse_of_c_is_warned_of() {
    // C⁻¹ of the aircraft; the floors of fault 1 are those of section 5, the last line but one of its table.
    let inverse = [
        [1.0, 0.0, 0.0, 0.0],
        [0.0, 1.0, 0.0, 0.0],
        [0.0, 0.0, 1.0, 0.0],
        [0.0, -1.0, -1.0, 1.0],
    ];
    let floors = [(0.0, 2.90), (0.4, 3.45), (0.8, 6.0), (0.9, 10.3)].map(|(share, listed)| {
        let mut tables = aircraft_tables(
            "[filter]\nform = \"paper\"\ntest = \"printed\"\n[bank]\nfault_free_mode = false\n",
        );
        tables.model.a_uncertainty = Vec::new();
        tables.filter.s = Some(
            inverse
                .map(|row| row.map(|value| share * value).to_vec())
                .to_vec(),
        );
        let designed = design(&tables);
        let warned = designed
            .warnings
            .iter()
            .any(|warning| warning.contains("`filter.S`"));
        assert_eq!(warned, share > 0.5, "{share}: {:?}", designed.warnings);
        (designed.achieved.faults[0].detectable.unwrap(), listed)
    });
    println!("{floors:?}");
    for (found, listed) in floors {
        assert!((found / listed - 1.0).abs() < 0.02, "{found} instead of {listed}");
    }
}

#[test]
fn blind_rows_are_said_never_to_fire_and_inert_tests_to_be_insensitive() {
    let designed = design(&tables(
        "[model]\nA = [[0.9, 0], [0, 0.9]]\nB = [[1, 0], [0, 1]]\nC = [[1, 0], [0, 1]]\n\
         D = [[1, 0], [0, 1]]\ndisturbance_bound = [1, 1]\nmeasurement_noise_bound = [0.1, 0.1]\n\
         [missing]\npolicy = \"unbounded_fault\"\n[parity]\nlengths = [1]\n\
         [filter]\nfault_of_interest = [2.0, 3.0]\n",
    ));
    let threshold = |channel: &str| {
        let mut all = designed.achieved.thresholds.iter();
        all.find(|threshold| threshold.channel == channel).unwrap()
    };
    for channel in ["mode_0_output_0", "mode_1_output_1"] {
        let threshold = threshold(channel);
        assert!(threshold.never_fires.as_ref().unwrap().contains("blind"));
        assert_eq!(threshold.insensitive, None);
    }
    let sensitive = |channel: &str| {
        let threshold = threshold(channel);
        assert_eq!(threshold.never_fires, None);
        threshold.insensitive.is_none()
    };
    assert!(sensitive("mode_0_output_1"));
    // |r| <= 0.1 + 0.9 * 0.1 + 1: one sample sees fault 0 from 2.38 on.
    for channel in ["mode_1_parity_0_1", "mode_1_output_0"] {
        assert!(!sensitive(channel));
        let reason = threshold(channel).insensitive.as_ref().unwrap();
        assert!(reason.contains("THRESHOLD_INERT"), "{reason}");
    }
    assert!(sensitive("mode_0_parity_1_1"));
    near(&[designed.achieved.faults[0].detectable.unwrap()], &[2.38], 1e-6);
    assert!(
        designed
            .warnings
            .iter()
            .any(|warning| warning.contains("inert threshold: a fault of"))
    );
}

#[test]
fn false_alarms_are_excluded_where_the_sets_are_guaranteed_and_unknown_in_the_baseline() {
    let alarms = |further: &str| design(&aircraft_tables(further)).achieved.false_alarms.unwrap();
    for further in ["[parity]\nlengths = []", "[filter]\nform = \"paper\""] {
        let found = alarms(further);
        assert_eq!(
            (found.probability_per_instant, found.expected_per_hour),
            (Some(0.0), Some(0.0))
        );
    }
    let baseline = "[filter]\nform = \"kalman_3sigma\"\nresidual_norm_threshold = 0.2\n\
                    initial_covariance = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]";
    assert_eq!(alarms(baseline).probability_per_instant, None);
    let designed = design(&aircraft_tables(baseline));
    assert!(designed.achieved.faults.is_empty() && designed.achieved.poles.len() == 3);
}

#[test]
fn the_fixed_gain_of_the_aircraft_forgets_within_one_step() {
    let achieved = design(&aircraft_tables("[parity]\nlengths = []")).achieved;
    assert_eq!(achieved.poles.len(), 3);
    for poles in &achieved.poles {
        assert!(
            poles.values.iter().all(|[re, im]| re.hypot(*im) < 1e-3),
            "{poles:?}"
        );
    }
    // L_fix = C⁻¹: the radius of the set is that of the strip (fact 14).
    let radii = achieved
        .norms
        .iter()
        .filter(|norm| norm.name.starts_with("settled"));
    let radii: Vec<f64> = radii.map(|norm| norm.value).collect();
    assert_eq!(radii.len(), 24);
    for radii in radii.chunks(4) {
        near(radii, &[0.01, 0.01, 0.01, 0.03], 1e-8);
    }
    assert_eq!(achieved.violated(), None);
}

#[test]
fn delayed_isolability_is_that_of_the_first_linear_program_with_a_response() {
    let file = reference("vtol_design.json");
    let cases = file["assumption_cases"].as_array().unwrap();
    for (name, expected) in [("delayed isolability", Some(2)), ("never isolable", None)] {
        let case = cases.iter().find(|case| case["case"] == name).unwrap();
        let list = |key: &str| serde_json::from_value::<Vec<Vec<f64>>>(case[key].clone()).unwrap();
        let mut tables = aircraft_tables("[parity]\nlengths = []");
        tables.model.a = list("A0");
        tables.model.b = list("B");
        tables.model.c = list("C");
        let (nx, ny) = (tables.model.a.len(), tables.model.c.len());
        tables.model.d = Vec::new();
        tables.model.a_uncertainty = Vec::new();
        tables.model.disturbance_bound = Vec::new();
        tables.model.measurement_noise_bound = vec![0.1; ny];
        tables.model.initial_state_center = None;
        tables.model.initial_state_radius = Some(vec![1.0; nx]);
        let achieved = design(&tables).achieved;
        assert_eq!(achieved.isolability.len(), 2);
        let model = LinearModel::new(&tables.model, PERIOD_S).unwrap();
        for (own, pair) in achieved.isolability.iter().enumerate() {
            assert_eq!(pair.instants, expected, "{pair:?}");
            let first = (1..=4 * nx).find(|&length| {
                let question = FloorQuestion {
                    mode: FaultMode::from_actuators(&[own]).unwrap(),
                    actuator: 1 - own,
                    length,
                    pre_samples: 0,
                };
                let nominal = DVector::zeros(nx);
                solve(&model, &NoiseBounds::from(&model), &nominal, question)
                    .unwrap()
                    .is_some()
            });
            assert_eq!(first.map(|length| length as u64), expected);
        }
    }
}

#[test]
fn a_window_without_certificate_is_warned_of_when_gains_are_found() {
    let tables = tables(
        "[model]\nA = [[0.9, 0, 0], [0, 0.9, 0.1], [0, 0, 0]]\nB = [[1, 1], [0, 0], [0, 1]]\n\
         C = [[1, 0, 0], [0, 1, 0]]\nmeasurement_noise_bound = [0.1, 0.1]\ninitial_state_radius = [1, 1, 1]\n\
         [missing]\npolicy = \"unbounded_fault\"\n[parity]\nlengths = [1, 10]\n",
    );
    let found = find(&tables);
    assert_eq!(found.gains.certificates.len(), 6);
    let warned = found
        .warnings
        .iter()
        .filter(|warning| warning.contains("by windows of length 1,"));
    assert_eq!(warned.count(), 2, "{:?}", found.warnings);
    let designed = tables.with_gains(PERIOD_S, &found.gains).unwrap();
    assert!(
        designed
            .achieved
            .isolability
            .iter()
            .all(|pair| pair.instants == Some(2))
    );
    assert!(
        designed
            .warnings
            .iter()
            .any(|warning| warning.contains("2 samples or more"))
    );
}
