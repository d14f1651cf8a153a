//! The linear model with bounds that every method starts from (method sheet 2).
//!
//! x(k+1) = (A0 + ΔA(k)) x(k) + B (u(k) + f(k)) + D d(k),  y(k) = C x(k) + v(k),
//! |ΔA(k)| <= A⁺, |d(k)| <= w, |v(k)| <= v, entrywise.
//!
//! | symbol | shape | accessor |
//! |---|---|---|
//! | A0 | nx x nx | [`LinearModel::a0`] |
//! | B | nx x nu | [`LinearModel::b`] |
//! | C | ny x nx | [`LinearModel::c`] |
//! | D | nx x nd | [`LinearModel::d`] |
//! | A⁺ | nx x nx | [`LinearModel::a_plus`] |
//! | w | nd | [`LinearModel::w`] |
//! | v | ny | [`LinearModel::v`] |

mod error;
mod options;
mod validate;

pub use error::ModelError;
pub use options::{Discretisation, ModelOptions, Time};

use crate::decomposition::SingularDecomposition;
use crate::discretise::{self, Dynamics};
use crate::method::Refusal;
use nalgebra::{DMatrix, DVector};
use residual_shared::record::MAX_FAULTS;
use serde::Serialize;
use std::collections::HashSet;
use validate::{bounds, labels, matrix, names, non_negative, require_columns, require_rows, vector};

/// A box: every coordinate between its lower and its upper bound.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Bounds {
    /// Lower corner.
    pub lower: DVector<f64>,
    /// Upper corner, entrywise at least `lower`.
    pub upper: DVector<f64>,
}

impl Bounds {
    /// The middle of the box.
    pub fn center(&self) -> DVector<f64> {
        self.lower
            .zip_map(&self.upper, |lower, upper| lower / 2.0 + upper / 2.0)
    }

    /// The half widths of the box, rounded up so that centre and radius contain both corners.
    pub fn radius(&self) -> DVector<f64> {
        let center = self.center();
        DVector::from_fn(center.len(), |i, _| {
            let radius = (self.upper[i] - center[i]).max(center[i] - self.lower[i]);
            if radius > 0.0 { radius.next_up() } else { 0.0 }
        })
    }
}

/// The box that contains the state at the start.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct InitialState {
    /// Its centre p0, length nx.
    pub center: DVector<f64>,
    /// Its radius, length nx, >= 0.
    pub radius: DVector<f64>,
}

/// A validated discrete-time model: all shapes agree, all entries are finite, all bounds are >= 0.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LinearModel {
    sample_time_s: f64,
    dynamics: Dynamics,
    c: DMatrix<f64>,
    w: DVector<f64>,
    v: DVector<f64>,
    initial_state: Option<InitialState>,
    input_box: Option<Bounds>,
    state_box: Option<Bounds>,
    states: Vec<Label>,
    actuators: Vec<Label>,
    outputs: Vec<Label>,
}

/// Name and unit of a state, an actuator or an output.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Label {
    /// Its name, unique among its kind.
    pub name: String,
    /// Its unit; empty when the configuration states none.
    pub unit: String,
}

