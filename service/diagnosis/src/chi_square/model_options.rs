//! The model as a user writes it down (method sheet 2 and 7).

use serde::{Deserialize, Serialize};

/// How the matrices change from instant to instant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Schedule {
    /// One model for all instants.
    #[default]
    Constant,
    /// One of `models`, chosen at every instant by the last command: its number, counted from 0. The number of
    /// instant k selects the model that leads from k-1 to k and measures at k.
    Selected,
    /// Matrices given before every step through
    /// [`set_model`](super::ChiSquareDiagnoser::set_model); only for programs that use this library.
    External,
}

/// One model: matrices as lists of rows, per step, in the plant's units.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MatricesOptions {
    /// Φ, n x n.
    pub transition: Vec<Vec<f64>>,
    /// B, n x p. Default: zero, or no input.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub input: Vec<Vec<f64>>,
    /// Γ, n x r. Default: the unit matrix.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub process_noise_input: Vec<Vec<f64>>,
    /// Q, r x r, symmetric and positive semidefinite.
    pub process_noise_covariance: Vec<Vec<f64>>,
    /// H, m x n.
    pub measurement: Vec<Vec<f64>>,
    /// D, m x p. Default: zero, or no input.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub feedthrough: Vec<Vec<f64>>,
    /// R, m x m, symmetric and positive definite, sensor units squared.
    pub measurement_noise_covariance: Vec<Vec<f64>>,
}

/// The table `[diagnoser.model]`: matrices (with `schedule = "selected"` they stand in `[[diagnoser.models]]`),
/// start and names.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ModelOptions {
    /// Φ, n x n.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub transition: Vec<Vec<f64>>,
    /// B, n x p. Default: zero, or no input.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub input: Vec<Vec<f64>>,
    /// Γ, n x r. Default: the unit matrix.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub process_noise_input: Vec<Vec<f64>>,
    /// Q, r x r, symmetric and positive semidefinite.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub process_noise_covariance: Vec<Vec<f64>>,
    /// H, m x n.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub measurement: Vec<Vec<f64>>,
    /// D, m x p. Default: zero, or no input.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub feedthrough: Vec<Vec<f64>>,
    /// R, m x m, symmetric and positive definite, sensor units squared.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub measurement_noise_covariance: Vec<Vec<f64>>,
    /// Mean of x(0), length n, state units. Default: zero.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub initial_state: Option<Vec<f64>>,
    /// P_0, n x n, symmetric and positive semidefinite, state units squared; zero means that x(0) is known.
    pub initial_covariance: Vec<Vec<f64>>,
    /// u(0), length p. Default: the first complete command, which then belongs to instant 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub initial_input: Option<Vec<f64>>,
    /// `"constant"` (default), `"selected"` or `"external"`.
    pub schedule: Schedule,
    /// With `schedule = "selected"`: the numbers of the models over one period, for the calibration and the stability
    /// guard. Default: unknown; the calibration then uses every model for an equal share of the run.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub assumed_schedule: Option<Vec<usize>>,
    /// Names of the states, length n, unique. Default: `state_0`, `state_1`, ...
    #[serde(skip_serializing_if = "Option::is_none")]
    pub state_names: Option<Vec<String>>,
    /// Units of the states, length n. Default: empty.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub state_units: Option<Vec<String>>,
    /// Names of the measurements, length m, unique; also the names of their faults. Default: the signals' names.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub measurement_names: Option<Vec<String>>,
    /// Units of the measurements, length m. Default: the signals' units.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub measurement_units: Option<Vec<String>>,
}

impl ModelOptions {
    /// The matrices that stand in this table.
    pub fn matrices(&self) -> MatricesOptions {
        MatricesOptions {
            transition: self.transition.clone(),
            input: self.input.clone(),
            process_noise_input: self.process_noise_input.clone(),
            process_noise_covariance: self.process_noise_covariance.clone(),
            measurement: self.measurement.clone(),
            feedthrough: self.feedthrough.clone(),
            measurement_noise_covariance: self.measurement_noise_covariance.clone(),
        }
    }
}

impl MatricesOptions {
    /// Rows of the measurement.
    pub fn measurement_count(&self) -> usize {
        self.measurement.len()
    }

    /// Columns of B, or of D where there is no B.
    pub fn input_count(&self) -> usize {
        let columns = |rows: &[Vec<f64>]| rows.first().map_or(0, Vec::len);
        columns(&self.input).max(columns(&self.feedthrough))
    }
}
