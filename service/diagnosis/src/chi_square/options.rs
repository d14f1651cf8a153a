//! What a user can set for the state and residual chi-square tests (method sheet 7).

pub use super::glr_modes::FaultProfile;
use super::model_options::{MatricesOptions, ModelOptions};
use crate::choice::choice;
use serde::{Deserialize, Serialize};

/// The part of a diagnoser's table that belongs to `method = "chi_square"`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ChiSquareOptions {
    /// `[diagnoser.model]`: matrices, start, schedule.
    pub model: ModelOptions,
    /// `[[diagnoser.models]]`: the models to choose from with `schedule = "selected"`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub models: Vec<MatricesOptions>,
    /// `[diagnoser.statistics]`: what is computed, what decides.
    pub statistics: StatisticsOptions,
    /// `[diagnoser.glr]`: the likelihood ratio.
    pub glr: GlrOptions,
    /// `[diagnoser.cusum]`: the cumulative sums.
    pub cusum: CusumOptions,
    /// `[diagnoser.threshold]`: false-alarm probabilities and calibration.
    pub threshold: ThresholdOptions,
    /// `[diagnoser.alarm]`: confirmation, clearing, isolation, missing inputs.
    pub alarm: AlarmOptions,
    /// `[diagnoser.numerics]`: tolerances.
    pub numerics: NumericsOptions,
}

choice! {
    /// A statistic (method sheet 1).
    StatisticKind {
        /// ν' S⁻¹ ν.
        Residual = "residual",
        /// The propagator that is never restarted.
        StatePlain = "state_plain",
        /// Propagators restarted from the estimate of N steps ago.
        StateWindow = "state_window",
        /// Two propagators restarted in alternation.
        StateTwoPropagator = "state_two_propagator",
        /// The generalised likelihood ratio.
        Glr = "glr",
        /// The two-sided cumulative sums.
        Cusum = "cusum",
    }
}

choice! {
    /// What the stability guard does with `state_plain` where it is blind.
    StabilityGuard {
        /// Refuses the configuration.
        Refuse = "refuse",
        /// Warns and runs the test anyway.
        Warn = "warn",
    }
}

choice! {
    /// A fault signature of the likelihood ratio.
    Signature {
        /// A sensor's reading is off by a constant from the onset on.
        SensorStep = "sensor_step",
        /// A sensor's reading drifts away from the onset on.
        SensorRamp = "sensor_ramp",
        /// A process fault of constant size; needs `process_fault_input`.
        ProcessStep = "process_step",
        /// A process fault that grows; needs `process_fault_input`.
        ProcessRamp = "process_ramp",
    }
}

choice! {
    /// What false-alarm probability the chi-square statistics of the decision have.
    ThresholdMode {
        /// `run_false_alarm_probability` over `run_steps`, by simulation.
        PerRun = "per_run",
        /// `false_alarm_probability` at each instant, exactly.
        PerInstant = "per_instant",
    }
}

choice! {
    /// What happens to an isolated sensor.
    OnIsolation {
        /// Nothing.
        Continue = "continue",
        /// It counts as missing from then on; the detectors start anew.
        Exclude = "exclude",
        /// Likewise, after the estimate was corrected for the fault.
        ExcludeAndCompensate = "exclude_and_compensate",
    }
}

choice! {
    /// What happens to the exclusion of a sensor without which an excited, not decaying mode is unobservable.
    ExclusionCheck {
        /// It is not excluded.
        Refuse = "refuse",
        /// A warning at construction; it is excluded nevertheless (dead reckoning).
        Warn = "warn",
    }
}

/// What is computed and what decides.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct StatisticsOptions {
    /// The statistics that are computed and published. Default: `residual`, `state_window`, `glr`, `cusum`.
    pub enabled: Vec<StatisticKind>,
    /// Those that raise the alarm, at least one, each enabled. Default: `glr`, `cusum`.
    pub decision: Vec<StatisticKind>,
    /// Whose difference β is published (the longest window of a bank): a state test, enabled. Default: the first
    /// enabled of `state_window`, `state_two_propagator`, `state_plain`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub report_statistic: Option<StatisticKind>,
    /// Windows N of `state_window`, steps, at least 1 each. Default 1, 3, 9, 27.
    pub window_steps: Vec<usize>,
    /// Reset interval L of `state_two_propagator`, steps, at least 1. Default 10.
    pub two_propagator_reset_steps: usize,
    /// `"refuse"` (default) or `"warn"`.
    pub stability_guard: StabilityGuard,
}

impl Default for StatisticsOptions {
    fn default() -> Self {
        use StatisticKind::{Cusum, Glr, Residual, StateWindow};
        Self {
            enabled: vec![Residual, StateWindow, Glr, Cusum],
            decision: vec![Glr, Cusum],
            report_statistic: None,
            window_steps: vec![1, 3, 9, 27],
            two_propagator_reset_steps: 10,
            stability_guard: StabilityGuard::Refuse,
        }
    }
}

