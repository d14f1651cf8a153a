//! A structure as a user writes it down, and as the search uses it.

use super::entry::{EntryMatrix, EntryOptions, FreeOptions, Parameter, Parameters};
use super::error::StructureError;
use crate::identify::likelihood::filter::Plant;
use crate::identify::likelihood::noise::NoiseForm;
use nalgebra::{DMatrix, DVector};
use residual_diagnosis::discretise::matrix_exponential;
use residual_diagnosis::model::Time;
use residual_diagnosis::tables::{self, TableError};
use serde::Deserialize;
use std::collections::BTreeMap;

/// x_{k+1} = A x_k + B u_k + D d_k, y_k = C x_k + feedthrough u_k + v_k, or the same with dx/dt; rows of entries.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StructureOptions {
    /// Whether A, B and D are per step (default) or per second.
    #[serde(default)]
    pub time: Time,
    /// State matrix, nx x nx.
    #[serde(rename = "A")]
    pub a: Vec<Vec<EntryOptions>>,
    /// Input matrix, nx x nu.
    #[serde(rename = "B", default)]
    pub b: Vec<Vec<EntryOptions>>,
    /// Output matrix, ny x nx.
    #[serde(rename = "C")]
    pub c: Vec<Vec<EntryOptions>>,
    /// What a command adds to the output of its own instant, ny x nu; default none.
    #[serde(default)]
    pub feedthrough: Vec<Vec<EntryOptions>>,
    /// Disturbance matrix, nx x nd; default none. Disturbances are held over a step.
    #[serde(rename = "D", default)]
    pub d: Vec<Vec<EntryOptions>>,
    /// Named parameters, for entries that depend on each other.
    #[serde(default)]
    pub parameters: BTreeMap<String, FreeOptions>,
    /// Covariance of d at the start, nd x nd. Diagonal: its zeros stay; otherwise all entries are free. Default:
    /// diagonal, a guess from the data.
    #[serde(default)]
    pub disturbance_covariance: Option<Vec<Vec<f64>>>,
    /// Covariance of v at the start, ny x ny, likewise.
    #[serde(default)]
    pub measurement_noise_covariance: Option<Vec<Vec<f64>>>,
    /// Centre of the box that contains the state at the start of a run, length nx. Default: zero.
    #[serde(default)]
    pub initial_state_center: Option<Vec<f64>>,
    /// Its radius, length nx, > 0. The search takes the state as spread evenly over the box.
    pub initial_state_radius: Vec<f64>,
}

/// A checked structure.
#[derive(Clone, Debug)]
pub struct Structure {
    time: Time,
    sample_time_s: f64,
    a: EntryMatrix,
    b: EntryMatrix,
    c: EntryMatrix,
    feedthrough: EntryMatrix,
    d: EntryMatrix,
    pub(super) parameters: Vec<Parameter>,
    pub(super) disturbance: Option<NoiseForm>,
    pub(super) measurement: Option<NoiseForm>,
    pub(super) initial: (DVector<f64>, DMatrix<f64>),
    command_count: usize,
}

const PER_STATE: &str = "one number for each state";

fn shape(matrix: (usize, usize)) -> String {
    format!("{} x {}", matrix.0, matrix.1)
}

