//! Constraints that cannot be meant are refused by name.

use nalgebra::{DMatrix, dmatrix};
use residual_synthesis::semidefinite::{SemidefiniteError, SemidefiniteProgram};

#[test]
fn entries_that_are_not_finite_and_matrices_that_are_not_symmetric_are_refused() {
    let mut problem = SemidefiniteProgram::new();
    let t = problem.scalar();
    problem.require("limit", move |at| DMatrix::from_element(2, 2, at.number(t) / 0.0));
    let error = problem.solve().unwrap_err();
    let constraint = "limit".to_owned();
    assert_eq!(error, SemidefiniteError::NotFinite { constraint });

    for matrix in &[dmatrix![1.0, 2.0; 0.0, 1.0], dmatrix![1.0, 2.0]] {
        let mut problem = SemidefiniteProgram::new();
        let t = problem.scalar();
        problem.require("skew", move |at| matrix * at.number(t));
        let error = problem.solve().unwrap_err();
        assert_eq!(
            error.to_string(),
            "the matrix of the inequality \"skew\" is not symmetric; check its blocks"
        );
    }
}
