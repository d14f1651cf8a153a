//! Bound of the rounding errors of x̂ and r in the residual.

use crate::matrix::{Matrix, absolute_dot};
use nalgebra::DMatrix;

/// How rounding errors of x̂ and r reach the residual: ε (P_x |x̂| + P_u |u| + P_y |y| + P_r |r|).
#[derive(Clone, Debug)]
pub(super) struct Rounding {
    unit: f64,
    of_state: Matrix,
    of_command: Matrix,
    of_output: Matrix,
    of_residual: Matrix,
}

/// Present sample, for the bound of its rounding errors.
pub(super) struct Magnitudes<'a> {
    pub x: &'a [f64],
    pub u: &'a [f64],
    /// y and r, if received.
    pub sample: Option<(&'a [f64], &'a [f64])>,
}

impl Rounding {
    /// From |V|, |C|, |D|, |Ad|, |Bud|, |L| and the gain |V C (zI - Ac)⁻¹|₁ from the state to the residual.
    pub fn new(absolute: &[DMatrix<f64>; 6], through_state: &DMatrix<f64>) -> Self {
        let [v, c, d, ad, bud, l] = absolute;
        Self {
            unit: f64::EPSILON * (c.ncols() + d.ncols() + c.nrows() + 2) as f64,
            of_state: Matrix::from(&(v * c + through_state * ad)),
            of_command: Matrix::from(&(v * d + through_state * bud)),
            of_output: Matrix::from(v),
            of_residual: Matrix::from(&(through_state * l)),
        }
    }

    /// The bound of this instant, and of earlier ones as far as they live on.
    pub fn update(&self, bound: &mut [f64], sample: &Magnitudes<'_>, rate: f64) {
        for (i, bound) in bound.iter_mut().enumerate() {
            let mut size =
                absolute_dot(sample.x, self.of_state.row(i)) + absolute_dot(sample.u, self.of_command.row(i));
            if let Some((y, r)) = sample.sample {
                size += absolute_dot(y, self.of_output.row(i)) + absolute_dot(r, self.of_residual.row(i));
            }
            *bound = (*bound * rate).max(self.unit * size);
        }
    }
}
