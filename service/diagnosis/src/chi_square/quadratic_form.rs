//! The statistic of a state test: λ = β' T⁺ β from a factor of T (method sheet 4, step 8).
//!
//! One-sided Jacobi rotations make the columns c_j of diag(s)⁻¹ L_T orthogonal, s_i the norm of row i: then
//! T⁺ restricted to the kept columns gives λ = Σ (c_j' (β/s))² / ‖c_j‖⁴. The row scaling makes the rank free of units.

use crate::matrix::{Matrix, dot};

/// Sweeps of the rotations; six to eight are enough.
const SWEEPS: usize = 60;
/// Cosine of two columns that counts as orthogonal.
const ORTHOGONAL: f64 = 1e-15;

/// A factored T, in room allocated once.
#[derive(Clone, Debug)]
pub struct QuadraticForm {
    tolerance: f64,
    /// Row j is the column c_j.
    columns: Matrix,
    /// ‖c_j‖² of the kept columns, 0 of the others.
    squared: Vec<f64>,
    scale: Vec<f64>,
    scaled: Vec<f64>,
    degrees: usize,
}

impl QuadraticForm {
    /// Room for factors of `order` rows and columns; `tolerance` is relative to the largest singular value.
    pub fn new(order: usize, tolerance: f64) -> Self {
        Self {
            tolerance,
            columns: Matrix::zeros(order, order),
            squared: vec![0.0; order],
            scale: vec![1.0; order],
            scaled: vec![0.0; order],
            degrees: 0,
        }
    }

    /// Takes the factor L of T = L L' (`order` rows, at most as many columns).
    pub fn factor(&mut self, factor: &Matrix) {
        let (n, columns) = factor.shape();
        self.columns.reshape(columns, n);
        for (i, scale) in self.scale.iter_mut().enumerate() {
            let norm = dot(factor.row(i), factor.row(i)).sqrt();
            *scale = if norm > 0.0 { norm } else { 1.0 };
            for (j, value) in factor.row(i).iter().enumerate() {
                self.columns[(j, i)] = value / *scale;
            }
        }
        for _ in 0..SWEEPS {
            let mut rotated = false;
            for p in 0..columns {
                for q in p + 1..columns {
                    rotated |= self.orthogonalise(p, q);
                }
            }
            if !rotated {
                break;
            }
        }
        self.keep();
    }

    fn orthogonalise(&mut self, p: usize, q: usize) -> bool {
        let (left, right) = (self.columns.row(p), self.columns.row(q));
        let (alpha, beta, gamma) = (dot(left, left), dot(right, right), dot(left, right));
        if !(gamma.abs() > ORTHOGONAL * (alpha * beta).sqrt()) {
            return false;
        }
        let zeta = (beta - alpha) / (2.0 * gamma);
        let tangent = zeta.signum() / (zeta.abs() + zeta.hypot(1.0));
        let cosine = 1.0 / tangent.hypot(1.0);
        let sine = cosine * tangent;
        for i in 0..self.columns.columns() {
            let (left, right) = (self.columns[(p, i)], self.columns[(q, i)]);
            self.columns[(p, i)] = cosine * left - sine * right;
            self.columns[(q, i)] = sine * left + cosine * right;
        }
        true
    }

    fn keep(&mut self) {
        let columns = self.columns.rows();
        let norm = |row: &[f64]| dot(row, row).sqrt();
        let largest = self.columns.iter_rows().map(norm).fold(0.0, f64::max);
        self.degrees = 0;
        self.squared.fill(0.0);
        for j in 0..columns {
            let length = norm(self.columns.row(j));
            if length > self.tolerance * largest {
                self.squared[j] = length * length;
                self.degrees += 1;
            }
        }
    }

    /// Degrees of freedom: the number of kept columns; 0 means no test.
    pub fn degrees(&self) -> usize {
        self.degrees
    }

    /// λ of a difference β.
    pub fn evaluate(&mut self, difference: &[f64]) -> f64 {
        for (scaled, (value, scale)) in self.scaled.iter_mut().zip(difference.iter().zip(&self.scale)) {
            *scaled = value / scale;
        }
        let kept = self
            .columns
            .iter_rows()
            .zip(&self.squared)
            .filter(|(_, squared)| **squared > 0.0);
        kept.map(|(column, squared)| (dot(column, &self.scaled) / squared).powi(2))
            .sum()
    }

    /// W with λ = ‖W β‖², one row per degree of freedom (allocates; off-line).
    pub fn whitening(&self) -> Matrix {
        let n = self.columns.columns();
        let mut whitening = Matrix::zeros(self.degrees, n);
        let kept = (0..self.columns.rows()).filter(|j| self.squared[*j] > 0.0);
        for (row, j) in kept.enumerate() {
            for i in 0..n {
                whitening[(row, i)] = self.columns[(j, i)] / self.squared[j] / self.scale[i];
            }
        }
        whitening
    }
}
