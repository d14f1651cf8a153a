//! `unit_vectors.json`: one step at a time.

use crate::fixture::{dense, file, flat};
use crate::support::{assert_close, integers, numbers, rows};
use nalgebra::DMatrix;
use residual_diagnosis::async_imm::{
    checks::{amplitude_gap, detectability_gap},
    decision::{DecisionRule, DecisionState},
    design::{Form, ImmDesign, Mixing, Mode, ModeTransition, Prior, Sensor},
    estimator::{ImmEstimator, Sample},
    fusion::Fusion,
    inputs::InputHistory,
    mixing::Mixer,
    plant::{LinearPlant, Plant},
    probability::update_probability,
    state::ModeState,
    transition::{TransitionTable, equal_rate},
};
use residual_diagnosis::matrix::Matrix;
use serde_json::Value;

/// A design without dynamics for tests of single steps.
fn still(directions: &[DMatrix<f64>], states: usize, slots: usize) -> ImmDesign {
    let channels = directions[0].nrows();
    let modes = directions.iter().enumerate().map(|(m, direction)| Mode {
        name: format!("mode {m}"),
        direction: direction.clone(),
        random_walk_psd: vec![0.0; slots],
    });
    let mut f = DMatrix::zeros(states, channels);
    (0..channels).for_each(|c| f[(c, c)] = 1.0);
    ImmDesign {
        plant: Plant::Constant(LinearPlant {
            a: DMatrix::zeros(states, states),
            b: DMatrix::zeros(states, 0),
            f,
            noise: DMatrix::zeros(states, states),
        }),
        sensors: vec![Sensor {
            name: "all".to_owned(),
            measurement_matrix: DMatrix::identity(states, states),
            noise_covariance: DMatrix::identity(states, states),
            arrival_probability: 1.0,
            initial_held_value: None,
        }],
        modes: modes.collect(),
        prior: Prior {
            state: vec![0.0; states],
            state_covariance: DMatrix::identity(states, states),
            amplitude: vec![0.0; slots],
            amplitude_covariance: DMatrix::identity(slots, slots),
            mode_probability: vec![1.0 / directions.len() as f64; directions.len()],
        },
        transition: ModeTransition::PerStep(DMatrix::identity(directions.len(), directions.len())),
        form: Form::Sequential,
        mixing: Mixing::All,
    }
}

#[test]
fn transition_matrices_follow_from_stay_probabilities_and_rates() {
    let file = file("unit_vectors.json");
    for case in file["mode_transition"].as_array().unwrap() {
        let interval = (case["interval_s"].as_f64().unwrap() * 1e6).round() as i64;
        let expected = numbers(&case["matrix"]);
        let (transition, modes) = if case["generator_per_second"].is_null() {
            let modes = case["modes"].as_u64().unwrap() as usize;
            let probability = case["stay_probability"].as_f64().unwrap();
            let period_s = case["stay_period_s"].as_f64().unwrap();
            let rate = equal_rate(probability, period_s, modes);
            let expected = case["rate_to_each_other_mode_per_second"].as_f64().unwrap();
            assert!((rate / expected - 1.0).abs() < 1e-12);
            let equal = ModeTransition::Stay {
                probability,
                period_s,
            };
            // The same rates as a matrix go through the table.
            let gamma = DMatrix::from_fn(modes, modes, |i, j| if i == j { 0.0 } else { rate });
            let gamma = &gamma - DMatrix::identity(modes, modes) * (rate * (modes - 1) as f64);
            let mut table = TransitionTable::new(&ModeTransition::Rate(gamma), modes);
            assert_close(
                "rates",
                &flat(&table.over(interval).to_dense()),
                &numbers(&case["matrix"]),
                1e-13,
            );
            (equal, modes)
        } else {
            let gamma = dense(&case["generator_per_second"]);
            let modes = gamma.nrows();
            (ModeTransition::Rate(gamma), modes)
        };
        let mut table = TransitionTable::new(&transition, modes);
        assert_close(
            "matrix",
            &flat(&table.over(interval).to_dense()),
            &expected,
            1e-13,
        );
    }
}

