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
        let mut out =
            half_width * (1.0 + self.epsilon) + 8.0 * self.epsilon * absolute_dot(row, self.output_size);
        for (k, fault) in self.own_fault.iter().enumerate() {
            let (leak, size) = self.leak(row, k);
            out += (leak.abs() + 4.0 * self.epsilon * size) * fault;
        }
        out
    }

    /// The radius of the estimate `estimate` of the own fault `own` with coefficients `row`, enlarged; this
    /// includes what `row` C F1 differs from the unit row times the bound of the faults.
    pub fn estimate_radius(&self, radius: f64, row: &[f64], own: usize, estimate: f64) -> f64 {
        let size = absolute_dot(row, self.output_size) + estimate.abs();
        let mut out = radius * (1.0 + self.epsilon) + 8.0 * self.epsilon * size;
        for (k, fault) in self.own_fault.iter().enumerate() {
            let (leak, size) = self.leak(row, k);
            let unit = f64::from(u8::from(self.decoupling.pivot[k] == own));
            out += ((unit - leak).abs() + 4.0 * self.epsilon * size) * fault;
        }
        out
    }

    /// η of state row `i` corrected with the row `gain` of L.
    pub fn state_error(&self, i: usize, gain: &[f64]) -> f64 {
        let size = self.prediction_size[i] + absolute_dot(gain, self.output_size);
        let mut out = 8.0 * self.epsilon * size;
        for (k, fault) in self.own_fault.iter().enumerate() {
            let direction = self.decoupling.columns[(i, k)];
            let (leak, size) = self.leak(gain, k);
            out += ((direction - leak).abs() + 4.0 * self.epsilon * (direction.abs() + size)) * fault;
        }
        out
    }

    /// `row` C F1 and |`row`| |C| |F1| for the decoupled direction `k`.
    fn leak(&self, row: &[f64], k: usize) -> (f64, f64) {
        let mut sums = (0.0, 0.0);
        for (j, weight) in row.iter().enumerate() {
            sums.0 += weight * self.decoupling.seen[(j, k)];
            sums.1 += weight.abs() * self.decoupling.seen_size[(j, k)];
        }
        sums
    }
}
