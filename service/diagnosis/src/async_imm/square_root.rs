//! Prediction and measurement update with triangular factors of the covariances, P = L L'.
//!
//! | step | array, made triangular from the right | result |
//! |---|---|---|
//! | prediction | \[Φ̄L, Ω̄^{1/2}\] | L |
//! | update | \[R^{1/2}, H̄L; 0, L\] | \[S^{1/2}, 0; K S^{1/2}, L⁺\] |

use super::{
    interval::Interval, joseph::log_density, sensor::SensorModel, state::ModeState, transport::ModeTransport,
};
use crate::matrix::{Matrix, all_finite, apply, dot, forward_substitution, multiply, triangularise};

#[derive(Clone, Debug)]
struct RootInnovation {
    e: Vec<f64>,
    /// (d + n) x (d + n).
    array: Matrix,
}

/// Steps of the square-root form.
#[derive(Clone, Debug)]
pub(super) struct RootSteps {
    innovations: Vec<RootInnovation>,
    transport: ModeTransport,
    /// n x 2n.
    array: Matrix,
    product: Matrix,
    projected: Matrix,
    whitened: Vec<f64>,
}

impl RootSteps {
    pub fn new(modes: usize, n: usize, widest: usize) -> Self {
        let innovation = RootInnovation {
            e: vec![0.0; widest],
            array: Matrix::zeros(n + widest, n + widest),
        };
        Self {
            innovations: vec![innovation; modes],
            transport: ModeTransport::new(n),
            array: Matrix::zeros(n, 2 * n),
            product: Matrix::zeros(n, n),
            projected: Matrix::zeros(widest, n),
            whitened: vec![0.0; widest],
        }
    }

    /// x̂ ← Φ̄x̂ + ū, L ← tri\[Φ̄L, Ω̄^{1/2}\].
    pub fn predict(
        &mut self,
        interval: &Interval,
        noise_root: &Matrix,
        direction: &Matrix,
        state: &mut ModeState,
    ) {
        let n = state.mean.len();
        self.transport.assemble(interval, direction);
        self.transport.move_mean(interval, &mut state.mean);
        multiply(&self.transport.phi, &state.spread, &mut self.product);
        self.array.reshape(n, 2 * n);
        self.array.fill(0.0);
        for i in 0..n {
            self.array.row_mut(i)[..n].copy_from_slice(self.product.row(i));
        }
        for i in 0..noise_root.rows() {
            self.array.row_mut(i)[n..n + noise_root.columns()].copy_from_slice(noise_root.row(i));
        }
        triangularise(&mut self.array);
        state.spread.copy_from(&self.array);
    }

    /// The updated array of mode `m`; false if it is not finite.
    pub fn innovate(&mut self, m: usize, state: &ModeState, sensor: &SensorModel, z: &[f64]) -> bool {
        let (n, d) = (state.mean.len(), sensor.rows());
        let RootInnovation { e, array } = &mut self.innovations[m];
        let e = &mut e[..d];
        apply(&sensor.h, &state.mean, e);
        e.iter_mut().zip(z).for_each(|(e, z)| *e = z - *e);
        multiply(&sensor.h, &state.spread, &mut self.projected);
        array.reshape(d + n, d + n);
        array.fill(0.0);
        for i in 0..d {
            let (noise, signal) = array.row_mut(i).split_at_mut(d);
            noise.copy_from_slice(sensor.r_root.row(i));
            signal.copy_from_slice(self.projected.row(i));
        }
        for i in 0..n {
            array.row_mut(d + i)[d..].copy_from_slice(state.spread.row(i));
        }
        triangularise(array);
        all_finite(e) && (0..d).all(|a| array[(a, a)] > 0.0 && array[(a, a)].is_finite())
    }

    /// Uses the array of mode `m`; returns log N(e; 0, S).
    pub fn update(&mut self, m: usize, state: &mut ModeState, sensor: &SensorModel) -> f64 {
        let d = sensor.rows();
        let RootInnovation { e, array } = &self.innovations[m];
        let whitened = &mut self.whitened[..d];
        whitened.copy_from_slice(&e[..d]);
        forward_substitution(array, whitened);
        for (i, mean) in state.mean.iter_mut().enumerate() {
            let (gain, factor) = array.row(d + i).split_at(d);
            *mean += dot(gain, whitened);
            state.spread.row_mut(i).copy_from_slice(factor);
        }
        log_density(array, whitened)
    }
}
