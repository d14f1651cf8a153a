//! Prediction and measurement update with covariances, in Joseph's symmetric form (method sheet 4.2, step 5).

use super::{
    interval::{Interval, symmetrise},
    sensor::SensorModel,
    state::ModeState,
    transport::ModeTransport,
};
use crate::{
    factor::{cholesky, cholesky_solve},
    matrix::{
        Matrix, add_scaled, all_finite, apply, dot, forward_substitution, multiply, multiply_transposed,
    },
};
use std::f64::consts::TAU;

/// One sample seen by one mode: e, S = L_S L_S' and P H̄'.
#[derive(Clone, Debug)]
pub(super) struct Innovation {
    /// e = z - H̄x̂; d of it are in use.
    pub e: Vec<f64>,
    factor: Matrix,
    /// P H̄', then K = P H̄' S⁻¹.
    gain: Matrix,
}

impl Innovation {
    pub fn new(n: usize, widest: usize) -> Self {
        Self {
            e: vec![0.0; widest],
            factor: Matrix::zeros(widest, widest),
            gain: Matrix::zeros(n, widest),
        }
    }
}

/// Steps of the covariance form.
#[derive(Clone, Debug)]
pub(super) struct JosephSteps {
    innovations: Vec<Innovation>,
    transport: ModeTransport,
    square: Matrix,
    product: Matrix,
    gain_noise: Matrix,
    whitened: Vec<f64>,
}

impl JosephSteps {
    pub fn new(modes: usize, n: usize, widest: usize) -> Self {
        Self {
            innovations: vec![Innovation::new(n, widest); modes],
            transport: ModeTransport::new(n),
            square: Matrix::zeros(n, n),
            product: Matrix::zeros(n, n),
            gain_noise: Matrix::zeros(n, widest),
            whitened: vec![0.0; widest],
        }
    }

    /// x̂ ← Φ̄x̂ + ū, P ← Φ̄PΦ̄' + Ω̄.
    pub fn predict(&mut self, interval: &Interval, direction: &Matrix, state: &mut ModeState) {
        self.transport.assemble(interval, direction);
        self.transport.move_mean(interval, &mut state.mean);
        multiply(&self.transport.phi, &state.spread, &mut self.product);
        multiply_transposed(&self.product, &self.transport.phi, &mut state.spread);
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
        multiply_transposed(&state.spread, &sensor.h, &mut innovation.gain);
        multiply(&sensor.h, &innovation.gain, &mut innovation.factor);
        for i in 0..d {
            add_scaled(innovation.factor.row_mut(i), 1.0, sensor.r.row(i));
        }
        all_finite(e) && cholesky(&mut innovation.factor)
    }

    /// Uses the innovation of mode `m`; returns log N(e; 0, S).
    pub fn update(&mut self, m: usize, state: &mut ModeState, sensor: &SensorModel) -> f64 {
        let (n, d) = (state.mean.len(), sensor.rows());
        let Innovation { e, factor, gain } = &mut self.innovations[m];
        let e = &e[..d];
        let whitened = &mut self.whitened[..d];
        whitened.copy_from_slice(e);
        forward_substitution(factor, whitened);
        let log_likelihood = log_density(factor, whitened);
        for (i, mean) in state.mean.iter_mut().enumerate() {
            cholesky_solve(factor, gain.row_mut(i));
            *mean += dot(gain.row(i), e);
        }
        // P ← (I - KH̄) P (I - KH̄)' + K R K'.
        multiply(gain, &sensor.h, &mut self.square);
        for i in 0..n {
            let row = self.square.row_mut(i);
            row.iter_mut().for_each(|value| *value = -*value);
            row[i] += 1.0;
        }
        multiply(&self.square, &state.spread, &mut self.product);
        multiply_transposed(&self.product, &self.square, &mut state.spread);
        multiply(gain, &sensor.r, &mut self.gain_noise);
        multiply_transposed(&self.gain_noise, gain, &mut self.square);
        for i in 0..n {
            add_scaled(state.spread.row_mut(i), 1.0, self.square.row(i));
        }
        symmetrise(&mut state.spread);
        log_likelihood
    }
}

/// -½(d ln 2π + ‖L⁻¹e‖²) - Σ ln L_aa for the triangular factor L and L⁻¹e.
pub(super) fn log_density(factor: &Matrix, whitened: &[f64]) -> f64 {
    let d = whitened.len();
    let logarithms: f64 = (0..d).map(|a| factor[(a, a)].ln()).sum();
    -0.5 * (d as f64 * TAU.ln() + dot(whitened, whitened)) - logarithms
}
