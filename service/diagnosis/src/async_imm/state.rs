//! What the bank knows after a fusion instant: everything that changes from one to the next.

use super::{
    decision::DecisionState,
    design::{Form, ImmDesign},
};
use crate::{
    covariance::semidefinite_factor,
    matrix::{Matrix, triangularise},
};
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// A larger entry of a mean or covariance is rejected: its square, which mixing and the square-root form need, would
/// not stay finite.
const LARGEST: f64 = 1e150;

/// One mode filter: \[x̂; φ̂\] and its uncertainty.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ModeState {
    /// Mean of \[x; φ\], n.
    pub mean: Vec<f64>,
    /// P (n x n), or in the square-root form its lower triangular factor L, P = L L'.
    pub spread: Matrix,
}

impl ModeState {
    pub(super) fn copy_from(&mut self, other: &Self) {
        self.mean.copy_from_slice(&other.mean);
        self.spread.copy_from(&other.spread);
    }

    /// Finite, the squares too, and no negative variance.
    fn is_sound(&self) -> bool {
        let moderate = |values: &[f64]| {
            values
                .iter()
                .fold(true, |all, value| all & (value.abs() <= LARGEST))
        };
        moderate(&self.mean)
            && self.spread.iter_rows().all(moderate)
            && (0..self.spread.rows()).all(|i| self.spread[(i, i)] >= 0.0)
    }

    fn fits(&self, other: &Self) -> bool {
        self.mean.len() == other.mean.len()
            && self.spread.shape() == other.spread.shape()
            && self.spread.has_room_of(&other.spread)
    }
}

/// The posterior at a fusion instant. A copy of it goes on exactly as the original.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Posterior {
    /// t_k, ns.
    pub instant_ns: i64,
    /// One filter per mode.
    pub modes: Vec<ModeState>,
    /// log μ, one per mode; -∞ for probability 0.
    pub log_probability: Vec<f64>,
    /// y⁻ of every sensor (batch form).
    pub held: Vec<Vec<f64>>,
    /// Counters of the decision rule.
    pub decision: DecisionState,
    /// Fusion instants that are still to be reported as start-up.
    pub startup_left: u32,
}

impl Posterior {
    /// The prior of a (checked) design at `instant_ns`.
    pub(super) fn prior(design: &ImmDesign, instant_ns: i64) -> Self {
        let (nx, n) = (design.plant.sizes().0, design.filter_states());
        let prior = &design.prior;
        let mut covariance = DMatrix::zeros(n, n);
        covariance
            .view_mut((0, 0), (nx, nx))
            .copy_from(&prior.state_covariance);
        covariance
            .view_mut((nx, nx), (n - nx, n - nx))
            .copy_from(&prior.amplitude_covariance);
        let spread = match design.form {
            Form::SequentialSquareRoot => lower_factor(&covariance),
            Form::Sequential | Form::BatchUnobserved => Matrix::from(&covariance),
        };
        let mode = ModeState {
            mean: [prior.state.as_slice(), &prior.amplitude].concat(),
            spread,
        };
        let held = design.sensors.iter().map(|sensor| {
            let predicted = || {
                let rows = sensor.measurement_matrix.row_iter();
                rows.map(|row| row.iter().zip(&prior.state).map(|(h, x)| h * x).sum())
                    .collect()
            };
            sensor.initial_held_value.clone().unwrap_or_else(predicted)
        });
        Self {
            instant_ns,
            modes: vec![mode; design.modes.len()],
            log_probability: prior.mode_probability.iter().map(|mu| mu.ln()).collect(),
            held: held.collect(),
            decision: DecisionState::default(),
            startup_left: 0,
        }
    }

    /// Takes the contents of a posterior of the same design.
    pub fn copy_from(&mut self, other: &Self) {
        self.instant_ns = other.instant_ns;
        for (mode, source) in self.modes.iter_mut().zip(&other.modes) {
            mode.copy_from(source);
        }
        self.log_probability.copy_from_slice(&other.log_probability);
        for (held, source) in self.held.iter_mut().zip(&other.held) {
            held.copy_from_slice(source);
        }
        self.decision = other.decision;
        self.startup_left = other.startup_left;
    }

    /// Means and covariances are finite, no variance is negative, no probability is lost.
    pub(super) fn is_sound(&self) -> bool {
        self.modes.iter().all(ModeState::is_sound) && !self.log_probability.iter().any(|log| log.is_nan())
    }

    /// Whether it has the lengths of another.
    pub(super) fn fits(&self, other: &Self) -> bool {
        let lengths = |held: &[Vec<f64>]| held.iter().map(Vec::len).collect::<Vec<_>>();
        self.modes.len() == other.modes.len()
            && self
                .modes
                .iter()
                .zip(&other.modes)
                .all(|(mode, other)| mode.fits(other))
            && self.log_probability.len() == other.log_probability.len()
            && lengths(&self.held) == lengths(&other.held)
            && self.decision.candidate < self.modes.len()
    }
}

/// L with L L' = the positive semidefinite matrix (zero if it is not one). Off-line.
pub(super) fn lower_factor(matrix: &DMatrix<f64>) -> Matrix {
    let mut factor = match semidefinite_factor(matrix) {
        Ok(factor) => Matrix::from(&factor),
        Err(_) => Matrix::zeros(matrix.nrows(), matrix.nrows()),
    };
    triangularise(&mut factor);
    factor
}
