//! From constraints to rows of a conic program, and back to their margins.

use super::{Constraint, Demand, Point, SemidefiniteError};
use crate::conic::Rows;
use clarabel::solver::SupportedConeT::{
    self, NonnegativeConeT, PSDTriangleConeT, SecondOrderConeT, ZeroConeT,
};
use nalgebra::DMatrix;
use residual_diagnosis::decomposition::SymmetricDecomposition;
use std::f64::consts::SQRT_2;

/// Difference of mirrored entries, relative to the largest, that counts as a rounding error.
const ASYMMETRY: f64 = 1e-9;

/// The upper triangle of a symmetric matrix, column by column, off-diagonal entries times √2: \[M11, √2 M12, M22, …\],
/// so that the inner product of two images is the trace of the product of the matrices.
pub fn svec(matrix: &DMatrix<f64>) -> Vec<f64> {
    (0..matrix.ncols())
        .flat_map(|j| {
            (0..=j).map(move |i| match i == j {
                true => matrix[(i, j)],
                false => SQRT_2 * (matrix[(i, j)] + matrix[(j, i)]) / 2.0,
            })
        })
        .collect()
}

impl Constraint<'_> {
    /// The constraint G₀ + Σ x_i G_i in the cone K as rows of A x + s = b: b = vec(G₀), column i of A = -vec(G_i).
    pub(super) fn assemble(&self, unknowns: usize) -> Result<(Rows, SupportedConeT<f64>), SemidefiniteError> {
        let mut x = vec![0.0; unknowns];
        let constant = self.vector(&x)?;
        let mut terms = vec![Vec::new(); constant.len()];
        for i in 0..unknowns {
            x[i] = 1.0;
            let shifted = self.vector(&x)?;
            x[i] = 0.0;
            for ((row, at_unit), at_zero) in terms.iter_mut().zip(shifted).zip(&constant) {
                if at_unit != *at_zero {
                    row.push((i, at_zero - at_unit));
                }
            }
        }
        let cone = match self.demand {
            Demand::Zero => ZeroConeT(constant.len()),
            Demand::NormCone => SecondOrderConeT(constant.len()),
            Demand::Semidefinite if constant.len() == 1 => NonnegativeConeT(1),
            Demand::Semidefinite => PSDTriangleConeT(self.matrix(&x).nrows()),
        };
        let mut rows = Rows::default();
        for (row, right_hand_side) in terms.into_iter().zip(constant) {
            rows.push(row, right_hand_side);
        }
        Ok((rows, cone))
    }

    /// How far the constraint is from being violated at a point: the smallest eigenvalue of an inequality, minus the
    /// largest deviation of an equality, t - ‖Y‖_F.
    pub(super) fn margin(&self, unknowns: &[f64]) -> f64 {
        let matrix = self.matrix(unknowns);
        match self.demand {
            Demand::Semidefinite => SymmetricDecomposition::new(&matrix).smallest(),
            Demand::Zero => -matrix.amax(),
            Demand::NormCone => {
                let bound = matrix.iter().next().copied().unwrap_or(0.0);
                bound
                    - matrix
                        .iter()
                        .skip(1)
                        .map(|entry| entry * entry)
                        .sum::<f64>()
                        .sqrt()
            }
        }
    }

    fn matrix(&self, unknowns: &[f64]) -> DMatrix<f64> {
        (self.matrix)(&Point { unknowns })
    }

    /// The matrix as a vector of its cone.
    fn vector(&self, unknowns: &[f64]) -> Result<Vec<f64>, SemidefiniteError> {
        let matrix = self.matrix(unknowns);
        if !matrix.iter().all(|entry| entry.is_finite()) {
            return Err(SemidefiniteError::NotFinite {
                constraint: self.name.clone(),
            });
        }
        if self.demand != Demand::Semidefinite {
            return Ok(matrix.iter().copied().collect());
        }
        let symmetric =
            matrix.is_square() && (&matrix - matrix.transpose()).amax() <= ASYMMETRY * matrix.amax();
        match symmetric {
            true => Ok(svec(&matrix)),
            false => Err(SemidefiniteError::NotSymmetric {
                constraint: self.name.clone(),
            }),
        }
    }
}
