//! Every refusal of a model names the entry that is wrong.

use super::*;

fn options() -> ModelOptions {
    ModelOptions {
        a: vec![vec![0.9, 0.1], vec![0.0, 0.8]],
        b: vec![vec![1.0], vec![0.5]],
        c: vec![vec![1.0, 0.0], vec![0.0, 1.0], vec![1.0, 1.0]],
        d: vec![vec![1.0], vec![1.0]],
        a_uncertainty: vec![vec![0.01, 0.0], vec![0.0, 0.02]],
        disturbance_bound: vec![0.1],
        measurement_noise_bound: vec![0.01, 0.02, 0.03],
        ..ModelOptions::default()
    }
}

fn refusal(change: impl FnOnce(&mut ModelOptions)) -> (String, ModelError) {
    let mut options = options();
    change(&mut options);
    let error = LinearModel::new(&options, 0.1).unwrap_err();
    (error.key(), error)
}

#[test]
fn a_valid_model_keeps_its_numbers_and_gets_default_names() {
    let model = LinearModel::new(&options(), 0.1).unwrap();
    assert_eq!((model.state_count(), model.actuator_count()), (2, 1));
    assert_eq!((model.output_count(), model.disturbance_count()), (3, 1));
    assert_eq!(model.a0()[(0, 1)], 0.1);
    assert_eq!(model.a_plus()[(1, 1)], 0.02);
    assert_eq!(model.actuators()[0].name, "actuator_0");
    assert_eq!(model.outputs()[2].name, "output_2");
    let gain = model.strip_gain().unwrap();
    assert!((gain * model.c() - DMatrix::identity(2, 2)).amax() < 1e-14);
}

#[test]
fn every_wrong_entry_is_named() {
    type Change = fn(&mut ModelOptions);
    let cases: [(&str, Change); 18] = [
        ("model.A", |o| o.a.clear()),
        ("model.A", |o| o.a[1].push(0.0)),
        ("model.A", |o| o.a.push(vec![0.0, 0.0])),
        ("model.B", |o| o.b.push(vec![0.0])),
        ("model.B", |o| o.b[1][0] = f64::NAN),
        ("model.C", |o| o.c = vec![vec![1.0]]),
        ("model.C", |o| o.c.clear()),
        ("model.D", |o| o.d.clear()),
        ("model.disturbance_bound", |o| o.disturbance_bound.push(0.0)),
        ("model.disturbance_bound", |o| o.disturbance_bound[0] = -0.1),
        ("model.measurement_noise_bound", |o| {
            o.measurement_noise_bound[2] = f64::INFINITY
        }),
        ("model.A_uncertainty", |o| o.a_uncertainty[0][1] = -1e-9),
        ("model.A_uncertainty", |o| o.a_uncertainty.truncate(1)),
        ("model.initial_state_radius", |o| {
            o.initial_state_center = Some(vec![0.0, 0.0])
        }),
        ("model.input_upper", |o| o.input_lower = Some(vec![0.0])),
        ("model.actuator_names", |o| o.actuator_names = Some(vec![])),
        ("model.output_names", |o| {
            o.output_names = Some(vec!["a".into(), "b".into(), "a".into()])
        }),
        ("model.discretisation", |o| {
            o.discretisation = Some(Discretisation::Euler)
        }),
    ];
    for (key, change) in cases {
        let (found, error) = refusal(change);
        assert_eq!(found, key, "{error}");
        assert!(error.to_string().contains(key), "{error}");
    }
}

#[test]
fn a_lower_bound_above_its_upper_bound_is_refused() {
    let (key, error) = refusal(|o| {
        o.state_box_lower = Some(vec![0.0, 1.0]);
        o.state_box_upper = Some(vec![1.0, 0.5]);
    });
    assert_eq!(key, "model.state_box_lower");
    assert!(matches!(error, ModelError::LowerAboveUpper { index: 1, .. }));
}

#[test]
fn a_continuous_model_needs_a_rule_and_refuses_uncertainty_under_zero_order_hold() {
    assert_eq!(
        refusal(|o| o.time = Time::Continuous).1,
        ModelError::DiscretisationMissing
    );
    let hold = |o: &mut ModelOptions| {
        o.time = Time::Continuous;
        o.discretisation = Some(Discretisation::ZeroOrderHold);
    };
    assert_eq!(refusal(hold).1, ModelError::UncertaintyWithZeroOrderHold);
}

#[test]
fn only_positive_sampling_periods_are_accepted() {
    for period in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let error = LinearModel::new(&options(), period).unwrap_err();
        assert_eq!(error.key(), "sample_time_s");
    }
}

#[test]
fn unknown_keys_and_integers_in_toml_are_handled() {
    let text = "A = [[1]]\nB = [[1]]\nC = [[1]]\nmeasurement_noise_bound = [1]\n";
    assert!(LinearModel::new(&toml::from_str(text).unwrap(), 1.0).is_ok());
    let error = toml::from_str::<ModelOptions>(&format!("{text}E = [[1]]\n")).unwrap_err();
    assert!(error.to_string().contains('E'));
}

#[test]
fn the_radius_of_a_box_reaches_both_corners() {
    let bounds = Bounds {
        lower: DVector::from_vec(vec![-0.1, 1.0]),
        upper: DVector::from_vec(vec![0.3, 1.0]),
    };
    let (center, radius) = (bounds.center(), bounds.radius());
    for i in 0..2 {
        assert!(center[i] - radius[i] <= bounds.lower[i] && center[i] + radius[i] >= bounds.upper[i]);
    }
}
