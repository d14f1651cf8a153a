//! What a user writes for `method = "async_imm"` (method sheet 7).

pub use super::design::{Form, Mixing};
use serde::{Deserialize, Serialize};

/// The tables of `method = "async_imm"`.
///
/// Sensor 1 measures the first rows of the diagnoser's `measurements`, sensor 2 the next, and so on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AsyncImmTables {
    /// `"sequential"` (default), `"sequential_square_root"` or `"batch_unobserved"`.
    #[serde(default)]
    pub form: Form,
    /// W: fusion periods for which late packets are still used; default 0.
    #[serde(default)]
    pub rollback_steps: usize,
    /// Packets of one sensor that one interval takes; default 64.
    #[serde(default = "default_max_packets")]
    pub max_packets_per_step: usize,
    /// Packets stamped later than the fusion instant plus this are rejected, ms; default 1000.
    #[serde(default = "default_max_ahead")]
    pub max_ahead_ms: f64,
    /// `[diagnoser.plant]`.
    pub plant: PlantOptions,
    /// `[diagnoser.input]`.
    #[serde(default)]
    pub input: InputOptions,
    /// `[[diagnoser.sensor]]`.
    pub sensor: Vec<SensorOptions>,
    /// `[[diagnoser.mode]]`, the normal one first.
    pub mode: Vec<ModeOptions>,
    /// `[diagnoser.amplitude]`.
    pub amplitude: AmplitudeOptions,
    /// `[diagnoser.transition]`.
    pub transition: TransitionOptions,
    /// `[diagnoser.initial]`.
    pub initial: InitialOptions,
    /// `[diagnoser.decision]`.
    #[serde(default)]
    pub decision: DecisionOptions,
}

fn default_max_packets() -> usize {
    64
}

fn default_max_ahead() -> f64 {
    1000.0
}

/// The plant dx/dt = A x + B u + G w + F f; matrices as lists of rows, 1/s.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlantOptions {
    /// A, states x states.
    #[serde(rename = "A")]
    pub a: Vec<Vec<f64>>,
    /// B, states x commands; default none.
    #[serde(rename = "B", default)]
    pub b: Vec<Vec<f64>>,
    /// G, states x process noises.
    #[serde(rename = "G")]
    pub g: Vec<Vec<f64>>,
    /// F, states x fault channels.
    #[serde(rename = "F")]
    pub f: Vec<Vec<f64>>,
    /// Q, process noises x process noises, power spectral density: (unit of w)² s.
    pub process_noise_psd: Vec<Vec<f64>>,
    /// Names of the fault channels; default: the commands' if F = B, else `channel 1`, …
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub channels: Option<Vec<String>>,
    /// Units of the fault channels; default: the commands' if F = B, else none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub channel_units: Option<Vec<String>>,
}

/// The known input: the packets of the diagnoser's `commands`, each held from its stamp on.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct InputOptions {
    /// The command until the first one is received; default zero.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub constant: Option<Vec<f64>>,
}

/// One sensor: z = H x + v.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorOptions {
    /// Name.
    pub name: String,
    /// H, rows x states.
    pub measurement_matrix: Vec<Vec<f64>>,
    /// R, rows x rows, positive definite.
    pub noise_covariance: Vec<Vec<f64>>,
    /// β, probability that a packet arrives, for `form = "batch_unobserved"` only; default 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub arrival_probability: Option<f64>,
    /// y⁰, what a gateway holds before the first packet, for `form = "batch_unobserved"` only; default H x̂₀.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub initial_held_value: Option<Vec<f64>>,
}

/// One mode.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModeOptions {
    /// Name, unique.
    pub name: String,
    /// D, fault channels x slots: f = D φ; zero in the first mode.
    pub direction: Vec<Vec<f64>>,
}

/// The amplitude slots φ.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AmplitudeOptions {
    /// φ₀, one per slot; default zero.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub prior_mean: Option<Vec<f64>>,
    /// Standard deviation of each slot, channel units: the size of a fault that matters.
    pub prior_standard_deviation: Vec<f64>,
    /// Random walk of each slot, channel²/s, in the modes in which it is active; default zero.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub random_walk_psd: Option<Vec<f64>>,
    /// `"shared_channel"` (default) or `"all"`.
    #[serde(default)]
    pub mixing: Mixing,
}

/// How modes change: `kind` tells which of the other keys belong to it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TransitionOptions {
    /// `"stay"`, `"rate"` or `"per_step"`.
    pub kind: TransitionKind,
    /// Probability of staying in a mode over `stay_period_s` (`kind = "stay"`).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stay_probability: Option<f64>,
    /// Seconds (`kind = "stay"`).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stay_period_s: Option<f64>,
    /// Γ, modes x modes, 1/s, rows sum to 0 (`kind = "rate"`).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rate_per_second: Option<Vec<Vec<f64>>>,
    /// Λ, modes x modes, rows sum to 1 (`kind = "per_step"`).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub matrix: Option<Vec<Vec<f64>>>,
}

/// Where Λ comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TransitionKind {
    /// One probability of staying over one period; the same rate to every other mode.
    Stay,
    /// A matrix of rates.
    Rate,
    /// A matrix of probabilities for every fusion step, whatever its length (the paper).
    PerStep,
}

/// What is known at the start.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InitialOptions {
    /// x̂₀.
    pub state: Vec<f64>,
    /// P₀, states x states.
    pub state_covariance: Vec<Vec<f64>>,
    /// μ₀, one per mode.
    pub mode_probability: Vec<f64>,
}

/// The decision rule and what is reported.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DecisionOptions {
    /// μ_T; default 0.9.
    pub threshold: f64,
    /// L: instants in a row; default 2.
    pub window_steps: u32,
    /// κ: half width of the amplitude bounds in standard deviations; default 2.
    pub amplitude_bound_standard_deviations: f64,
    /// Fusion instants reported as `Starting`; default 16.
    pub startup_steps: u32,
}

impl Default for DecisionOptions {
    fn default() -> Self {
        Self {
            threshold: 0.9,
            window_steps: 2,
            amplitude_bound_standard_deviations: 2.0,
            startup_steps: 16,
        }
    }
}