fn mixed(case: &Value, mixing: Mixing, form: Form) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    let directions: Vec<_> = case["directions"].as_array().unwrap().iter().map(dense).collect();
    let states = case["state_dimension"].as_u64().unwrap() as usize;
    let mut design = still(&directions, states, directions[0].ncols());
    (design.mixing, design.form) = (mixing, form);
    design.prior.amplitude = numbers(&case["amplitude_prior_mean"]);
    design.prior.amplitude_covariance = dense(&case["amplitude_prior_covariance"]);
    let means = rows(&case["mode_state"]);
    let covariances = case["mode_covariance"].as_array().unwrap().iter().map(dense);
    let from: Vec<ModeState> = means
        .into_iter()
        .zip(covariances)
        .map(|(mean, covariance)| ModeState {
            mean,
            spread: Matrix::from(&match form {
                Form::SequentialSquareRoot => covariance.cholesky().unwrap().l(),
                _ => covariance,
            }),
        })
        .collect();
    let logarithm = |value: &f64| value.ln();
    let log_mu: Vec<f64> = numbers(&case["mode_probability"]).iter().map(logarithm).collect();
    let log_lambda = Matrix::from(&dense(&case["mode_transition_matrix"]).map(f64::ln));
    let (mut to, mut log_c) = (from.clone(), vec![0.0; from.len()]);
    Mixer::new(&design).mix(&from, &log_mu, &log_lambda, &mut to, &mut log_c);
    let covariance = |mode: &ModeState| match form {
        Form::SequentialSquareRoot => flat(&(mode.spread.to_dense() * mode.spread.to_dense().transpose())),
        _ => flat(&mode.spread.to_dense()),
    };
    (
        log_c.iter().map(|log| log.exp()).collect(),
        to.iter().flat_map(|mode| mode.mean.clone()).collect(),
        to.iter().flat_map(covariance).collect(),
    )
}

#[test]
fn mixing_carries_amplitudes_between_all_modes_or_only_along_shared_channels() {
    for case in file("unit_vectors.json")["mixing"].as_array().unwrap() {
        for (mixing, key) in [
            (Mixing::All, "expected_all"),
            (Mixing::SharedChannel, "expected_shared_channel"),
        ] {
            for form in [Form::Sequential, Form::SequentialSquareRoot] {
                let (c, means, covariances) = mixed(case, mixing, form);
                let expected = &case[key];
                assert_close(key, &c, &numbers(&expected["predicted_mode_probability"]), 1e-13);
                assert_close(key, &means, &numbers(&expected["mixed_state"]), 1e-13);
                assert_close(key, &covariances, &numbers(&expected["mixed_covariance"]), 1e-13);
            }
        }
    }
}

#[test]
fn one_sample_updates_state_covariance_and_likelihood() {
    let case = &file("unit_vectors.json")["measurement_update"];
    let (covariance, expected) = (dense(&case["covariance"]), &case["expected"]);
    for form in [Form::Sequential, Form::SequentialSquareRoot] {
        let mut design = still(&[DMatrix::zeros(1, 1), DMatrix::identity(1, 1)], 4, 1);
        design.form = form;
        let h = dense(&case["measurement_matrix_augmented"])
            .columns(0, 4)
            .into_owned();
        design.plant = Plant::Constant(LinearPlant {
            // Without process noise and with all of its inputs in the last state nothing moves over 0 s.
            a: DMatrix::from_fn(4, 4, |i, j| if i == j { -1.0 } else { 0.0 }),
            b: DMatrix::zeros(4, 0),
            f: DMatrix::from_row_slice(4, 1, &[1.0, 0.0, 0.0, 0.0]),
            noise: DMatrix::zeros(4, 4),
        });
        design.sensors[0].measurement_matrix = h;
        design.sensors[0].noise_covariance = dense(&case["noise_covariance"]);
        let mut estimator = ImmEstimator::new(&design, 1).unwrap();
        let mut posterior = estimator.start(0);
        for mode in &mut posterior.modes {
            mode.mean = numbers(&case["state"]);
            mode.spread = Matrix::from(&match form {
                Form::SequentialSquareRoot => covariance.clone().cholesky().unwrap().l(),
                _ => covariance.clone(),
            });
        }
        let values = numbers(&case["measurement"]);
        let sample = Sample {
            time_ns: 100,
            sensor: 0,
            values: &values,
            held_before: None,
        };
        // Less than half a microsecond: no time for the plant.
        let report = estimator.advance(
            &mut posterior,
            100,
            [sample].into_iter(),
            &InputHistory::new(&[], 0),
        );
        assert_eq!(report.used, 1);
        let covariance = Fusion::new(&design).mode_covariance(&posterior, 1).unwrap();
        assert_close(
            "state",
            &posterior.modes[1].mean,
            &numbers(&expected["state"]),
            1e-13,
        );
        assert_close(
            "covariance",
            &flat(&covariance.to_dense()),
            &numbers(&expected["covariance"]),
            1e-13,
        );
        let log_likelihood = [expected["log_likelihood"].as_f64().unwrap()];
        assert_close(
            "log likelihood",
            &estimator.log_likelihood()[1..],
            &log_likelihood,
            1e-13,
        );
    }
}

