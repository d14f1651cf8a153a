//! The checked model (method sheet 2 and 3).

use super::{
    error::ChiSquareError,
    model_options::{MatricesOptions, Schedule},
    options::ChiSquareOptions,
};
use crate::{
    covariance::{CovarianceError, positive_definite_factor, semidefinite_factor, symmetric},
    matrix::Matrix,
    tables,
};
use nalgebra::{DMatrix, DVector};
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
    fn pad_noise(&mut self, columns: usize) {
        let mut padded = Matrix::zeros(self.noise_factor.rows(), columns);
        for i in 0..self.noise_factor.rows() {
            let row = self.noise_factor.row(i);
            padded.row_mut(i)[..row.len()].copy_from_slice(row);
        }
        self.noise_factor = padded;
    }
}

fn covariance_error(key: String, error: CovarianceError) -> ChiSquareError {
    match error {
        CovarianceError::NotSymmetric(row, column) => ChiSquareError::NotSymmetric { key, row, column },
        CovarianceError::NotPositiveDefinite => ChiSquareError::MeasurementNoiseNotPositiveDefinite { key },
        CovarianceError::NotPositiveSemidefinite | CovarianceError::NotSquare => {
            ChiSquareError::CovarianceNotPositiveSemidefinite { key }
        }
    }
}

/// The models of a diagnoser and where it starts.
#[derive(Clone, Debug)]
pub(super) struct Plant {
    pub schedule: Schedule,
    /// One, or those to choose from.
    pub models: Vec<StepModel>,
    /// x_0.
    pub initial_state: Vec<f64>,
    /// Factor of P_0, n x n.
    pub initial_factor: Matrix,
    /// u(0), if configured.
    pub initial_input: Option<Vec<f64>>,
    /// Numbers of the models over one assumed period.
    pub assumed_schedule: Option<Vec<usize>>,
}

impl Plant {
    /// Checks shapes, entries and covariances of everything in `model` and `models`.
    pub fn new(options: &ChiSquareOptions) -> Result<Self, ChiSquareError> {
        let selected = options.model.schedule == Schedule::Selected;
        let mut models = Vec::new();
        if selected {
            if options.models.is_empty() {
                return Err(ChiSquareError::Missing {
                    key: "models".to_owned(),
                    need: "give the models to choose from as [[diagnoser.models]]",
                });
            }
            if options.model.matrices() != MatricesOptions::default() {
                return Err(ChiSquareError::setting(
                    "model",
                    "a table with matrices",
                    "with `model.schedule` = \"selected\" move them to [[diagnoser.models]]",
                ));
            }
            for (number, matrices) in options.models.iter().enumerate() {
                models.push(StepModel::new(matrices, &format!("models.{number}"))?);
            }
        } else if !options.models.is_empty() {
            return Err(ChiSquareError::setting(
                "models",
                format!("a list of {}", options.models.len()),
                "set `model.schedule` to \"selected\" to choose between models, or remove it",
            ));
        } else {
            models.push(StepModel::new(&options.model.matrices(), "model")?);
        }
        let noises = models.iter().map(|model| model.counts()[3]).max().unwrap_or(0);
        models.iter_mut().for_each(|model| model.pad_noise(noises));
        if let Some(number) = models.iter().position(|model| !model.has_shapes_of(&models[0])) {
            return Err(ChiSquareError::setting(
                &format!("models.{number}"),
                "of another shape than model 0",
                "all models need the same numbers of states, inputs and measurements",
            ));
        }
        let [n, p, ..] = models[0].counts();
        let start = &options.model;
        let zero = vec![0.0; n];
        let state = tables::vector(
            "model.initial_state",
            start.initial_state.as_ref().unwrap_or(&zero),
            n,
            "states",
        )?;
        if start.initial_covariance.is_empty() {
            return Err(ChiSquareError::Missing {
                key: "model.initial_covariance".to_owned(),
                need: "give the covariance of the state at the start, n x n; zero if it is known",
            });
        }
        let covariance = tables::shaped_matrix(
            "model.initial_covariance",
            &start.initial_covariance,
            (n, n),
            "states x states",
        )?;
        let factor = semidefinite_factor(&covariance)
            .map_err(|error| covariance_error("model.initial_covariance".to_owned(), error))?;
        let input = |input: &Vec<f64>| tables::vector("model.initial_input", input, p, "inputs");
        let initial_input = start.initial_input.as_ref().map(input).transpose()?;
        let plant = Self {
            schedule: start.schedule,
            models,
            initial_state: state.as_slice().to_vec(),
            initial_factor: Matrix::from(&factor),
            initial_input: initial_input.map(|input: DVector<f64>| input.as_slice().to_vec()),
            assumed_schedule: start.assumed_schedule.clone(),
        };
        plant.check_assumed_schedule()?;
        Ok(plant)
    }

    fn check_assumed_schedule(&self) -> Result<(), ChiSquareError> {
        let Some(schedule) = &self.assumed_schedule else {
            return Ok(());
        };
        let key = "model.assumed_schedule";
        if self.schedule != Schedule::Selected {
            return Err(ChiSquareError::setting(
                key,
                "given",
                "it belongs to `model.schedule` = \"selected\"; remove it",
            ));
        }
        if schedule.is_empty() || schedule.iter().any(|number| *number >= self.models.len()) {
            return Err(ChiSquareError::setting(
                key,
                format!("{schedule:?}"),
                format!(
                    "list the numbers 0 to {} of models, at least one",
                    self.models.len() - 1
                ),
            ));
        }
        Ok(())
    }

    /// n, p, m, r.
    pub fn counts(&self) -> [usize; 4] {
        self.models.first().map_or([0; 4], StepModel::counts)
    }

    /// The dotted path of the table of a model.
    pub fn model_key(&self, number: usize) -> String {
        if self.schedule == Schedule::Selected {
            format!("models.{number}")
        } else {
            "model".to_owned()
        }
    }
}
