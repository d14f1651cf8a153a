//! Coefficients of equations.

use crate::simulation::normal;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use residual_synthesis::identify::regression::{
    Equation, Regression, RegressionError, SignalRun, Term, identify_regression,
};

fn term(signal: usize, lag: usize) -> Term {
    Term {
        signal,
        lag,
        coefficient: None,
    }
}

fn names() -> Vec<String> {
    ["p", "e", "noise"].map(String::from).to_vec()
}

/// p(k) = 0.6 p(k-1) - 0.2 p(k-2) + 1.5 e(k) + 0.4 e(k-1) + 0.05 + noise.
fn recorded(seed: u64, runs: usize, rows: usize, deviation: f64) -> Vec<SignalRun> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let run = |run: usize| {
        let (mut past, mut last) = ([0.0; 2], 0.0);
        let row = |_| {
            let e: f64 = random.random_range(-1.0..1.0);
            let p =
                0.6 * past[0] - 0.2 * past[1] + 1.5 * e + 0.4 * last + 0.05 + deviation * normal(&mut random);
            (past, last) = ([p, past[0]], e);
            vec![p, e, normal(&mut random)]
        };
        SignalRun {
            name: run.to_string(),
            rows: (0..rows).map(row).collect(),
        }
    };
    (0..runs).map(run).collect()
}

const TRUTH: [f64; 5] = [0.6, -0.2, 1.5, 0.4, 0.05];

fn equation() -> Equation {
    Equation {
        output: 0,
        terms: vec![term(0, 1), term(0, 2), term(1, 0), term(1, 1)],
        constant: true,
    }
}

fn identify(equation: Equation, runs: &[SignalRun]) -> Result<Regression, RegressionError> {
    identify_regression(&names(), &[equation], runs, &[])
}

#[test]
fn intervals_of_the_coefficients_contain_the_truth_as_often_as_they_should() {
    let (mut within, mut all) = (0, 0);
    for seed in 0..80 {
        // Two rows of past are zero at the start of a run, as the recording does not say: they are left out.
        let found = identify(equation(), &recorded(seed, 5, 60, 0.2))
            .unwrap()
            .found
            .remove(0);
        assert_eq!(found.skipped, 10);
        for ((value, error), truth) in found.coefficients.iter().zip(&found.standard_errors).zip(TRUTH) {
            within += u32::from((value - truth).abs() < 1.96 * error.unwrap());
            all += 1;
        }
        assert!(
            found.training.r_squared > 0.9 && found.condition < 10.0,
            "{found:?}"
        );
        assert!(
            (found.training.rms / 0.2 - 1.0).abs() < 0.2 && found.correlation.abs() < 0.25,
            "{found:?}"
        );
        assert!(!found.is_overfitted(), "{found:?}");
    }
    // 400 intervals of 95 %: 380 on average, fewer than 364 once in 5,000 batches.
    assert!(all == 400 && (364..=394).contains(&within), "{within} of {all}");
}

#[test]
fn given_coefficients_stay_and_the_others_are_exact_without_noise() {
    let mut equation = equation();
    equation.terms[2].coefficient = Some(1.5);
    let found = identify(equation, &recorded(1, 3, 30, 0.0))
        .unwrap()
        .found
        .remove(0);
    for (value, truth) in found.coefficients.iter().zip(TRUTH) {
        assert!((value - truth).abs() < 1e-12, "{found:?}");
    }
    assert!(found.standard_errors[2].is_none() && found.standard_errors[0].is_some());
    assert!(found.training.r_squared > 1.0 - 1e-12);
}

#[test]
fn the_shift_register_predicts_what_the_equation_does() {
    let runs = recorded(2, 3, 80, 0.3);
    let regression = identify(equation(), &runs).unwrap();
    let model = regression.shift_register();
    assert_eq!(model.commands, [0, 1]);
    assert!(model.has_constant);
    let coefficients = &regression.found[0].coefficients;
    let mut state = nalgebra::DVector::zeros(model.transition.nrows());
    state[2] = 1.0;
    for (k, row) in runs[0].rows.iter().enumerate() {
        let u = nalgebra::DVector::from_iterator(2, model.commands.iter().map(|&signal| row[signal]));
        let predicted = (&model.measurement * &state + &model.feedthrough * &u)[0];
        if k >= 2 {
            let past = |signal: usize, lag: usize| runs[0].rows[k - lag][signal];
            let values = [past(0, 1), past(0, 2), past(1, 0), past(1, 1), 1.0];
            let expected: f64 = coefficients.iter().zip(values).map(|(c, value)| c * value).sum();
            assert!((predicted - expected).abs() < 1e-12, "{k}");
        }
        state = &model.transition * &state + &model.input * &u;
    }
    let rms = regression.found[0].training.rms;
    assert!((regression.residual_covariance[(0, 0)].sqrt() / rms - 1.0).abs() < 1e-9);
}

