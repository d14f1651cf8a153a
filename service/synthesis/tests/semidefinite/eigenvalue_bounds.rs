//! The extreme eigenvalues of A are the extreme t with tI - A ⪰ 0 and A - tI ⪰ 0.

use nalgebra::DMatrix;
use residual_synthesis::semidefinite::SemidefiniteProgram;

/// The second difference of order n: eigenvalues 2 - 2 cos(kπ/(n + 1)).
fn second_difference(n: usize) -> DMatrix<f64> {
    DMatrix::from_fn(n, n, |i, j| match i.abs_diff(j) {
        0 => 2.0,
        1 => -1.0,
        _ => 0.0,
    })
}

#[test]
fn the_extreme_eigenvalues_of_the_second_difference_are_found_for_all_small_orders() {
    for n in 2..=9 {
        let (a, identity) = (&second_difference(n), &DMatrix::<f64>::identity(n, n));
        let angle = std::f64::consts::PI / (n as f64 + 1.0);
        let mut problem = SemidefiniteProgram::named("largest eigenvalue");
        let t = problem.scalar();
        problem.minimise(t);
        problem.require("above", move |at| identity * at.number(t) - a);
        let solution = problem.solve().unwrap();
        assert!(
            (solution.number(t) - (2.0 + 2.0 * angle.cos())).abs() < 1e-7,
            "{n}"
        );
        assert!(solution.margin("above").unwrap() > -1e-7);
        assert!(!solution.almost);
        assert_eq!(solution.run.problem, "largest eigenvalue");

        let mut problem = SemidefiniteProgram::new();
        let t = problem.scalar();
        problem.maximise(t);
        problem.require("below", move |at| a - identity * at.number(t));
        let solution = problem.solve().unwrap();
        assert!(
            (solution.number(t) - (2.0 - 2.0 * angle.cos())).abs() < 1e-7,
            "{n}"
        );
        let run = solution.run;
        assert!((run.objective - run.dual_objective).abs() < 1e-7 && run.iterations > 2);
    }
}
