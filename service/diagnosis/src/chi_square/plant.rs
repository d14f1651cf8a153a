//! The checked model (method sheet 2 and 3).

use super::{
    error::ChiSquareError,
    model_options::{MatricesOptions, Schedule},
    options::ChiSquareOptions,
    step_model::{StepModel, covariance_error},
};
use crate::{covariance::semidefinite_factor, matrix::Matrix, tables};
use nalgebra::DVector;

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
