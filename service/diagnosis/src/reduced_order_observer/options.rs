//! What a user can set for a reduced-order observer (method sheet 7).

use crate::choice::choice;
use serde::{Deserialize, Serialize};

/// The part of a diagnoser's table that belongs to `method = "reduced_order_observer"`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ReducedOrderObserverOptions {
    /// `[diagnoser.model]`: the plant and the bounds of all that is unknown.
    pub model: ModelOptions,
    /// `[diagnoser.design]`: how the gains are chosen.
    pub design: DesignOptions,
    /// `[diagnoser.bounds]`: the residual bounds and the tests.
    pub bounds: BoundsOptions,
    /// `[diagnoser.isolation]`: which actuator it is, and how large its fault.
    pub isolation: IsolationOptions,
    /// `[diagnoser.missing]`: what happens after lost samples.
    pub missing: MissingOptions,
}

/// x(k+1) = A x + B (u + f) + D η, y = C x + v; matrices as lists of rows.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ModelOptions {
    /// State matrix, n x n.
    #[serde(rename = "A")]
    pub a: Vec<Vec<f64>>,
    /// Input matrix, n x m; column i is also the direction of the fault of actuator i.
    #[serde(rename = "B")]
    pub b: Vec<Vec<f64>>,
    /// Output matrix, p x n.
    #[serde(rename = "C")]
    pub c: Vec<Vec<f64>>,
    /// Disturbance matrix, n x q; `[]` (default) without disturbance.
    #[serde(rename = "D")]
    pub d: Vec<Vec<f64>>,
    /// Lower bounds of x at the first complete sample, length n, state units.
    pub initial_state_lower: Vec<f64>,
    /// Upper bounds of x at the first complete sample, length n, state units.
    pub initial_state_upper: Vec<f64>,
    /// Lower bounds of η, length q, disturbance units.
    pub disturbance_lower: Vec<f64>,
    /// Upper bounds of η, length q, disturbance units.
    pub disturbance_upper: Vec<f64>,
    /// |v_i| <= bound, length p, output units; `[]` (default) for no noise.
    pub measurement_noise_bound: Vec<f64>,
    /// Lower bounds of u, length m, input units; with the upper ones they bridge a missing command.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub input_lower: Option<Vec<f64>>,
    /// Upper bounds of u, length m, input units.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub input_upper: Option<Vec<f64>>,
    /// Names of the outputs; default: the signals' names.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub output_names: Option<Vec<String>>,
    /// Units of the outputs; default: the signals' units.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub output_units: Option<Vec<String>>,
    /// Names of the actuators; default: the signals' names.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub actuator_names: Option<Vec<String>>,
    /// Units of the actuators; default: the signals' units.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub actuator_units: Option<Vec<String>>,
}

/// How the gains K and M are chosen (method sheet 3.2 to 3.6).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DesignOptions {
    /// `"auto"` (default), `"h2"`, `"lmi"`, `"closed_form"` or `"given"`.
    pub gains: Gains,
    /// What `"auto"` minimises: `"fault_floor"` (default) or `"width"`.
    pub objective: Objective,
    /// Weights of the fault floors, length m, input units, positive; default 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fault_scale: Option<Vec<f64>>,
    /// Largest |eig F| that is accepted, in (0, 1); default 0.9.
    pub spectral_radius_max: f64,
    /// Eigenvalues of F for `"closed_form"`, length n - p, each in (-1, 1).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub poles: Option<Vec<f64>>,
    /// Decay rate a of the paper's linear matrix inequality for `"lmi"`, in (0, 1]; default `spectral_radius_max`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lmi_decay_rate: Option<f64>,
    /// K, (n - p) x p, for `"given"` and as one more candidate of `"auto"`; projected on K D1 + D2 = 0. In the
    /// coordinates \[y; N_c' x\], with the N_c of [`super::plant::completion`].
    #[serde(rename = "K", skip_serializing_if = "Option::is_none")]
    pub k: Option<Vec<Vec<f64>>>,
    /// M: `"zero"` (default), `"lmi"` or a p x p matrix.
    #[serde(rename = "observer_M")]
    pub observer_m: ObserverM,
}

impl Default for DesignOptions {
    fn default() -> Self {
        Self {
            gains: Gains::default(),
            objective: Objective::default(),
            fault_scale: None,
            spectral_radius_max: 0.9,
            poles: None,
            lmi_decay_rate: None,
            k: None,
            observer_m: ObserverM::default(),
        }
    }
}

/// Residual bounds and tests (method sheet 3.7, 3.8, 3.10, 4).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct BoundsOptions {
    /// `"joint"` (default), `"paper"` or `"tiom"`.
    pub mode: Mode,
    /// `"measured_output"` (default in the joint mode) or `"prior_box"` (the only one in the others).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub initialisation: Option<Initialisation>,
    /// d, columns of a reduced set; default 24, in the paper's mode 20.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub generator_order: Option<usize>,
    /// `"hull"`: every output by itself, always needed; `"set"`: also combinations of outputs. Default both.
    pub tests: Vec<Test>,
    /// Largest number of test rows, the outputs included; default 32.
    pub max_directions: usize,
    /// Relative to 1 + |y| + |ẑ1|: what rounding may add to a residual; default 1e-9.
    pub rounding_tolerance: f64,
    /// Consecutive instants a test must alarm before it counts; default 1.
    pub alarm_samples: u32,
}

