//! Bounds of the rounding errors of one step (method sheet 4.9).
//!
//! | symbol | here | meaning |
//! |---|---|---|
//! | ε | `epsilon` | relative error of every sum of the step |
//! | κ | `prediction_size` | size of all terms of the predicted state |
//! | \|y\| + \|C\|κ + v | `output_size` | size of all terms of the residual |
//! | F1, f̄ | `decoupling`, `own_fault` | decoupled directions and the bound of their inputs from the data |
//!
//! Own faults are unbounded, so that W C F1 = 0 must hold to rounding and what is left of it is multiplied by f̄.

use super::decoupling::Decoupling;
use crate::matrix::absolute_dot;

/// The data that bound the rounding errors of one step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Outward<'a> {
    pub epsilon: f64,
    pub prediction_size: &'a [f64],
    pub output_size: &'a [f64],
    pub own_fault: &'a [f64],
    pub decoupling: &'a Decoupling,
}

impl Outward<'_> {
    /// The half width `half_width` of the test row `row`, enlarged.
    pub fn half_width(&self, half_width: f64, row: &[f64]) -> f64 {
        let leaks = (0..self.own_fault.len()).map(|k| self.decoupling.leak(row, k, self.epsilon));
        self.widened(half_width, absolute_dot(row, self.output_size), leaks)
    }

    /// The same with the [`Decoupling::leaks`] of the row.
    pub fn half_width_with(&self, half_width: f64, row: &[f64], leaks: &[f64]) -> f64 {
        self.widened(
            half_width,
            absolute_dot(row, self.output_size),
            leaks.iter().copied(),
        )
    }

    /// The radius of the estimate `estimate` of the own fault `own` with coefficients `row`, enlarged; this
    /// includes what `row` C F1 differs from the unit row times the bound of the faults.
    pub fn estimate_radius(&self, radius: f64, row: &[f64], own: usize, estimate: f64) -> f64 {
        let leaks =
            (0..self.own_fault.len()).map(|k| self.decoupling.estimate_leak(row, own, k, self.epsilon));
        self.widened(
            radius,
            absolute_dot(row, self.output_size) + estimate.abs(),
            leaks,
        )
    }

    /// The same with the [`Decoupling::estimate_leaks`] of the row.
    pub fn estimate_radius_with(&self, radius: f64, row: &[f64], estimate: f64, leaks: &[f64]) -> f64 {
        let size = absolute_dot(row, self.output_size) + estimate.abs();
        self.widened(radius, size, leaks.iter().copied())
    }

    /// η of state row `i` corrected with the row `gain` of L.
    pub fn state_error(&self, i: usize, gain: &[f64]) -> f64 {
        let leaks = (0..self.own_fault.len()).map(|k| self.decoupling.state_leak(i, gain, k, self.epsilon));
        self.with_leaks(8.0 * self.epsilon * self.state_size(i, gain), leaks)
    }

    /// The same with the [`Decoupling::state_leaks`] of the row.
    pub fn state_error_with(&self, i: usize, gain: &[f64], leaks: &[f64]) -> f64 {
        self.with_leaks(
            8.0 * self.epsilon * self.state_size(i, gain),
            leaks.iter().copied(),
        )
    }

    fn state_size(&self, i: usize, gain: &[f64]) -> f64 {
        self.prediction_size[i] + absolute_dot(gain, self.output_size)
    }

    fn widened(&self, width: f64, size: f64, leaks: impl Iterator<Item = f64>) -> f64 {
        self.with_leaks(width * (1.0 + self.epsilon) + 8.0 * self.epsilon * size, leaks)
    }

    fn with_leaks(&self, start: f64, leaks: impl Iterator<Item = f64>) -> f64 {
        let shares = leaks.zip(self.own_fault).map(|(leak, fault)| leak * fault);
        shares.fold(start, |sum, share| sum + share)
    }
}
