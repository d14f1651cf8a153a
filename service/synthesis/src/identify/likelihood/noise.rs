//! Covariances that are positive by construction.
//!
//! Diagonal: the standard deviations are exp(θ). Full: the covariance is L L' with L lower triangular, exp(θ) on its
//! diagonal and θ s_i below, s_i being the standard deviation of row i at the start.

use super::Unknown;
use nalgebra::{DMatrix, DVector};
use residual_diagnosis::covariance::{CovarianceError, positive_definite_factor};

/// How far above.
const LARGEST: f64 = 1e6;

/// What of a covariance is unknown.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::identify) struct NoiseForm {
    /// Lower factor at the start.
    start: DMatrix<f64>,
    /// Whether the entries below the diagonal are unknown.
    full: bool,
}

impl NoiseForm {
    /// Diagonal; where the standard deviation is 0 it stays so.
    pub(in crate::identify) fn diagonal(standard_deviations: &[f64]) -> Self {
        Self {
            start: DMatrix::from_diagonal(&DVector::from_column_slice(standard_deviations)),
            full: false,
        }
    }

    /// Diagonal if `covariance` is, with its zeros; otherwise full.
    pub(in crate::identify) fn like(covariance: &DMatrix<f64>) -> Result<Self, CovarianceError> {
        let n = covariance.nrows();
        if covariance.ncols() != n {
            return Err(CovarianceError::NotSquare);
        }
        let diagonal = (0..n).all(|i| (0..n).all(|j| i == j || covariance[(i, j)] == 0.0));
        if diagonal {
            if covariance.diagonal().iter().any(|variance| *variance < 0.0) {
                return Err(CovarianceError::NotPositiveSemidefinite);
            }
            let deviations: Vec<f64> = covariance
                .diagonal()
                .iter()
                .map(|variance| variance.sqrt())
                .collect();
            return Ok(Self::diagonal(&deviations));
        }
        Ok(Self {
            start: positive_definite_factor(covariance)?,
            full: true,
        })
    }

    /// Standard deviations at the start.
    pub(in crate::identify) fn start_deviations(&self) -> Vec<f64> {
        self.start.row_iter().map(|row| row.norm()).collect()
    }

    /// Places of the unknown entries of the factor.
    fn places(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        let n = self.start.nrows();
        (0..n)
            .flat_map(|i| (0..=i).map(move |j| (i, j)))
            .filter(|&(i, j)| {
                if i == j {
                    self.start[(i, i)] > 0.0
                } else {
                    self.full
                }
            })
    }

    /// Number of unknowns.
    pub(in crate::identify) fn count(&self) -> usize {
        self.places().count()
    }

    /// Whether rows may be correlated: each diagonal entry of the factor is then the standard deviation of its row
    /// given the rows before it.
    pub(in crate::identify) fn is_full(&self) -> bool {
        self.full
    }

    /// The unknowns; `name` tells what row i is, and `smallest` how far below its start a standard deviation may sink.
    pub(in crate::identify) fn unknowns(
        &self,
        smallest: f64,
        name: impl Fn(usize) -> String,
    ) -> Vec<Unknown> {
        let deviations = self.start_deviations();
        let unknown = |(i, j): (usize, usize)| {
            if i == j {
                let start = self.start[(i, i)].ln();
                let given = if self.full && i > 0 {
                    " given those before it"
                } else {
                    ""
                };
                Unknown {
                    name: format!("standard deviation of {}{given}", name(i)),
                    start,
                    range: (start + smallest.ln(), start + LARGEST.ln()),
                    largest_step: 2.0,
                }
            } else {
                Unknown {
                    name: format!("correlation of {} and {}", name(i), name(j)),
                    start: self.start[(i, j)] / deviations[i],
                    range: (f64::NEG_INFINITY, f64::INFINITY),
                    largest_step: f64::INFINITY,
                }
            }
        };
        self.places().map(unknown).collect()
    }

    /// Row and column of each unknown in the factor.
    pub(in crate::identify) fn entries(&self) -> Vec<(usize, usize)> {
        self.places().collect()
    }

    /// The covariance of these unknowns; the logarithm of a standard deviation may be -infinity.
    pub(in crate::identify) fn covariance(&self, theta: &[f64]) -> DMatrix<f64> {
        let deviations = self.start_deviations();
        let mut factor = self.start.clone();
        for ((i, j), value) in self.places().zip(theta) {
            factor[(i, j)] = if i == j {
                value.exp()
            } else {
                value * deviations[i]
            };
        }
        &factor * factor.transpose()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::dmatrix;

    #[test]
    fn the_start_is_given_back_and_any_unknowns_give_a_positive_matrix() {
        for covariance in [
            dmatrix![4.0, 0.0; 0.0, 0.25],
            dmatrix![4.0, -0.9; -0.9, 0.25],
            dmatrix![4.0, 0.0; 0.0, 0.0],
        ] {
            let form = NoiseForm::like(&covariance).unwrap();
            let start: Vec<f64> = form
                .unknowns(1e-4, |i| i.to_string())
                .iter()
                .map(|one| one.start)
                .collect();
            assert_eq!(start.len(), form.count());
            assert!((form.covariance(&start) - &covariance).amax() < 1e-14);
            let other: Vec<f64> = start.iter().map(|value| 1.0 - 3.0 * value).collect();
            let changed = form.covariance(&other);
            assert!(changed.determinant() >= 0.0 && changed[(0, 0)] > 0.0, "{changed}");
        }
        assert_eq!(
            NoiseForm::like(&dmatrix![1.0, 2.0; 2.0, 1.0]),
            Err(CovarianceError::NotPositiveDefinite)
        );
        assert_eq!(
            NoiseForm::like(&dmatrix![-1.0]),
            Err(CovarianceError::NotPositiveSemidefinite)
        );
    }
}
