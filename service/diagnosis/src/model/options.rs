//! The model as a user writes it down.

use serde::{Deserialize, Serialize};

/// Whether the matrices describe one step or one second.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Time {
    /// x(k+1) = A x(k) + B u(k) + D d(k): everything is per step.
    #[default]
    Discrete,
    /// dx/dt = A x + B u + D d: everything is per second and is discretised with the sampling period.
    Continuous,
}

/// How a continuous-time model becomes a discrete-time one (see [`crate::discretise`]).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Discretisation {
    /// One explicit Euler step: A0 = I + T A.
    Euler,
    /// Exact for a command and a disturbance held over the period: A0 = exp(T A).
    ZeroOrderHold,
}

/// The table `[diagnoser.model]`: a linear model with bounds, matrices as lists of rows.
///
/// nx, nu, ny and nd are the numbers of states, actuators, outputs and disturbances. Units are the plant's;
/// with `time = "discrete"` the model speaks of one step, with `time = "continuous"` of one second.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModelOptions {
    /// Whether the matrices are per step (`"discrete"`, the default) or per second (`"continuous"`).
    #[serde(default)]
    pub time: Time,
    /// `"euler"` or `"zero_order_hold"`; required for a continuous model and only allowed there.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub discretisation: Option<Discretisation>,
    /// State matrix A, nx x nx.
    #[serde(rename = "A")]
    pub a: Vec<Vec<f64>>,
    /// Input matrix B, nx x nu. Column j is also the direction of the fault of actuator j.
    #[serde(rename = "B")]
    pub b: Vec<Vec<f64>>,
    /// Output matrix C, ny x nx.
    #[serde(rename = "C")]
    pub c: Vec<Vec<f64>>,
    /// Disturbance matrix D, nx x nd. Left out together with `disturbance_bound`: no disturbance.
    #[serde(rename = "D", default, skip_serializing_if = "Vec::is_empty")]
    pub d: Vec<Vec<f64>>,
    /// Entrywise bound of the uncertainty of A, nx x nx, >= 0. Default: zero.
    #[serde(rename = "A_uncertainty", default, skip_serializing_if = "Vec::is_empty")]
    pub a_uncertainty: Vec<Vec<f64>>,
    /// Bound w of |d|, length nd, >= 0, in the unit of d; what D makes of d is per step, or per second in a
    /// continuous model.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub disturbance_bound: Vec<f64>,
    /// Bound v of the measurement noise, length ny, >= 0, in units of y.
    pub measurement_noise_bound: Vec<f64>,
    /// Centre of the box that contains the state at the start, length nx. Default: zero.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub initial_state_center: Option<Vec<f64>>,
    /// Radius of that box, length nx, >= 0. Needed unless the state follows from one measurement.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub initial_state_radius: Option<Vec<f64>>,
    /// Names of the states, length nx, unique. Default: `state_0`, `state_1`, ...
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub state_names: Option<Vec<String>>,
    /// Names of the actuators, length nu, unique. Default: `actuator_0`, `actuator_1`, ...
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub actuator_names: Option<Vec<String>>,
    /// Names of the outputs, length ny, unique. Default: `output_0`, `output_1`, ...
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub output_names: Option<Vec<String>>,
    /// Units of the states, length nx. Default: empty.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub state_units: Option<Vec<String>>,
    /// Units of the commands and actuator faults, length nu. Default: empty.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub actuator_units: Option<Vec<String>>,
    /// Units of the outputs, length ny. Default: empty.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub output_units: Option<Vec<String>>,
    /// Lower bound of the commands, length nu, units of u; bridges a missing command.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub input_lower: Option<Vec<f64>>,
    /// Upper bound of the commands, length nu, units of u; needed together with `input_lower`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub input_upper: Option<Vec<f64>>,
    /// Lower corner of a box that contains the state at all times, length nx.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub state_box_lower: Option<Vec<f64>>,
    /// Upper corner of that box, length nx; needed together with `state_box_lower`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub state_box_upper: Option<Vec<f64>>,
}
