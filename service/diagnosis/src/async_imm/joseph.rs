//! Prediction and measurement update with covariances, in Joseph's symmetric form (method sheet 4.2, step 5).
//!
//! For any number of filter states; few of them have a bank of their own (`small_bank`), which does the same. How
//! Joseph's form is evaluated, and the symbols C, K, V, stand with `joseph_update`.

use super::{
    interval::{Interval, symmetrise},
    sensor::SensorModel,
    state::ModeState,
    transport::ModeTransport,
};
use crate::{
    factor::cholesky,
    matrix::{
        Matrix, add_combination, add_scaled, all_finite, apply, combination, dot, forward_substitution,
        multiply, multiply_transposed,
    },
};
use std::f64::consts::TAU;

/// One sample seen by one mode.
#[derive(Clone, Debug)]
pub(super) struct Innovation {
    /// e = z - H̄x̂; d of it are in use.
    e: Vec<f64>,
    /// L_S, S = H̄PH̄' + R = L_S L_S'.
    factor: Matrix,
    /// C' = H̄P, d x n.
    cross: Matrix,
}

impl Innovation {
    pub fn new(n: usize, widest: usize) -> Self {
        Self {
            e: vec![0.0; widest],
            factor: Matrix::zeros(widest, widest),
            cross: Matrix::zeros(widest, n),
        }
    }
}

/// Steps of the covariance form.
#[derive(Clone, Debug)]
pub(super) struct JosephSteps {
    innovations: Vec<Innovation>,
    transport: ModeTransport,
    product: Matrix,
    /// K', d x n.
    gain: Matrix,
    /// V', d x n.
    rest: Matrix,
    factors: Vec<f64>,
    whitened: Vec<f64>,
}

impl JosephSteps {
    pub fn new(modes: usize, n: usize, widest: usize) -> Self {
        Self {
            innovations: vec![Innovation::new(n, widest); modes],
            transport: ModeTransport::new(n),
            product: Matrix::zeros(n, n),
            gain: Matrix::zeros(widest, n),
            rest: Matrix::zeros(widest, n),
            factors: vec![0.0; widest],
            whitened: vec![0.0; widest],
        }
    }

    /// x̂ ← Φ̄x̂ + ū, P ← Φ̄PΦ̄' + Ω̄.
    pub fn predict(&mut self, interval: &Interval, direction: &Matrix, state: &mut ModeState) {
        self.transport.assemble(interval, direction);
        self.transport.move_mean(interval, &mut state.mean);
        multiply(&self.transport.phi, &state.spread, &mut self.product);
        multiply(&self.product, self.transport.transposed(), &mut state.spread);
        for i in 0..interval.omega.rows() {
            add_scaled(state.spread.row_mut(i), 1.0, interval.omega.row(i));
        }
        symmetrise(&mut state.spread);
    }

    /// Innovation of mode `m` and the factor of its covariance S = H̄PH̄' + R; false if S has none.
    pub fn innovate(&mut self, m: usize, state: &ModeState, sensor: &SensorModel, z: &[f64]) -> bool {
        let d = sensor.rows();
        let innovation = &mut self.innovations[m];
        let e = &mut innovation.e[..d];
        apply(&sensor.h, &state.mean, e);
        e.iter_mut().zip(z).for_each(|(e, z)| *e = z - *e);
        multiply(&sensor.h, &state.spread, &mut innovation.cross);
        multiply_transposed(&innovation.cross, &sensor.h, &mut innovation.factor);
        for i in 0..d {
            add_scaled(innovation.factor.row_mut(i), 1.0, sensor.r.row(i));
        }
        all_finite(e) && cholesky(&mut innovation.factor)
    }

    /// Uses the innovation of mode `m`; returns log N(e; 0, S).
    pub fn update(&mut self, m: usize, state: &mut ModeState, sensor: &SensorModel) -> f64 {
        let (n, d) = (state.mean.len(), sensor.rows());
        let Innovation { e, factor, cross } = &self.innovations[m];
        let (e, factors) = (&e[..d], &mut self.factors[..d]);
        let whitened = &mut self.whitened[..d];
        whitened.copy_from_slice(e);
        forward_substitution(factor, whitened);
        solve(factor, cross, &mut self.gain);
        add_combination(&mut state.mean, e, &self.gain);
        // (P - KC')' = P - CK'.
        for i in 0..n {
            for (a, entry) in factors.iter_mut().enumerate() {
                *entry = -cross[(a, i)];
            }
            add_combination(state.spread.row_mut(i), factors, &self.gain);
        }
        // V' = RK' - H̄(P - CK').
        multiply(&sensor.r, &self.gain, &mut self.rest);
        for a in 0..d {
            combination(self.product.row_mut(0), sensor.h.row(a), &state.spread);
            add_scaled(self.rest.row_mut(a), -1.0, self.product.row(0));
        }
        // (P - KC' + VK')' = P - CK' + KV'.
        for i in 0..n {
            for (a, entry) in factors.iter_mut().enumerate() {
                *entry = self.gain[(a, i)];
            }
            add_combination(state.spread.row_mut(i), factors, &self.rest);
        }
        symmetrise(&mut state.spread);
        log_density(factor, whitened)
    }
}

/// K' = (L L')⁻¹ C', row by row.
fn solve(factor: &Matrix, cross: &Matrix, gain: &mut Matrix) {
    gain.copy_from(cross);
    let d = factor.rows();
    for a in 0..d {
        for b in 0..a {
            let (known, row) = gain.two_rows(b, a);
            add_scaled(row, -factor[(a, b)], known);
        }
        let scale = 1.0 / factor[(a, a)];
        gain.row_mut(a).iter_mut().for_each(|value| *value *= scale);
    }
    for a in (0..d).rev() {
        let scale = 1.0 / factor[(a, a)];
        gain.row_mut(a).iter_mut().for_each(|value| *value *= scale);
        for b in 0..a {
            for i in 0..gain.columns() {
                let known = gain[(a, i)];
                gain[(b, i)] -= factor[(a, b)] * known;
            }
        }
    }
}

/// -½(d ln 2π + ‖L⁻¹e‖²) - Σ ln L_aa for the triangular factor L and L⁻¹e.
pub(super) fn log_density(factor: &Matrix, whitened: &[f64]) -> f64 {
    let d = whitened.len();
    let logarithms: f64 = (0..d).map(|a| factor[(a, a)].ln()).sum();
    -0.5 * (d as f64 * TAU.ln() + dot(whitened, whitened)) - logarithms
}
