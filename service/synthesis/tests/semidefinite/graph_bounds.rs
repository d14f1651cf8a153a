//! Relaxations of graph problems, whose optima are known for cycles.

use nalgebra::DMatrix;
use residual_synthesis::semidefinite::SemidefiniteProgram;
use std::f64::consts::PI;

/// Whether i and j are neighbours on a cycle of n nodes.
fn adjacent(n: usize, i: usize, j: usize) -> bool {
    (i + 1) % n == j || (j + 1) % n == i
}

#[test]
fn lovaszs_theta_of_an_odd_cycle_is_n_over_1_plus_1_over_its_cosine() {
    for n in [5, 7] {
        let mut problem = SemidefiniteProgram::new();
        let x = problem.symmetric(n);
        let total = problem.scalar();
        problem.maximise(total);
        problem.require("semidefinite", move |at| at.matrix(x));
        problem.equal("sum", move |at| {
            DMatrix::from_element(1, 1, at.matrix(x).sum() - at.number(total))
        });
        problem.equal("trace", move |at| {
            DMatrix::from_element(1, 1, at.matrix(x).trace() - 1.0)
        });
        problem.equal("edges", move |at| {
            let x = at.matrix(x);
            DMatrix::from_fn(n, 1, |i, _| x[(i, (i + 1) % n)])
        });
        let solution = problem.solve().unwrap();
        let cosine = (PI / n as f64).cos();
        let theta = n as f64 * cosine / (1.0 + cosine);
        assert!((solution.number(total) - theta).abs() < 1e-6, "{n}");
        assert!(solution.margin("edges").unwrap() > -1e-7);
    }
}

#[test]
fn the_relaxation_of_the_largest_cut_of_an_odd_cycle_is_n_times_its_squared_cosine() {
    for n in [5, 9] {
        let laplacian = &DMatrix::from_fn(n, n, |i, j| match (i == j, adjacent(n, i, j)) {
            (true, _) => 2.0,
            (_, true) => -1.0,
            _ => 0.0,
        });
        let mut problem = SemidefiniteProgram::new();
        let x = problem.symmetric(n);
        let cut = problem.scalar();
        problem.maximise(cut);
        problem.require("semidefinite", move |at| at.matrix(x));
        problem.require("cut", move |at| {
            let value = (laplacian * at.matrix(x)).trace() / 4.0;
            DMatrix::from_element(1, 1, value - at.number(cut))
        });
        problem.equal("unit diagonal", move |at| {
            DMatrix::from_fn(n, 1, |i, _| at.matrix(x)[(i, i)] - 1.0)
        });
        let optimum = n as f64 * (PI / (2.0 * n as f64)).cos().powi(2);
        assert!(
            (problem.solve().unwrap().number(cut) - optimum).abs() < 1e-6,
            "{n}"
        );
    }
}