impl LinearModel {
    /// Checks the options and, for a continuous model, discretises it with the period `sample_time_s` (seconds).
    ///
    /// # Errors
    /// [`ModelError`] with the entry that is wrong and what to do about it.
    pub fn new(options: &ModelOptions, sample_time_s: f64) -> Result<Self, ModelError> {
        if !(sample_time_s.is_finite() && sample_time_s > 0.0) {
            return Err(ModelError::InvalidSampleTime { value: sample_time_s });
        }
        let a = matrix("model.A", &options.a)?;
        let nx = a.nrows();
        if nx == 0 {
            return Err(ModelError::EmptyModel {
                key: "model.A",
                what: "state",
            });
        }
        require_columns("model.A", &a, nx, "states x states")?;
        let b = matrix("model.B", &options.b)?;
        require_rows("model.B", &b, nx, "states x actuators")?;
        let nu = b.ncols();
        if nu == 0 {
            return Err(ModelError::EmptyModel {
                key: "model.B",
                what: "actuator",
            });
        }
        if nu > MAX_FAULTS {
            return Err(ModelError::TooManyActuators {
                count: nu,
                limit: MAX_FAULTS,
            });
        }
        let c = matrix("model.C", &options.c)?;
        let ny = c.nrows();
        if ny == 0 {
            return Err(ModelError::EmptyModel {
                key: "model.C",
                what: "output",
            });
        }
        require_columns("model.C", &c, nx, "outputs x states")?;
        let d = match (options.d.is_empty(), options.disturbance_bound.is_empty()) {
            (true, true) => DMatrix::zeros(nx, 0),
            (true, false) => {
                return Err(ModelError::MissingPartner {
                    key: "model.D",
                    present: "model.disturbance_bound",
                });
            }
            _ => matrix("model.D", &options.d)?,
        };
        require_rows("model.D", &d, nx, "states x disturbances")?;
        let w = vector(
            "model.disturbance_bound",
            &options.disturbance_bound,
            d.ncols(),
            "columns of D",
        )?;
        non_negative("model.disturbance_bound", w.as_slice(), 1)?;
        let v = vector(
            "model.measurement_noise_bound",
            &options.measurement_noise_bound,
            ny,
            "outputs",
        )?;
        non_negative("model.measurement_noise_bound", v.as_slice(), 1)?;
        let a_plus = if options.a_uncertainty.is_empty() {
            DMatrix::zeros(nx, nx)
        } else {
            matrix("model.A_uncertainty", &options.a_uncertainty)?
        };
        require_rows("model.A_uncertainty", &a_plus, nx, "states x states")?;
        require_columns("model.A_uncertainty", &a_plus, nx, "states x states")?;
        non_negative("model.A_uncertainty", a_plus.as_slice(), nx)?;

        let given = Dynamics { a0: a, b, d, a_plus };
        let dynamics = match (options.time, options.discretisation) {
            (Time::Discrete, None) => given,
            (Time::Discrete, Some(_)) => return Err(ModelError::DiscretisationUnused),
            (Time::Continuous, None) => return Err(ModelError::DiscretisationMissing),
            (Time::Continuous, Some(Discretisation::Euler)) => discretise::euler(&given, sample_time_s)?,
            (Time::Continuous, Some(Discretisation::ZeroOrderHold)) => {
                discretise::zero_order_hold(&given, sample_time_s)?
            }
        };
        Ok(Self {
            sample_time_s,
            dynamics,
            c,
            w,
            v,
            initial_state: initial_state(options, nx)?,
            input_box: bounds(
                ["model.input_lower", "model.input_upper"],
                [&options.input_lower, &options.input_upper],
                nu,
                "actuators",
            )?,
            state_box: bounds(
                ["model.state_box_lower", "model.state_box_upper"],
                [&options.state_box_lower, &options.state_box_upper],
                nx,
                "states",
            )?,
            states: labels(
                names("model.state_names", &options.state_names, "state", nx)?,
                "model.state_units",
                &options.state_units,
            )?,
            actuators: labels(
                names("model.actuator_names", &options.actuator_names, "actuator", nu)?,
                "model.actuator_units",
                &options.actuator_units,
            )?,
            outputs: labels(
                names("model.output_names", &options.output_names, "output", ny)?,
                "model.output_units",
                &options.output_units,
            )?,
        })
    }

    /// nx: number of states.
    pub fn state_count(&self) -> usize {
        self.dynamics.a0.nrows()
    }

    /// nu: number of actuators.
    pub fn actuator_count(&self) -> usize {
        self.dynamics.b.ncols()
    }

    /// ny: number of outputs.
    pub fn output_count(&self) -> usize {
        self.c.nrows()
    }

    /// nd: number of disturbances, possibly 0.
    pub fn disturbance_count(&self) -> usize {
        self.dynamics.d.ncols()
    }

    /// The sampling period, seconds.
    pub fn sample_time_s(&self) -> f64 {
        self.sample_time_s
    }

    /// A0: nominal state matrix per step, nx x nx.
    pub fn a0(&self) -> &DMatrix<f64> {
        &self.dynamics.a0
    }

