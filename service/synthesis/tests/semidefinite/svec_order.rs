//! The order of the solver's semidefinite cone.

use crate::files::{list, reference_of};
use nalgebra::DMatrix;
use residual_synthesis::semidefinite::svec;

#[test]
fn svec_stacks_the_upper_triangle_by_columns_as_the_reference_does() {
    let example = &reference_of("hinf_filter", "kernels.json")["svec_example"];
    let rows: Vec<Vec<f64>> = list(&example["matrix"]);
    let matrix = DMatrix::from_fn(rows.len(), rows.len(), |i, j| rows[i][j]);
    let expected: Vec<f64> = list(&example["svec"]);
    for (value, expected) in svec(&matrix).iter().zip(&expected) {
        assert!((value - expected).abs() <= 1e-15 * expected.abs());
    }
    assert_eq!(svec(&matrix).len(), expected.len());
}
