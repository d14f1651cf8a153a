//! When the covariance part of the filter stands still.
//!
//! With a constant model and complete rows L_P converges until its last bits wander; from then on gains, windows and
//! signatures would be computed again and again to the same numbers. So L_P is held once a step changes it by no
//! more than [`TOLERANCE`] of a row's norm, and with it everything that depends on nothing but the gains. What is
//! held is a function of model and L_P alone: a restored filter finds the same bits in its next step.

use super::{steady::has_settled, step_model::StepModel};
use crate::matrix::Matrix;

/// Change of L_P by one step that counts as rounding, in parts of the norm of a row.
const TOLERANCE: f64 = 4.0 * f64::EPSILON;

/// The L_P that is held, and the model that it belongs to.
#[derive(Clone, Debug)]
pub(super) struct Settled {
    holds: bool,
    factor: Matrix,
    transition: Matrix,
    noise_factor: Matrix,
    measurement: Matrix,
    measurement_noise: Matrix,
}

impl Settled {
    /// Nothing is held; room for n states, m measurements, r noises.
    pub fn new(states: usize, measurements: usize, noises: usize) -> Self {
        Self {
            holds: false,
            factor: Matrix::zeros(states, states),
            transition: Matrix::zeros(states, states),
            noise_factor: Matrix::zeros(states, noises),
            measurement: Matrix::zeros(measurements, states),
            measurement_noise: Matrix::zeros(measurements, measurements),
        }
    }

    /// Whether a complete update of `factor` with this model is the one that is held.
    pub fn holds(&self, model: &StepModel, factor: &Matrix) -> bool {
        self.holds
            && self.factor == *factor
            && self.transition == model.transition
            && self.noise_factor == model.noise_factor
            && self.measurement == model.measurement
            && self.measurement_noise == model.measurement_noise
    }

    /// Before an update of `factor`.
    pub fn begin(&mut self, factor: &Matrix) {
        self.holds = false;
        self.factor.copy_from(factor);
    }

    /// After a complete update: puts `factor` back if it hardly changed, and holds it. Returns whether it does.
    pub fn hold(&mut self, model: &StepModel, factor: &mut Matrix) -> bool {
        self.holds = has_settled(&self.factor, factor, TOLERANCE);
        if self.holds {
            factor.copy_from(&self.factor);
            self.transition.copy_from(&model.transition);
            self.noise_factor.copy_from(&model.noise_factor);
            self.measurement.copy_from(&model.measurement);
            self.measurement_noise.copy_from(&model.measurement_noise);
        }
        self.holds
    }
}
