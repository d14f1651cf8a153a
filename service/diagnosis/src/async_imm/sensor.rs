//! One sensor as the filters use it.

use super::design::Sensor;
use crate::{covariance::positive_definite_factor, matrix::Matrix};

/// H̄ = \[H 0\], R and its factor.
#[derive(Clone, Debug)]
pub(super) struct SensorModel {
    /// \[H 0\], d x n.
    pub h: Matrix,
    /// H, d x n_x.
    pub h_plant: Matrix,
    /// R, d x d.
    pub r: Matrix,
    /// Lower triangular R^{1/2}.
    pub r_root: Matrix,
    /// The entries of H that are not zero, row by row: (column, value).
    pub entries: Vec<Vec<(usize, f64)>>,
    /// β.
    pub arrival: f64,
}

impl SensorModel {
    /// Of a (checked) sensor, for filters with `n` states.
    pub fn new(sensor: &Sensor, n: usize) -> Self {
        let h = &sensor.measurement_matrix;
        let padded = h.clone().resize_horizontally(n, 0.0);
        let root = positive_definite_factor(&sensor.noise_covariance);
        let entries = h.row_iter().map(|row| {
            let entries = row.iter().copied().enumerate();
            entries.filter(|(_, entry)| *entry != 0.0).collect()
        });
        Self {
            entries: entries.collect(),
            h: Matrix::from(&padded),
            h_plant: Matrix::from(h),
            r: Matrix::from(&sensor.noise_covariance),
            r_root: Matrix::from(&root.unwrap_or_else(|_| sensor.noise_covariance.clone())),
            arrival: sensor.arrival_probability,
        }
    }

    /// d.
    pub fn rows(&self) -> usize {
        self.h.rows()
    }
}
