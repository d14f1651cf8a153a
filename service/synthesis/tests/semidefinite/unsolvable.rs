//! Programs without a solution are told apart.

use nalgebra::DMatrix;
use residual_synthesis::{
    conic::SolverError,
    semidefinite::{SemidefiniteError, SemidefiniteProgram},
};

#[test]
fn contradictory_inequalities_are_infeasible() {
    let mut problem = SemidefiniteProgram::new();
    let x = problem.symmetric(4);
    problem.minimise_trace(x);
    problem.require("at least 2", move |at| {
        at.matrix(x) - DMatrix::identity(4, 4) * 2.0
    });
    problem.require("at most 1", move |at| DMatrix::identity(4, 4) - at.matrix(x));
    let error = problem.solve().unwrap_err();
    assert!(matches!(
        error,
        SemidefiniteError::Solver(SolverError::Infeasible { .. })
    ));
    assert!(error.to_string().starts_with("no point fulfils the constraints"));
}

#[test]
fn a_cost_without_a_limit_is_unbounded() {
    let mut problem = SemidefiniteProgram::new();
    let (x, t) = (problem.symmetric(4), problem.scalar());
    problem.maximise(t);
    problem.require("above", move |at| {
        at.matrix(x) - DMatrix::identity(4, 4) * at.number(t)
    });
    assert!(matches!(
        problem.solve(),
        Err(SemidefiniteError::Solver(SolverError::Unbounded { .. }))
    ));
}
