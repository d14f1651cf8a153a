//! The transition of one mode's filter state: Φ̄_m = \[Φ, ΞD_m; 0, I\].

use super::interval::Interval;
use crate::matrix::{Matrix, apply};

/// Φ̄_m of an interval; room for one.
#[derive(Clone, Debug)]
pub(super) struct ModeTransport {
    /// Φ̄_m, n x n.
    pub phi: Matrix,
    transposed: Matrix,
    mean: Vec<f64>,
}

impl ModeTransport {
    pub fn new(n: usize) -> Self {
        Self {
            phi: Matrix::zeros(n, n),
            transposed: Matrix::zeros(n, n),
            mean: vec![0.0; n],
        }
    }

    /// Takes the interval of the plant state, or of the filter state itself (random walk), for direction D.
    pub fn assemble(&mut self, interval: &Interval, direction: &Matrix) {
        let (n, nx) = (self.phi.rows(), interval.phi.rows());
        if nx == n {
            self.phi.copy_from(&interval.phi);
            return;
        }
        for i in 0..nx {
            let row = self.phi.row_mut(i);
            row[..nx].copy_from_slice(interval.phi.row(i));
            let xi = &interval.gain.row(i)[1..];
            for (j, value) in row[nx..].iter_mut().enumerate() {
                *value = xi.iter().enumerate().map(|(c, xi)| xi * direction[(c, j)]).sum();
            }
        }
        for i in nx..n {
            let row = self.phi.row_mut(i);
            row.fill(0.0);
            row[i] = 1.0;
        }
    }

    /// Φ̄_m' of the interval taken last.
    pub fn transposed(&mut self) -> &Matrix {
        for i in 0..self.phi.rows() {
            for (j, value) in self.phi.row(i).iter().enumerate() {
                self.transposed[(j, i)] = *value;
            }
        }
        &self.transposed
    }

    /// x̂ ← Φ̄x̂ + ū, ū = \[Υu; 0\].
    pub fn move_mean(&mut self, interval: &Interval, mean: &mut [f64]) {
        apply(&self.phi, mean, &mut self.mean);
        for (i, value) in self.mean.iter_mut().enumerate().take(interval.phi.rows()) {
            *value += interval.gain[(i, 0)];
        }
        mean.copy_from_slice(&self.mean);
    }
}
