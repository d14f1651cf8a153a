//! The prediction of one mode for few filter states: x̂ ← Φ̄x̂ + ū, P ← Φ̄PΦ̄' + Ω̄ (method sheet 4.2, step 5a).

use super::{
    interval::Interval,
    small_bank::{Moments, add_scaled},
};
use crate::matrix::Matrix;

/// Φ̄ = \[Φ, ΞD; 0, I\], ū = \[Υu; 0\] and Ω̄ = diag(Ω, 0) of one interval; only ΞD differs between the modes.
#[derive(Clone, Debug)]
pub(super) struct SmallTransport<const N: usize> {
    /// Φ̄.
    rows: [[f64; N]; N],
    /// Φ̄'.
    columns: [[f64; N]; N],
    /// ū.
    shift: [f64; N],
    /// Ω̄.
    noise: [[f64; N]; N],
}

impl<const N: usize> SmallTransport<N> {
    /// Of no interval.
    pub const EMPTY: Self = Self {
        rows: [[0.0; N]; N],
        columns: [[0.0; N]; N],
        shift: [0.0; N],
        noise: [[0.0; N]; N],
    };

    /// Takes what all modes share.
    pub fn prepare(&mut self, interval: &Interval) {
        *self = Self::EMPTY;
        let states = interval.phi.rows();
        for i in states..N {
            self.rows[i][i] = 1.0;
            self.columns[i][i] = 1.0;
        }
        for i in 0..states {
            for (j, value) in interval.phi.row(i).iter().enumerate() {
                self.rows[i][j] = *value;
                self.columns[j][i] = *value;
            }
            self.shift[i] = interval.gain[(i, 0)];
            self.noise[i][..states].copy_from_slice(interval.omega.row(i));
        }
    }

    /// Puts the ΞD of one mode in; without effect if the interval is that of the filter state itself (random walk).
    pub fn direct(&mut self, interval: &Interval, direction: &Matrix) {
        let states = interval.phi.rows();
        for i in 0..states {
            let xi = &interval.gain.row(i)[1..];
            for j in states..N {
                let terms = xi.iter().enumerate();
                let value = terms.map(|(c, xi)| xi * direction[(c, j - states)]).sum();
                self.rows[i][j] = value;
                self.columns[j][i] = value;
            }
        }
    }

    /// Predicts one mode.
    pub fn predict(&self, moments: &mut Moments<N>) {
        let mut mean = self.shift;
        for (factor, column) in moments.mean.iter().zip(&self.columns) {
            add_scaled(&mut mean, *factor, column);
        }
        moments.mean = mean;
        let mut product = [[0.0; N]; N];
        for (product, row) in product.iter_mut().zip(&self.rows) {
            *product = combination(row, &moments.covariance);
        }
        for ((target, row), noise) in moments.covariance.iter_mut().zip(&product).zip(&self.noise) {
            *target = combination(row, &self.columns);
            add_scaled(target, 1.0, noise);
        }
        moments.symmetrise();
    }
}

/// Σ_k `factors`\[k\] times row k of `rows`.
#[inline(always)]
fn combination<const N: usize>(factors: &[f64; N], rows: &[[f64; N]; N]) -> [f64; N] {
    let mut sum = rows[0].map(|value| factors[0] * value);
    for (factor, row) in factors.iter().zip(rows).skip(1) {
        add_scaled(&mut sum, *factor, row);
    }
    sum
}