/// The likelihood ratio.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct GlrOptions {
    /// M, steps: the oldest onset that is looked for; at least twice the detection delay of the slowest fault to
    /// be isolated. Default 120.
    pub window_steps: usize,
    /// s, steps between onsets: 4 costs a quarter of the time and up to two steps of delay. Default 1.
    pub onset_stride_steps: usize,
    /// Signatures. Default `sensor_step` and `sensor_ramp`.
    pub signatures: Vec<Signature>,
    /// By how much the best mode of a component must exceed the best of all others to be declared, > 0, no unit.
    /// Default 9.21 = 2 ln 100.
    pub isolation_margin: f64,
    /// How the process faults enter the state, n x faults, state units per unit of the fault and step.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub process_fault_input: Vec<Vec<f64>>,
    /// How they enter the measurement, m x faults. Default: zero.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub process_fault_feedthrough: Vec<Vec<f64>>,
    /// Names of the process faults, unique. Default: `process_fault_0`, ...
    #[serde(skip_serializing_if = "Option::is_none")]
    pub process_fault_names: Option<Vec<String>>,
}

impl Default for GlrOptions {
    fn default() -> Self {
        Self {
            window_steps: 120,
            onset_stride_steps: 1,
            signatures: vec![Signature::SensorStep, Signature::SensorRamp],
            isolation_margin: 9.21,
            process_fault_input: Vec::new(),
            process_fault_feedthrough: Vec::new(),
            process_fault_names: None,
        }
    }
}

/// The cumulative sums.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CusumOptions {
    /// ref, innovation standard deviations per step, > 0. Default 0.25.
    pub reference: f64,
}

impl Default for CusumOptions {
    fn default() -> Self {
        Self { reference: 0.25 }
    }
}

/// False-alarm probabilities and calibration (method sheet 3).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ThresholdOptions {
    /// `"per_run"` (default) or `"per_instant"`, for the chi-square statistics; `glr` and `cusum` are always per run.
    pub mode: ThresholdMode,
    /// P_f per instant, of the chi-square statistics and of the channels' bounds, in (0, 0.5]. Default 0.005.
    pub false_alarm_probability: f64,
    /// α: probability of a false alarm in `run_steps` without fault, in (0, 0.5]. Default 0.05; in service much smaller.
    pub run_false_alarm_probability: f64,
    /// Steps of a run. Default 200.
    pub run_steps: usize,
    /// Simulated runs, at least 200. Default 8000.
    pub calibration_runs: usize,
    /// Seed of the simulation. Default 1.
    pub calibration_seed: u64,
    /// Fixed threshold of `glr`, > 0; 0 (default): calibrated.
    pub glr: f64,
    /// Fixed threshold of `cusum`, > 0; 0 (default): calibrated.
    pub cusum: f64,
    /// Fixed upper bound of λ/t_d of the state windows in the mode `per_run`, > 0; 0 (default): calibrated.
    pub bank: f64,
}

impl Default for ThresholdOptions {
    fn default() -> Self {
        Self {
            mode: ThresholdMode::PerRun,
            false_alarm_probability: 5e-3,
            run_false_alarm_probability: 0.05,
            run_steps: 200,
            calibration_runs: 8000,
            calibration_seed: 1,
            glr: 0.0,
            cusum: 0.0,
            bank: 0.0,
        }
    }
}

/// Confirmation, clearing, isolation and missing inputs (method sheet 4).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct AlarmOptions {
    /// Consecutive instants with an alarm that make a fault, at least 1. Default 1.
    pub confirm_steps: u32,
    /// Consecutive instants without an alarm that end it, at least 1. Default 10.
    pub clear_steps: u32,
    /// Instants after a start without verdict. Default 0.
    pub warmup_steps: u32,
    /// `"continue"` (default), `"exclude"` or `"exclude_and_compensate"`.
    pub on_isolation: OnIsolation,
    /// `"refuse"` (default) or `"warn"`.
    pub exclusion_check: ExclusionCheck,
    /// Instants over which a missing command is replaced by the last one before the verdict is lost. Default 5.
    pub input_max_hold_steps: u32,
    /// Instants that may be skipped in a row before the diagnoser restarts from x(0). Default 100.
    pub max_gap_steps: u32,
}

impl Default for AlarmOptions {
    fn default() -> Self {
        Self {
            confirm_steps: 1,
            clear_steps: 10,
            warmup_steps: 0,
            on_isolation: OnIsolation::Continue,
            exclusion_check: ExclusionCheck::Refuse,
            input_max_hold_steps: 5,
            max_gap_steps: 100,
        }
    }
}

/// Tolerances.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct NumericsOptions {
    /// Smallest kept singular value of the row-scaled factor of T, relative to the largest. Default 1e-10.
    pub rank_tolerance: f64,
    /// Change of the scaled factor of P from step to step that counts as steady. Default 1e-12.
    pub steady_state_tolerance: f64,
}

impl Default for NumericsOptions {
    fn default() -> Self {
        Self {
            rank_tolerance: 1e-10,
            steady_state_tolerance: 1e-12,
        }
    }
}
