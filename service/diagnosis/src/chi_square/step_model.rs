//! The matrices of one instant (method sheet 2).

use super::{error::ChiSquareError, model_options::MatricesOptions};
use crate::{
    covariance::{CovarianceError, positive_definite_factor, semidefinite_factor, symmetric},
    matrix::Matrix,
    tables,
};
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// The matrices of one instant. They may be written in place; the shapes must stay.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StepModel {
    /// Φ, n x n.
    pub transition: Matrix,
    /// B, n x p.
    pub input: Matrix,
    /// H, m x n.
    pub measurement: Matrix,
    /// D, m x p.
    pub feedthrough: Matrix,
    /// G, n x r: G G' is the covariance of w.
    pub noise_factor: Matrix,
    /// R, m x m, symmetric and positive definite.
    pub measurement_noise: Matrix,
}

impl StepModel {
    /// Checks and takes over one model; `key` is the dotted path of its table.
    ///
    /// # Errors
    /// [`ChiSquareError`]: the first condition that does not hold.
    pub fn new(options: &MatricesOptions, key: &str) -> Result<Self, ChiSquareError> {
        let name = |entry: &str| format!("{key}.{entry}");
        let missing = |entry: &str, need| ChiSquareError::Missing {
            key: name(entry),
            need,
        };
        let n = options.transition.len();
        if n == 0 {
            return Err(missing(
                "transition",
                "give the matrix that leads from one instant to the next, n x n",
            ));
        }
        let m = options.measurement_count();
        if m == 0 {
            return Err(missing("measurement", "give the matrix of the sensors, m x n"));
        }
        let p = options.input_count();
        let shaped = |entry: &str, rows: &[Vec<f64>], shape, meaning| {
            tables::shaped_matrix(&name(entry), rows, shape, meaning)
        };
        let optional = |entry: &str, rows: &[Vec<f64>], shape, meaning| {
            if rows.is_empty() {
                let (rows, columns) = shape;
                Ok(DMatrix::zeros(rows, columns))
            } else {
                shaped(entry, rows, shape, meaning)
            }
        };
        let transition = shaped("transition", &options.transition, (n, n), "states x states")?;
        let measurement = shaped(
            "measurement",
            &options.measurement,
            (m, n),
            "measurements x states",
        )?;
        let input = optional("input", &options.input, (n, p), "states x inputs")?;
        let feedthrough = optional(
            "feedthrough",
            &options.feedthrough,
            (m, p),
            "measurements x inputs",
        )?;
        let r = options.process_noise_covariance.len();
        let noise_input = if options.process_noise_input.is_empty() {
            if r != n {
                return Err(missing(
                    "process_noise_input",
                    "give the matrix through which the noise enters, n x r, or a process_noise_covariance of n x n",
                ));
            }
            DMatrix::identity(n, n)
        } else {
            shaped(
                "process_noise_input",
                &options.process_noise_input,
                (n, r),
                "states x noises",
            )?
        };
        let q = shaped(
            "process_noise_covariance",
            &options.process_noise_covariance,
            (r, r),
            "noises x noises",
        )?;
        let noise = shaped(
            "measurement_noise_covariance",
            &options.measurement_noise_covariance,
            (m, m),
            "measurements x measurements",
        )?;
        let factor =
            semidefinite_factor(&q).map_err(|e| covariance_error(name("process_noise_covariance"), e))?;
        let refused = |e| covariance_error(name("measurement_noise_covariance"), e);
        positive_definite_factor(&noise).map_err(refused)?;
        Ok(Self {
            transition: Matrix::from(&transition),
            input: Matrix::from(&input),
            measurement: Matrix::from(&measurement),
            feedthrough: Matrix::from(&feedthrough),
            noise_factor: Matrix::from(&(noise_input * factor)),
            measurement_noise: Matrix::from(&symmetric(&noise).map_err(refused)?),
        })
    }

    /// n, p, m, r.
    pub fn counts(&self) -> [usize; 4] {
        [
            self.transition.rows(),
            self.input.columns(),
            self.measurement.rows(),
            self.noise_factor.columns(),
        ]
    }

    /// Whether every matrix has the shape of another model's.
    pub fn has_shapes_of(&self, other: &Self) -> bool {
        let shapes = |model: &Self| {
            [
                &model.transition,
                &model.input,
                &model.measurement,
                &model.feedthrough,
                &model.noise_factor,
                &model.measurement_noise,
            ]
            .map(Matrix::shape)
        };
        shapes(self) == shapes(other)
    }

    pub(super) fn copy_from(&mut self, other: &Self) {
        self.transition.copy_from(&other.transition);
        self.input.copy_from(&other.input);
        self.measurement.copy_from(&other.measurement);
        self.feedthrough.copy_from(&other.feedthrough);
        self.noise_factor.copy_from(&other.noise_factor);
        self.measurement_noise.copy_from(&other.measurement_noise);
    }

    /// Appends zero columns to G, so that models with different numbers of noises have one shape.
    pub(super) fn pad_noise(&mut self, columns: usize) {
        let mut padded = Matrix::zeros(self.noise_factor.rows(), columns);
        for i in 0..self.noise_factor.rows() {
            let row = self.noise_factor.row(i);
            padded.row_mut(i)[..row.len()].copy_from_slice(row);
        }
        self.noise_factor = padded;
    }
}

pub(super) fn covariance_error(key: String, error: CovarianceError) -> ChiSquareError {
    match error {
        CovarianceError::NotSymmetric(row, column) => ChiSquareError::NotSymmetric { key, row, column },
        CovarianceError::NotPositiveDefinite => ChiSquareError::MeasurementNoiseNotPositiveDefinite { key },
        CovarianceError::NotPositiveSemidefinite | CovarianceError::NotSquare => {
            ChiSquareError::CovarianceNotPositiveSemidefinite { key }
        }
    }
}

/// Why the matrices of an instant were refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SetModelError {
    /// The model is configured.
    #[error("the model is configured; set `model.schedule` to \"external\" to give one")]
    NotExternal,
    /// The shapes are not those of the configured model.
    #[error("the matrices have other shapes than those of the configured model; keep the shapes")]
    Shape,
}