    /// B: input matrix per step, nx x nu; column j is the direction of the fault of actuator j.
    pub fn b(&self) -> &DMatrix<f64> {
        &self.dynamics.b
    }

    /// C: output matrix, ny x nx.
    pub fn c(&self) -> &DMatrix<f64> {
        &self.c
    }

    /// D: disturbance matrix per step, nx x nd.
    pub fn d(&self) -> &DMatrix<f64> {
        &self.dynamics.d
    }

    /// A⁺: entrywise bound of the uncertainty of A0 per step, nx x nx, >= 0.
    pub fn a_plus(&self) -> &DMatrix<f64> {
        &self.dynamics.a_plus
    }

    /// w: bound of |d|, length nd, >= 0.
    pub fn w(&self) -> &DVector<f64> {
        &self.w
    }

    /// v: bound of the measurement noise, length ny, >= 0.
    pub fn v(&self) -> &DVector<f64> {
        &self.v
    }

    /// The box that contains the state at the start, if configured.
    pub fn initial_state(&self) -> Option<&InitialState> {
        self.initial_state.as_ref()
    }

    /// The box that contains every command, if configured.
    pub fn input_box(&self) -> Option<&Bounds> {
        self.input_box.as_ref()
    }

    /// A box that contains the state at all times, if configured.
    pub fn state_box(&self) -> Option<&Bounds> {
        self.state_box.as_ref()
    }

    /// Names and units of the states.
    pub fn states(&self) -> &[Label] {
        &self.states
    }

    /// Names and units of the actuators; the unit is that of command and fault.
    pub fn actuators(&self) -> &[Label] {
        &self.actuators
    }

    /// Names and units of the outputs.
    pub fn outputs(&self) -> &[Label] {
        &self.outputs
    }

    /// C⁺ = (C'C)⁻¹C', nx x ny, by which one measurement alone encloses the state (method sheet 3.2: "strip
    /// available"); `None` unless ny >= nx and σ_min(C) > 1e-9 σ_max(C).
    pub fn strip_gain(&self) -> Option<DMatrix<f64>> {
        if self.output_count() < self.state_count() {
            return None;
        }
        SingularDecomposition::new(&self.c).left_inverse(1e-9)
    }
}

/// The initial box; the centre may be left out, the radius may not when a centre is given.
fn initial_state(options: &ModelOptions, nx: usize) -> Result<Option<InitialState>, ModelError> {
    let (center_key, radius_key) = ("model.initial_state_center", "model.initial_state_radius");
    let Some(radius) = &options.initial_state_radius else {
        return match &options.initial_state_center {
            Some(_) => Err(ModelError::MissingPartner {
                key: radius_key,
                present: center_key,
            }),
            None => Ok(None),
        };
    };
    let radius = vector(radius_key, radius, nx, "states")?;
    non_negative(radius_key, radius.as_slice(), 1)?;
    let center = match &options.initial_state_center {
        Some(center) => vector(center_key, center, nx, "states")?,
        None => DVector::zeros(nx),
    };
    Ok(Some(InitialState { center, radius }))
}

#[cfg(test)]
mod tests;

/// Fills in names and units, where a model states none, with those of the signals (name, unit); names only if
/// they are unique.
pub fn adopt_labels(
    signals: &[(String, String)],
    names: &mut Option<Vec<String>>,
    units: &mut Option<Vec<String>>,
) {
    let distinct: HashSet<_> = signals.iter().map(|(name, _)| name).collect();
    if distinct.len() == signals.len() {
        names.get_or_insert_with(|| signals.iter().map(|(name, _)| name.clone()).collect());
    }
    units.get_or_insert_with(|| signals.iter().map(|(_, unit)| unit.clone()).collect());
}

impl From<ModelError> for Refusal {
    fn from(error: ModelError) -> Self {
        let key = match &error {
            ModelError::RaggedRows { key, row, .. } => format!("{key}.{row}"),
            ModelError::LowerAboveUpper { key, index, .. } | ModelError::EmptyName { key, index } => {
                format!("{key}.{index}")
            }
            ModelError::MissingPartner { present, .. } => (*present).to_owned(),
            other => other.key(),
        };
        Self::new(key, &error)
    }
}
