//! Intervals of the plant's state from a complete sample (method sheet 4, step 5).
//!
//! x̂ = T_c⁻¹ \[y; ẑ2 - K y\] + X_R c, radius = row sums of X_R H + tx\[j\], with X_R = \[0, T_c⁻¹ \[0; I\]\] and
//! X_V = T_c⁻¹ \[-I; K\]. Valid only while no fault acts.

use super::{
    filter::FilterState,
    observer_design::ObserverDesign,
    plant::{Plant, beside, stack},
};
use crate::matrix::{Matrix, absolute_sum, apply, combination, dot};
use nalgebra::DMatrix;

/// The tables, and the interval of the last instant.
#[derive(Clone, Debug)]
pub(super) struct StateInterval {
    inverse: Matrix,
    gain: Matrix,
    /// X_R, n x n.
    rows: Matrix,
    /// tx, (J + 1) x n.
    table: Matrix,
    coordinates: Vec<f64>,
    pub centre: Vec<f64>,
    pub radius: Vec<f64>,
    /// Whether the last instant had an interval.
    pub valid: bool,
}

impl StateInterval {
    pub fn new(plant: &Plant, design: &ObserverDesign) -> Self {
        let (n, p, nz) = (plant.states(), plant.outputs(), plant.hidden());
        let k = &design.observer.k;
        let lower = stack(&DMatrix::zeros(p, nz), &DMatrix::identity(nz, nz));
        let rows = beside(&DMatrix::zeros(n, p), &(&plant.inverse * lower));
        let noise_rows = &plant.inverse * stack(&-DMatrix::<f64>::identity(p, p), k);
        Self {
            inverse: Matrix::from(&plant.inverse),
            gain: Matrix::from(k),
            table: Matrix::from(&design.reach.half_widths(&rows, &noise_rows)),
            rows: Matrix::from(&rows),
            coordinates: vec![0.0; n],
            centre: vec![0.0; n],
            radius: vec![0.0; n],
            valid: false,
        }
    }

    /// The interval at an instant whose sample `y` is complete. `image` has room for the columns of H.
    pub fn evaluate(&mut self, state: &FilterState, y: &[f64], image: &mut [f64]) {
        let (measured, hidden) = self.coordinates.split_at_mut(y.len());
        measured.copy_from_slice(y);
        for ((target, z2), gain) in hidden.iter_mut().zip(&state.z2).zip(self.gain.iter_rows()) {
            *target = z2 - dot(gain, y);
        }
        apply(&self.inverse, &self.coordinates, &mut self.centre);
        let image = image.get_mut(..state.generators.columns()).unwrap_or_default();
        let widths = self.table.row(state.age as usize);
        let targets = self.centre.iter_mut().zip(&mut self.radius).zip(widths);
        for (((centre, radius), width), row) in targets.zip(self.rows.iter_rows()) {
            *centre += dot(row, &state.centre);
            *radius = *width;
            if !image.is_empty() {
                combination(image, row, &state.generators);
                *radius += absolute_sum(image);
            }
        }
        self.valid = true;
    }
}
