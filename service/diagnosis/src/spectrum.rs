//! Spectral radius, and the rank tests of Popov, Belevitch and Hautus at one eigenvalue.
//!
//! | condition | test |
//! |---|---|
//! | the mode λ of (A, C) is observable | σ_min \[A - λI; C\] > tolerance · σ_max |
//! | the mode λ of (A, B) is excited (controllable) | σ_min \[A - λI, B\] > tolerance · σ_max |
//!
//! A complex λ is tested with the real embedding \[Re, -Im; Im, Re\], which has every singular value twice.

use crate::decomposition::{SingularDecomposition, eigenvalues};
use nalgebra::{Complex, DMatrix};

/// Largest modulus of the eigenvalues, 0 of an empty matrix; `None` if the iteration does not converge.
pub fn spectral_radius(matrix: &DMatrix<f64>) -> Option<f64> {
    Some(
        eigenvalues(matrix)?
            .iter()
            .fold(0.0, |largest, value| value.norm().max(largest)),
    )
}

/// Smallest and largest singular value of a pencil at one λ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PencilGap {
    /// σ_min.
    pub smallest: f64,
    /// σ_max.
    pub largest: f64,
}

impl PencilGap {
    /// σ_min > tolerance · σ_max: the pencil has full rank.
    pub fn has_full_rank(&self, tolerance: f64) -> bool {
        self.smallest > tolerance * self.largest
    }
}

/// Singular values of \[A - λI; C\] (A n x n, C p x n).
pub fn observability_gap(a: &DMatrix<f64>, c: &DMatrix<f64>, lambda: Complex<f64>) -> PencilGap {
    let (n, p) = (a.nrows(), c.nrows());
    let real = DMatrix::from_fn(n + p, n, |i, j| match i.checked_sub(n) {
        Some(row) => c[(row, j)],
        None if i == j => a[(i, j)] - lambda.re,
        None => a[(i, j)],
    });
    let pencil = if lambda.im == 0.0 {
        real
    } else {
        let (rows, columns) = real.shape();
        DMatrix::from_fn(2 * rows, 2 * columns, |i, j| {
            let (row, column) = (i % rows, j % columns);
            match (i < rows, j < columns) {
                (true, true) | (false, false) => real[(row, column)],
                // Im(A - λI) = -Im λ on the diagonal of the upper block.
                (true, false) if row == column => lambda.im,
                (false, true) if row == column => -lambda.im,
                _ => 0.0,
            }
        })
    };
    let values = SingularDecomposition::new(&pencil);
    PencilGap {
        smallest: values.smallest(),
        largest: values.largest(),
    }
}

/// Singular values of \[A - λI, B\] (A n x n, B n x m).
pub fn controllability_gap(a: &DMatrix<f64>, b: &DMatrix<f64>, lambda: Complex<f64>) -> PencilGap {
    observability_gap(&a.transpose(), &b.transpose(), lambda)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hidden_oscillation_is_found_unobservable_and_unexcited() {
        let a = DMatrix::from_row_slice(3, 3, &[0.0, -2.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.5]);
        let sees_all = DMatrix::from_row_slice(1, 3, &[1.0, 0.0, 1.0]);
        let sees_last = DMatrix::from_row_slice(1, 3, &[0.0, 0.0, 1.0]);
        for lambda in eigenvalues(&a).unwrap() {
            assert!(observability_gap(&a, &sees_all, lambda).has_full_rank(1e-9));
            let oscillation = lambda.im != 0.0;
            assert_eq!(
                observability_gap(&a, &sees_last, lambda).has_full_rank(1e-9),
                !oscillation
            );
            assert_eq!(
                controllability_gap(&a, &sees_last.transpose(), lambda).has_full_rank(1e-9),
                !oscillation
            );
        }
        assert!((spectral_radius(&a).unwrap() - 2.0).abs() < 1e-12);
    }

    #[test]
    fn a_matrix_that_overflows_has_no_spectral_radius() {
        for entry in [f64::NAN, f64::INFINITY, 1e300] {
            let a = DMatrix::from_fn(3, 3, |i, j| if i == j { 1.0 } else { entry * (i + 2 * j) as f64 });
            assert!(spectral_radius(&a).is_none_or(|radius| radius > 1e200), "{entry}");
        }
    }
}
