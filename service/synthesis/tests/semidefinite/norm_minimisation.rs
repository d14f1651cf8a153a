//! The smallest Frobenius norm, by a second-order cone.

use nalgebra::{DMatrix, dmatrix};
use residual_synthesis::semidefinite::SemidefiniteProgram;

#[test]
fn the_least_norm_solution_of_linear_equations_is_the_pseudo_inverse() {
    let (a, b) = (
        &dmatrix![1.0, 2.0, -1.0; 0.5, 0.0, 3.0],
        &dmatrix![1.0, -2.0; 4.0, 0.3],
    );
    let mut problem = SemidefiniteProgram::new();
    let (y, t) = (problem.full(3, 2), problem.scalar());
    problem.minimise(t);
    problem.at_most_norm(t, y);
    problem.equal("equations", move |at| a * at.matrix(y) - b);
    let solution = problem.solve().unwrap();
    let least = a.transpose() * (a * a.transpose()).try_inverse().unwrap() * b;
    assert!((solution.value(y) - &least).amax() < 1e-6);
    assert!((solution.number(t) - least.norm()).abs() < 1e-8);
    assert!(solution.margin("norm").unwrap() > -1e-8);
}

#[test]
fn the_nearest_semidefinite_matrix_drops_the_negative_eigenvalue() {
    // Eigenvalues 3 and -1: the distance to the cone is 1, also over a symmetric variable.
    let a = &dmatrix![1.0, 2.0; 2.0, 1.0];
    let mut problem = SemidefiniteProgram::new();
    let (d, t) = (problem.symmetric(2), problem.scalar());
    problem.minimise(t);
    problem.at_most_norm(t, d);
    problem.require("semidefinite", move |at| a + at.matrix(d));
    let solution = problem.solve().unwrap();
    assert!((solution.number(t) - 1.0).abs() < 1e-7);
    assert!((solution.value(d) - DMatrix::from_row_slice(2, 2, &[0.5, -0.5, -0.5, 0.5])).amax() < 1e-6);
}