impl Structure {
    /// Checks the options for a sampling period in seconds, `command_count` commands and `output_count` measurements.
    ///
    /// # Errors
    /// [`StructureError`]: the entry that is wrong and what to do about it.
    pub fn new(
        options: &StructureOptions,
        sample_time_s: f64,
        output_count: usize,
        command_count: usize,
    ) -> Result<Self, StructureError> {
        let mut parameters = Parameters::new(&options.parameters)?;
        let mut read = |key: &str, rows: &[Vec<EntryOptions>]| EntryMatrix::new(key, rows, &mut parameters);
        let a = read("A", &options.a)?;
        let nx = options.a.len();
        let zero = |rows: usize, columns: usize| vec![vec![EntryOptions::Number(0.0); columns]; rows];
        let or_zero = |rows: &Vec<Vec<EntryOptions>>, shape: (usize, usize)| {
            if rows.is_empty() {
                zero(shape.0, shape.1)
            } else {
                rows.clone()
            }
        };
        let b = read("B", &or_zero(&options.b, (nx, command_count)))?;
        let c = read("C", &options.c)?;
        let feedthrough = read(
            "feedthrough",
            &or_zero(&options.feedthrough, (output_count, command_count)),
        )?;
        let d = read("D", &or_zero(&options.d, (nx, 0)))?;
        parameters.all_used()?;
        let nd = d.shape().1;
        let expected = [
            ("A", &a, (nx.max(1), nx.max(1)), "states x states"),
            ("B", &b, (nx, command_count), "states x commands"),
            ("C", &c, (output_count.max(1), nx), "measurements x states"),
            (
                "feedthrough",
                &feedthrough,
                (output_count, command_count),
                "measurements x commands",
            ),
            ("D", &d, (nx, nd), "states x disturbances"),
        ];
        for (key, matrix, expected, meaning) in expected {
            if matrix.shape() != expected {
                return Err(TableError::Shape {
                    key: key.to_owned(),
                    actual: shape(matrix.shape()),
                    expected: shape(expected),
                    meaning,
                }
                .into());
            }
        }
        let form = |key, covariance: &Option<Vec<Vec<f64>>>, size| {
            covariance
                .as_ref()
                .map(|rows| noise_form(key, rows, size))
                .transpose()
        };
        let disturbance = form("disturbance_covariance", &options.disturbance_covariance, nd)?;
        let key = "measurement_noise_covariance";
        let measurement = form(key, &options.measurement_noise_covariance, output_count)?;
        if let Some(form) = &measurement
            && form.start_deviations().contains(&0.0)
        {
            let help = "measurement noise needs a variance above 0";
            return Err(StructureError::Value {
                key,
                value: 0.0,
                help,
            });
        }
        let center = options
            .initial_state_center
            .clone()
            .unwrap_or_else(|| vec![0.0; nx]);
        let center = tables::vector("initial_state_center", &center, nx, PER_STATE)?;
        let key = "initial_state_radius";
        let radius = tables::vector(key, &options.initial_state_radius, nx, PER_STATE)?;
        if let Some(&value) = radius.iter().find(|radius| **radius <= 0.0) {
            let help = "use numbers above 0, wide enough for wherever a run begins";
            return Err(StructureError::Value { key, value, help });
        }
        // Spread evenly over [-r, r]: variance r²/3.
        let spread = DMatrix::from_diagonal(&radius.map(|radius| radius * radius / 3.0));
        Ok(Self {
            time: options.time,
            sample_time_s,
            a,
            b,
            c,
            feedthrough,
            d,
            parameters: parameters.all,
            disturbance,
            measurement,
            initial: (center, spread),
            command_count,
        })
    }

    /// The same structure with another mean and covariance (nx x nx, positive semidefinite) of the first state.
    #[must_use]
    pub fn with_initial_state(mut self, mean: DVector<f64>, covariance: DMatrix<f64>) -> Self {
        self.initial = (mean, covariance);
        self
    }

    /// Number of outputs.
    pub fn output_count(&self) -> usize {
        self.c.shape().0
    }

    /// Number of commands.
    pub fn command_count(&self) -> usize {
        self.command_count
    }

    /// Whether the model is discretised with the sampling period.
    pub fn is_continuous(&self) -> bool {
        self.time == Time::Continuous
    }

    /// Whether any entry that multiplies this command is free.
    pub(super) fn is_command_free(&self, command: usize) -> bool {
        self.b.is_column_free(command) || self.feedthrough.is_column_free(command)
    }

    /// The matrices of these parameters, per step or per second as in the structure.
    pub(super) fn matrices(&self, parameters: &[f64]) -> Plant {
        Plant {
            a: self.a.evaluate(parameters),
            b: self.b.evaluate(parameters),
            c: self.c.evaluate(parameters),
            feedthrough: self.feedthrough.evaluate(parameters),
            disturbance: self.d.evaluate(parameters),
        }
    }

    /// The discrete-time model of matrices as in the structure; `None` if it is not finite.
    pub(super) fn discrete(&self, matrices: Plant) -> Option<Plant> {
        let plant = if self.is_continuous() {
            zero_order_hold(matrices, self.sample_time_s)
        } else {
            matrices
        };
        plant.is_finite().then_some(plant)
    }
}

/// Commands and disturbances held over a period: exp of [A, B, D; 0, 0, 0] T has the three matrices in its first rows.
fn zero_order_hold(continuous: Plant, sample_time_s: f64) -> Plant {
    let (nx, nu, nd) = (
        continuous.a.nrows(),
        continuous.b.ncols(),
        continuous.disturbance.ncols(),
    );
    let mut augmented = DMatrix::zeros(nx + nu + nd, nx + nu + nd);
    augmented.view_mut((0, 0), (nx, nx)).copy_from(&continuous.a);
    augmented.view_mut((0, nx), (nx, nu)).copy_from(&continuous.b);
    augmented
        .view_mut((0, nx + nu), (nx, nd))
        .copy_from(&continuous.disturbance);
    let exponential = matrix_exponential(&(augmented * sample_time_s));
    Plant {
        a: exponential.view((0, 0), (nx, nx)).into_owned(),
        b: exponential.view((0, nx), (nx, nu)).into_owned(),
        disturbance: exponential.view((0, nx + nu), (nx, nd)).into_owned(),
        ..continuous
    }
}

fn noise_form(key: &'static str, rows: &[Vec<f64>], size: usize) -> Result<NoiseForm, StructureError> {
    let covariance = tables::shaped_matrix(key, rows, (size, size), "one row and column for each noise")?;
    NoiseForm::like(&covariance).map_err(|reason| StructureError::Covariance { key, reason })
}