/// The design, the prediction and the samples of the unit vector of Theorem 1.
fn theorem_1() -> (ImmDesign, Value) {
    let units = file("unit_vectors.json");
    let paper = file("paper_seed20170.json");
    let mut design = crate::fixture::design(&paper, "paper");
    design.transition = ModeTransition::PerStep(DMatrix::identity(3, 3));
    (design, units["batch_unobserved_update"].clone())
}

#[test]
fn theorem_1_gives_the_reference_matrices_and_estimate() {
    let (mut design, case) = theorem_1();
    let expected = &case["expected"];
    let times = integers(&case["sample_time_us"]);
    let sensors = integers(&case["sample_sensor"]);
    let end = case["fusion_time_us"].as_i64().unwrap();
    // The prediction of the vector belongs to t_k; a plant at rest in front of it carries it there unchanged.
    let begin = times[0] as i64 - 1;
    let Plant::Constant(plant) = &design.plant else {
        panic!()
    };
    let mode = 2;
    let mut propagator =
        residual_diagnosis::async_imm::propagator::Propagator::of_plant(&design.plant, false);
    let commands = InputHistory::new(&[0.5, 0.5], 0);
    propagator.go(begin, end, &commands);
    let interval = propagator.interval();
    let mut phi = DMatrix::identity(5, 5);
    phi.view_mut((0, 0), (4, 4)).copy_from(&interval.phi.to_dense());
    let xi = interval.gain.to_dense().columns(1, 2) * &design.modes[mode].direction;
    phi.view_mut((0, 4), (4, 1)).copy_from(&xi);
    let mut input = nalgebra::DVector::zeros(5);
    (0..4).for_each(|i| input[i] = interval.gain[(i, 0)]);
    let mut omega = DMatrix::zeros(5, 5);
    omega
        .view_mut((0, 0), (4, 4))
        .copy_from(&interval.omega.to_dense());
    let inverse = phi.try_inverse().unwrap();
    let predicted = nalgebra::DVector::from_vec(numbers(&case["predicted_state"]));
    let covariance = &inverse * (dense(&case["predicted_covariance"]) - omega) * inverse.transpose();
    assert_eq!(plant.a.nrows(), 4);
    for (sensor, beta) in design.sensors.iter_mut().zip([0.9, 0.8, 0.8]) {
        sensor.arrival_probability = beta;
    }
    let mut estimator = ImmEstimator::new(&design, 5).unwrap();
    let mut posterior = estimator.start(begin * 1000);
    posterior.log_probability = vec![f64::NEG_INFINITY, f64::NEG_INFINITY, 0.0];
    for state in &mut posterior.modes {
        state.mean = (&inverse * (&predicted - &input)).as_slice().to_vec();
        state.spread = Matrix::from(&((&covariance + covariance.transpose()) / 2.0));
    }
    let (received, before) = (
        numbers(&case["received_or_held"]),
        numbers(&case["previous_held"]),
    );
    let samples = (0..5).map(|i| Sample {
        time_ns: times[i] as i64 * 1000,
        sensor: sensors[i],
        values: &received[2 * i..2 * i + 2],
        held_before: Some(&before[2 * i..2 * i + 2]),
    });
    let report = estimator.advance(&mut posterior, end * 1000, samples, &commands);
    assert_eq!((report.used, report.update_rejected), (5, 0));
    let terms = estimator.batch().unwrap().terms();
    let psi = terms.psi.rows(0, 4).into_owned();
    for (what, actual, key, tolerance) in [
        ("H̄", flat(&terms.h_bar), "equivalent_measurement_matrix", 1e-12),
        ("ū", terms.u_bar.clone(), "equivalent_input_term", 1e-12),
        ("R̄", flat(&terms.r_bar), "equivalent_noise_covariance", 1e-11),
        ("Ψ", flat(&psi), "process_cross_covariance", 1e-11),
        ("C", flat(&terms.c), "C", 1e-11),
        ("Γ", flat(&terms.gain), "Gamma", 1e-11),
        ("e", terms.e.clone(), "innovation", 1e-11),
        ("x", posterior.modes[mode].mean.clone(), "state", 1e-10),
        (
            "P",
            flat(&posterior.modes[mode].spread.to_dense()),
            "covariance",
            1e-10,
        ),
    ] {
        assert_close(what, &actual, &numbers(&expected[key]), tolerance);
    }
    assert!((estimator.log_likelihood()[mode] + 44.903425976406).abs() < 1e-10);
}