#[test]
fn equations_of_lag_one_are_a_model_of_first_order() {
    let runs = recorded(3, 4, 100, 0.1);
    let equations = [
        Equation {
            output: 0,
            terms: vec![term(0, 1), term(1, 1)],
            constant: false,
        },
        Equation {
            output: 2,
            terms: vec![
                term(2, 1),
                Term {
                    coefficient: Some(0.25),
                    ..term(1, 1)
                },
            ],
            constant: false,
        },
    ];
    let found = identify_regression(&names(), &equations, &runs, &runs[..1]).unwrap();
    let model = found.first_order().unwrap();
    assert_eq!(model.commands, [1]);
    assert_eq!(model.b[(1, 0)], 0.25);
    assert_eq!(model.a[(0, 0)], found.found[0].coefficients[0]);
    assert_eq!(model.a[(0, 1)], 0.0);
    assert_eq!(found.found[0].validation.as_ref().unwrap().rows, 99);
    let late = identify(equation(), &runs).unwrap().first_order().unwrap_err();
    assert!(matches!(late, RegressionError::NotFirstOrder { .. }));
}

#[test]
fn cross_validation_detects_too_many_terms() {
    let runs = recorded(4, 6, 28, 0.3);
    let modest = identify(equation(), &runs).unwrap().found.remove(0);
    let mut greedy = equation();
    greedy.terms.extend((0..=18).map(|lag| term(2, lag)));
    greedy.terms.extend((3..=14).map(|lag| term(0, lag)));
    // 10 rows a run are left: 60 for 36 coefficients are too few at three a coefficient.
    assert!(matches!(
        identify(greedy.clone(), &runs),
        Err(RegressionError::TooFew { .. })
    ));
    let longer = recorded(4, 6, 40, 0.3);
    let greedy = identify(greedy, &longer).unwrap().found.remove(0);
    assert!(!modest.is_overfitted(), "{modest:?}");
    assert!(greedy.is_overfitted() && greedy.training.rms < 0.3, "{greedy:?}");
}

#[test]
fn what_does_not_determine_the_coefficients_is_refused_by_name() {
    let good = recorded(5, 4, 50, 0.1);
    let changed = |change: &dyn Fn(&mut Vec<f64>)| {
        let mut runs = good.clone();
        runs.iter_mut().flat_map(|run| &mut run.rows).for_each(change);
        runs
    };
    let simple = || Equation {
        output: 0,
        terms: vec![term(0, 1), term(1, 0), term(2, 0)],
        constant: false,
    };
    let refused = |equation: Equation, runs: &[SignalRun]| identify(equation, runs).unwrap_err().to_string();

    let copy = changed(&|row| row[2] = -3.0 * row[1]);
    let message = refused(simple(), &copy);
    assert!(
        message.contains("the regressors e, noise of `p` are linearly dependent"),
        "{message}"
    );
    let sum = changed(&|row| row[2] = 2.0 - row[1]);
    let message = refused(
        Equation {
            constant: true,
            ..simple()
        },
        &sum,
    );
    assert!(
        message.contains("the regressors e, noise, the constant of `p`"),
        "{message}"
    );
    let stuck = changed(&|row| row[2] = 7.0);
    let message = refused(simple(), &stuck);
    assert!(message.contains("`noise` has the same value (7)"), "{message}");
    let flat = changed(&|row| row[0] = 0.0);
    let message = refused(simple(), &flat);
    assert!(message.contains("`p` has the same value (0)"), "{message}");
    let empty = changed(&|row| row[1] = f64::NAN);
    let message = refused(simple(), &empty);
    assert!(
        message.contains("only 0 complete rows (200 rows lack a value"),
        "{message}"
    );
    let message = refused(simple(), &good[..1]);
    assert!(message.contains("run 0 is the only training run"), "{message}");
    assert_eq!(identify(simple(), &[]), Err(RegressionError::NoTrainingRuns));
    let mut infinite = good.clone();
    infinite[1].rows[3][1] = f64::NEG_INFINITY;
    let message = refused(simple(), &infinite);
    assert!(message.contains("run 1, row 3: `e` is infinite"), "{message}");
    let own = Equation {
        terms: vec![term(0, 0)],
        ..simple()
    };
    assert!(refused(own, &good).contains("uses its own output"));
    let twice = Equation {
        terms: vec![term(1, 2), term(1, 2)],
        ..simple()
    };
    assert!(refused(twice, &good).contains("`e (2 back)` twice"));
    let none = Equation {
        terms: vec![],
        ..simple()
    };
    assert!(refused(none, &good).contains("has no terms"));
    let single = {
        let mut runs = changed(&|row| row[2] = 0.0);
        runs[2].rows[10][2] = 1.0;
        runs
    };
    assert!(refused(simple(), &single).contains("a single run determines a coefficient"));
}
