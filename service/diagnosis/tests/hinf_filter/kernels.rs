//! Norms, Riccati solutions and window constants against `kernels.json`.

use crate::support::{assert_close, numbers, reference_of, rows};
use nalgebra::DMatrix;
use residual_diagnosis::{
    hinf_filter::plant::zoh,
    norms::{
        System, WindowConstants, h_infinity_continuous, h_infinity_discrete, h_minus_continuous,
        h_minus_discrete, l1_norm,
    },
    riccati::{Covariances, care, dare},
};
use serde_json::Value;

/// A list of rows as a matrix.
pub fn matrix(value: &Value) -> DMatrix<f64> {
    let rows = rows(value);
    DMatrix::from_fn(rows.len(), rows[0].len(), |i, j| rows[i][j])
}

/// The elements of a matrix row by row.
pub fn row_major(matrix: &DMatrix<f64>) -> Vec<f64> {
    matrix.transpose().as_slice().to_vec()
}

/// Fails unless a matrix agrees with a list of rows to `tolerance` times its largest entry.
pub fn assert_matrix(what: &str, actual: &DMatrix<f64>, expected: &Value, tolerance: f64) {
    assert_close(what, &row_major(actual), &numbers(expected), tolerance);
}

fn cases() -> Vec<Value> {
    reference_of("hinf_filter", "kernels.json")["norm_cases"]
        .as_array()
        .unwrap()
        .clone()
}

fn continuous(case: &Value) -> System {
    let [a, b, c, d] = ["A", "B", "C", "D"].map(|key| matrix(&case[key]));
    System { a, b, c, d }
}

fn discrete(case: &Value) -> System {
    let [a, b, c, d] = ["Ad", "Bd_zoh", "C", "D"].map(|key| matrix(&case[key]));
    System { a, b, c, d }
}

#[test]
fn norms_agree_with_the_reference_in_both_time_domains() {
    for (i, case) in cases().iter().enumerate() {
        let number = |key: &str| case[key].as_f64().unwrap();
        for (what, norm) in [
            ("hinf_ct", h_infinity_continuous(&continuous(case))),
            ("hminus_ct", h_minus_continuous(&continuous(case), None)),
            ("hinf_dt", h_infinity_discrete(&discrete(case))),
            ("hminus_dt", h_minus_discrete(&discrete(case), None)),
        ] {
            assert!(norm.confirmed, "case {i} {what}");
            let error = (norm.value - number(what)).abs();
            assert!(
                error <= 1e-8 * number(what),
                "case {i} {what}: {} instead of {}",
                norm.value,
                number(what)
            );
        }
        let sum = l1_norm(&discrete(case)).unwrap();
        assert_matrix("l1_dt", &sum, &case["l1_dt"], 1e-8);
    }
}

#[test]
fn the_zero_order_hold_is_exact() {
    for case in cases() {
        let system = continuous(&case);
        let (ad, bd) = zoh(&system.a, &system.b, case["Ts"].as_f64().unwrap());
        assert_matrix("Ad", &ad, &case["Ad"], 1e-13);
        assert_matrix("Bd_zoh", &bd, &case["Bd_zoh"], 1e-13);
    }
}

#[test]
fn window_constants_agree_with_the_reference() {
    for case in cases() {
        let system = discrete(&case);
        let window = case["window_N"].as_u64().unwrap() as usize;
        let constants = WindowConstants::new(&system.a, &system.b, &system.c, window).unwrap();
        assert_matrix("Wo_N", &constants.observability, &case["Wo_N"], 1e-8);
        assert_matrix("Wc_N", &constants.reachability, &case["Wc_N"], 1e-8);
        assert_close(
            "kappa",
            &constants.kappa[..3],
            &numbers(&case["kappa_first3"]),
            1e-8,
        );
        assert_close("mu", &[constants.memory], &numbers(&case["mu"]), 1e-8);
    }
}

#[test]
fn riccati_solutions_agree_with_the_reference() {
    for case in cases() {
        let r = matrix(&case["riccati_R"]);
        let system = continuous(&case);
        let (q, s) = (&system.b * system.b.transpose(), &system.b * system.d.transpose());
        let solution = care(&system.a, &system.c, Covariances { q: &q, s: &s, r: &r }).unwrap();
        assert_matrix("care_Pi", &solution.pi, &case["care_Pi"], 1e-8);
        assert_matrix("care_H", &solution.gain, &case["care_H"], 1e-8);
        let system = discrete(&case);
        let (q, s) = (&system.b * system.b.transpose(), &system.b * system.d.transpose());
        let solution = dare(&system.a, &system.c, Covariances { q: &q, s: &s, r: &r }).unwrap();
        assert_matrix("dare_Pi", &solution.pi, &case["dare_Pi"], 1e-8);
        assert_matrix("dare_Omega", &solution.omega, &case["dare_Omega"], 1e-8);
        assert_matrix("dare_L", &solution.gain, &case["dare_L"], 1e-8);
    }
}
