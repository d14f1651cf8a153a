//! The state as one complete measurement shows it (method sheet 4.6).

use super::{
    plant::{Plant, UNIT_ROUNDOFF},
    state::SetState,
    workspace::Workspace,
};
use crate::{
    matrix::{Matrix, apply, dot},
    model::LinearModel,
};
use nalgebra::DMatrix;

/// Enclosure of the state by one complete measurement: x is in C⁺ y + \[-C⁺V, C⁺V\].
#[derive(Clone, Debug)]
pub(crate) struct Strip {
    pub gain: Matrix,
    /// C⁺ V.
    pub generators: Matrix,
    /// |C⁺| v.
    pub radius: Vec<f64>,
    /// |I - C⁺C| + 4 ny δ (I + |C⁺||C|): relative error of C⁺C x against x.
    identity_error: Matrix,
    outward: bool,
}

impl Strip {
    /// `None` if one measurement does not determine the state.
    pub fn new(model: &LinearModel, outward: bool) -> Option<Self> {
        let gain = model.strip_gain()?;
        let (nx, ny) = (model.state_count(), model.output_count());
        let identity = DMatrix::identity(nx, nx);
        let size = &identity + gain.abs() * model.c().abs();
        let error = (identity - &gain * model.c()).abs() + size * (4.0 * ny as f64 * UNIT_ROUNDOFF);
        Some(Self {
            radius: (gain.abs() * model.v()).as_slice().to_vec(),
            generators: Matrix::from(&(&gain * DMatrix::from_diagonal(model.v()))),
            gain: Matrix::from(&gain),
            identity_error: Matrix::from(&error),
            outward,
        })
    }

    /// Rounding error of the enclosure of row `i`, with `magnitude` = |C⁺y| + |C⁺|v (method sheet 4.6).
    fn rounding_error(&self, i: usize, magnitude: &[f64], y: &[f64], noise: &[f64]) -> f64 {
        if !self.outward {
            return 0.0;
        }
        let measured: f64 = self
            .gain
            .row(i)
            .iter()
            .zip(y)
            .zip(noise)
            .map(|((g, y), v)| g.abs() * (y.abs() + v))
            .sum();
        1.01 * dot(self.identity_error.row(i), magnitude) + 4.0 * y.len() as f64 * UNIT_ROUNDOFF * measured
    }
}

/// The set that one complete measurement gives, whatever the actuators do (method sheet 4.6).
///
/// The strip must be available and the packet complete.
pub(crate) fn reset_by_strip(
    plant: &Plant,
    strip: &Strip,
    y: &[f64],
    state: &mut SetState,
    work: &mut Workspace,
) {
    let nx = plant.nx();
    apply(&strip.gain, y, &mut state.centre);
    state.generators.copy_from(&strip.generators);
    if plant.epsilon > 0.0 {
        for i in 0..nx {
            state.radius[i] = state.centre[i].abs() + strip.radius[i];
        }
        for i in 0..nx {
            work.error[i] = strip.rounding_error(i, &state.radius, y, &plant.noise).next_up();
        }
        state.generators.append_diagonal(&work.error);
    }
    state.unbounded.reshape(nx, 0);
    state.void = false;
    state.update_radius();
}