impl Default for BoundsOptions {
    fn default() -> Self {
        Self {
            mode: Mode::default(),
            initialisation: None,
            generator_order: None,
            tests: vec![Test::Hull, Test::Set],
            max_directions: 32,
            rounding_tolerance: 1e-9,
            alarm_samples: 1,
        }
    }
}

impl BoundsOptions {
    /// d as configured, else 20 in the paper's mode and 24 otherwise.
    pub fn effective_generator_order(&self) -> usize {
        self.generator_order
            .unwrap_or(if self.mode == Mode::Paper { 20 } else { 24 })
    }

    /// As configured, else the measured output in the joint mode and the prior box otherwise.
    pub fn effective_initialisation(&self) -> Initialisation {
        self.initialisation.unwrap_or(match self.mode {
            Mode::Joint => Initialisation::MeasuredOutput,
            Mode::Paper | Mode::Tiom => Initialisation::PriorBox,
        })
    }
}

/// Isolation by exoneration and fault estimates (method sheet 3.9, 4); joint mode only.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct IsolationOptions {
    /// Whether the observers that do not react to one actuator run beside the main one; default true.
    pub enabled: bool,
    /// Eigenvalues of F of the members and estimators that leave a choice, each in (-1, 1): n - p of them, or one
    /// ρ that stands for ρ (1 - 0.1 l), l = 0, 1, ... Default 0.5.
    pub poles: Vec<f64>,
    /// Whether fault sizes are estimated; default true.
    pub fault_estimate: bool,
    /// Estimators with a larger steady radius are left out, length m, input units; default: none is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fault_estimate_radius_max: Option<Vec<f64>>,
    /// |f| <= bound, length m, input units; relied upon only while samples are missing, to keep members and
    /// estimators guaranteed through the gap.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fault_bound: Option<Vec<f64>>,
    /// Instants with a test and without an alarm that end an episode; 0 = only on request. Default 20.
    pub clear_samples: u32,
}

impl Default for IsolationOptions {
    fn default() -> Self {
        Self {
            enabled: true,
            poles: vec![0.5],
            fault_estimate: true,
            fault_estimate_radius_max: None,
            fault_bound: None,
            clear_samples: 20,
        }
    }
}

/// What happens after lost samples (method sheet 4).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MissingOptions {
    /// Hull half width / steady half width above which an instant counts as not evaluated; default 10.
    pub max_width_ratio: f64,
    /// Lower bounds of x at all times, length n, state units; with the upper ones they allow a restart in
    /// operation.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub restart_state_lower: Option<Vec<f64>>,
    /// Upper bounds of x at all times, length n, state units.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub restart_state_upper: Option<Vec<f64>>,
}

impl Default for MissingOptions {
    fn default() -> Self {
        Self {
            max_width_ratio: 10.0,
            restart_state_lower: None,
            restart_state_upper: None,
        }
    }
}

choice! {
    /// Where K comes from.
    #[derive(Default)]
    Gains {
        /// The best of several closed-form gains and, with a solver, of those of both inequalities.
        #[default] Auto = "auto",
        /// The noise-aware H2 inequality, method sheet 3.4.
        H2 = "h2",
        /// The paper's inequality, method sheet 3.3.
        Lmi = "lmi",
        /// Configured eigenvalues of F.
        ClosedForm = "closed_form",
        /// A configured K.
        Given = "given",
    }
}

choice! {
    /// What the choice among gains minimises.
    #[derive(Default)]
    Objective {
        /// The largest constant fault, over the actuators, that may stay unseen.
        #[default] FaultFloor = "fault_floor",
        /// The sum of the steady half widths of the outputs.
        Width = "width",
    }
}

choice! {
    /// Which set bounds the residual.
    #[derive(Default)]
    Mode {
        /// The joint set of both observers' errors, with noise: guaranteed from the first sample.
        #[default] Joint = "joint",
        /// Theorem 2 of the paper with corrections: no guarantee, for comparison.
        Paper = "paper",
        /// The traditional interval observer: no guarantee, for comparison.
        Tiom = "tiom",
    }
}

choice! {
    /// Where the observers start.
    #[derive(Default)]
    Initialisation {
        /// At the first complete sample, which is known up to the noise.
        #[default] MeasuredOutput = "measured_output",
        /// At the centre of the box of x(0).
        PriorBox = "prior_box",
    }
}

choice! {
    /// A group of tests.
    #[derive(Default)]
    Test {
        /// Every output by itself.
        #[default] Hull = "hull",
        /// Combinations of outputs: the facets of the set of all outputs, or the directions that tell faults best.
        Set = "set",
    }
}

/// Where M comes from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum ObserverM {
    /// `"zero"` or `"lmi"`.
    Named(NamedM),
    /// p x p, Schur.
    Matrix(Vec<Vec<f64>>),
}

impl Default for ObserverM {
    fn default() -> Self {
        Self::Named(NamedM::Zero)
    }
}

choice! {
    /// M by name.
    #[derive(Default)]
    NamedM {
        /// M = 0, the narrowest without noise.
        #[default] Zero = "zero",
        /// That of the paper's inequality.
        Lmi = "lmi",
    }
}