#[test]
fn equivalent_measurements_are_the_sensors_seen_from_the_fusion_instant() {
    let (design, case) = theorem_1();
    let Plant::Constant(plant) = &design.plant else {
        panic!()
    };
    let times = integers(&case["sample_time_us"]);
    let end = case["fusion_time_us"].as_i64().unwrap();
    let h_bar = dense(&case["expected"]["equivalent_measurement_matrix"]);
    for (i, time) in times.into_iter().enumerate() {
        let augmented = plant.augmented(&design.modes[2].direction, &[0.0]);
        let interval =
            residual_diagnosis::async_imm::exact::discretise(&augmented, (end - time as i64) as f64 * 1e-6);
        let inverse = interval.phi.to_dense().try_inverse().unwrap();
        let mut h = DMatrix::zeros(2, 5);
        (h[(0, 0)], h[(1, 2)]) = (1.0, 1.0);
        let difference = h * inverse - h_bar.rows(2 * i, 2);
        assert!(difference.amax() < 1e-12, "{difference}");
    }
}

#[test]
fn probabilities_are_updated_without_underflow() {
    for case in file("unit_vectors.json")["mode_probability_update"]
        .as_array()
        .unwrap()
    {
        let log_c: Vec<f64> = numbers(&case["predicted_mode_probability"])
            .iter()
            .map(|c| c.ln())
            .collect();
        let likelihood = numbers(&case["log_likelihood"]);
        let (mut room, mut log_mu) = (log_c.clone(), log_c.clone());
        assert!(!update_probability(&log_c, &likelihood, &mut room, &mut log_mu));
        let mu: Vec<f64> = log_mu.iter().map(|log| log.exp()).collect();
        for (mu, expected) in mu.iter().zip(numbers(&case["expected"])) {
            assert!(
                (mu - expected).abs() <= 1e-12 * expected.max(1e-12),
                "{mu} {expected}"
            );
        }
    }
}

#[test]
fn without_a_finite_likelihood_the_predicted_probabilities_stay() {
    let log_c = [0.7_f64.ln(), 0.3_f64.ln()];
    let (mut room, mut log_mu) = ([0.0; 2], [0.0; 2]);
    assert!(update_probability(
        &log_c,
        &[f64::NEG_INFINITY, f64::NAN],
        &mut room,
        &mut log_mu
    ));
    assert_eq!(log_mu, log_c);
}

#[test]
fn the_decision_needs_a_mode_above_the_threshold_for_the_whole_window() {
    let case = &file("unit_vectors.json")["decision"];
    for expected in case["expected"].as_array().unwrap() {
        let rule = DecisionRule {
            threshold: expected["decision_threshold"].as_f64().unwrap(),
            window_steps: expected["window_steps"].as_u64().unwrap() as u32,
        };
        let mut state = DecisionState::default();
        let (mut declared, mut detected) = (Vec::new(), Vec::new());
        for mu in rows(&case["mode_probability"]) {
            rule.update(&mut state, &mu);
            declared.push(rule.declared_mode(&state));
            detected.push(rule.fault_detected(&state));
            assert!(detected[detected.len() - 1] || declared[declared.len() - 1] == 0);
        }
        assert_eq!(declared, integers(&expected["declared_mode"]));
        let expected = expected["fault_detected"].as_array().unwrap().iter();
        assert_eq!(
            detected,
            expected.map(|value| value.as_bool().unwrap()).collect::<Vec<_>>()
        );
    }
}

#[test]
fn the_design_tests_find_the_reference_singular_values() {
    for case in file("unit_vectors.json")["design_tests"].as_array().unwrap() {
        let (a, h) = (dense(&case["A"]), dense(&case["stacked_measurement_matrix"]));
        let (_, gap) = detectability_gap(&a, &h).unwrap().unwrap();
        let expected = case["detectability_smallest_singular_value"].as_f64().unwrap();
        assert!((gap.smallest - expected).abs() < 1e-12, "{case}");
        let gap = amplitude_gap(&a, &h, &dense(&case["channel_directions"]));
        let expected = case["channels_smallest_singular_value"].as_f64().unwrap();
        assert!((gap.smallest - expected).abs() < 1e-12, "{case} {gap:?}");
    }
}

#[test]
fn an_empty_interval_moves_probabilities_along_the_transition_matrix() {
    let paper = file("paper_seed20170.json");
    let design = crate::fixture::design(&paper, "paper");
    let mut estimator = ImmEstimator::new(&design, 1).unwrap();
    let mut posterior = estimator.start(0);
    posterior.log_probability = [0.7_f64, 0.1, 0.2].map(f64::ln).to_vec();
    let report = estimator.advance(
        &mut posterior,
        1_000_000_000,
        std::iter::empty(),
        &InputHistory::new(&[0.5, 0.5], 0),
    );
    assert_eq!(report.used, 0);
    for (log, expected) in posterior.log_probability.iter().zip([0.645, 0.135, 0.22]) {
        assert!((log.exp() - expected).abs() < 1e-12);
    }
}
