//! A is stable if and only if some X ≻ 0 has A'X + XA ≺ 0.

use nalgebra::{DMatrix, dmatrix};
use residual_synthesis::{
    conic::SolverError,
    semidefinite::{SemidefiniteError, SemidefiniteProgram, SemidefiniteSolution, hermitian},
};

/// X with X ⪰ I and He(XA) + 2αX ⪯ -I, tr X minimal.
fn solve(a: &DMatrix<f64>, alpha: f64) -> Result<SemidefiniteSolution, SemidefiniteError> {
    let n = a.nrows();
    let mut problem = SemidefiniteProgram::new();
    let x = problem.symmetric(n);
    problem.minimise_trace(x);
    problem.require("positive", move |at| at.matrix(x) - DMatrix::identity(n, n));
    problem.require("decay", move |at| {
        let x = at.matrix(x);
        -hermitian(&(&x * a)) - &x * (2.0 * alpha) - DMatrix::identity(n, n)
    });
    let solution = problem.solve()?;
    assert_eq!(solution.value(x), solution.value(x).transpose());
    Ok(solution)
}

#[test]
fn a_decay_rate_is_feasible_below_the_slowest_pole_and_infeasible_above() {
    // Poles -1 ± 3j, -2, -5.
    let a = dmatrix![
        -1.0, 3.0, 0.5, 0.0;
        -3.0, -1.0, 0.0, 1.0;
        0.0, 0.0, -2.0, 2.0;
        0.0, 0.0, 0.0, -5.0
    ];
    let solution = solve(&a, 0.9).unwrap();
    assert!(solution.margin("positive").unwrap() > -1e-7 && solution.margin("decay").unwrap() > -1e-7);
    assert_eq!(solution.margin("nowhere"), None);
    assert!(solution.least_margin().unwrap().1 > -1e-7);
    assert!(matches!(
        solve(&a, 1.1),
        Err(SemidefiniteError::Solver(SolverError::Infeasible { .. }))
    ));
}
