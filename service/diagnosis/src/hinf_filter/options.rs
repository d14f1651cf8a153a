//! What a user can set (method sheet 7).

use super::window_length;
use crate::choice::choice;
use serde::{Deserialize, Serialize};

/// The tables of `method = "hinf_filter"`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HinfFilterOptions {
    /// `[diagnoser.model]`: the plant.
    pub model: PlantOptions,
    /// `[diagnoser.disturbance]`: what is known of disturbance and noise.
    pub disturbance: DisturbanceOptions,
    /// `[diagnoser.synthesis]`: where the gain comes from.
    #[serde(default)]
    pub synthesis: SynthesisOptions,
    /// `[diagnoser.filter]`: sampled form, start, lost samples.
    #[serde(default)]
    pub filter: FilterOptions,
    /// `[diagnoser.evaluation]`: window and thresholds.
    #[serde(default)]
    pub evaluation: EvaluationOptions,
    /// `[diagnoser.isolation]`: bank of filters that are blind to some faults, and the fault estimate.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub isolation: Option<IsolationOptions>,
}

/// The continuous-time plant, x' = A x + B u + Bd d + Bf f, y = C x + D u + Dd d + Df f, matrices row by row.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlantOptions {
    /// A, n x n, 1/s.
    #[serde(rename = "A")]
    pub a: Vec<Vec<f64>>,
    /// B, n x p; leave it out for a plant without commands.
    #[serde(rename = "B", default)]
    pub b: Vec<Vec<f64>>,
    /// C, q x n.
    #[serde(rename = "C")]
    pub c: Vec<Vec<f64>>,
    /// D, q x p; default zero.
    #[serde(rename = "D", default)]
    pub d: Vec<Vec<f64>>,
    /// Bd, n x m.
    #[serde(rename = "Bd")]
    pub bd: Vec<Vec<f64>>,
    /// Dd, q x m.
    #[serde(rename = "Dd")]
    pub dd: Vec<Vec<f64>>,
    /// Bf, n x l.
    #[serde(rename = "Bf")]
    pub bf: Vec<Vec<f64>>,
    /// Df, q x l.
    #[serde(rename = "Df")]
    pub df: Vec<Vec<f64>>,
    /// Whether an A that is not Hurwitz is refused (default true); detectability is needed in any case.
    #[serde(default = "yes")]
    pub require_stable: bool,
    /// Further plants that may be the true one: the thresholds follow the commands so that none of them alarms.
    #[serde(default)]
    pub listed_models: Vec<ListedModelOptions>,
    /// Units of the outputs, for people; default: the signals' units.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub output_units: Option<Vec<String>>,
}

/// A plant with other dynamics and the same outputs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ListedModelOptions {
    /// A, n x n, 1/s; stable.
    #[serde(rename = "A")]
    pub a: Vec<Vec<f64>>,
    /// B, n x p; default that of the model.
    #[serde(rename = "B", default, skip_serializing_if = "Option::is_none")]
    pub b: Option<Vec<Vec<f64>>>,
    /// Bd, n x m; default that of the model.
    #[serde(rename = "Bd", default, skip_serializing_if = "Option::is_none")]
    pub bd: Option<Vec<Vec<f64>>>,
}

/// Bounds of the disturbance: `amplitude` or `window_energy`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DisturbanceOptions {
    /// |d| <= amplitude, length m, units of d.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub amplitude: Option<Vec<f64>>,
    /// |d'| <= slew, length m, units of d per s. Without it d is taken as constant between sampling instants.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub slew: Option<Vec<f64>>,
    /// Largest root of the energy of d in a window, units of d times √s, instead of `amplitude`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub window_energy: Option<f64>,
    /// Standard deviations of white measurement noise, length q, units of y; empty: none. With noise the thresholds
    /// hold with a probability only.
    pub noise_std: Vec<f64>,
}

choice! {
    /// Where the gain comes from. Designs by matrix inequalities need a solver.
    #[derive(Default)]
    DesignType {
        /// Discrete Riccati equation: the best ratio of fault to disturbance (method sheet 3.2).
        #[default] RiccatiDiscrete = "riccati_dt",
        /// Continuous Riccati equation.
        RiccatiContinuous = "riccati_ct",
        /// B Dd⁺, where it decouples the state from the disturbance.
        Matched = "matched",
        /// Bounded-real inequalities in two stages, discrete: the smallest gain near the optimum, with the poles in a
        /// region (method sheet 3.3).
        TwoStageDiscrete = "lmi_two_stage_dt",
        /// The same, continuous.
        TwoStageContinuous = "lmi_two_stage_ct",
        /// Largest fault at bounded disturbance with one Lyapunov matrix, continuous.
        Mixed = "lmi_mixed",
        /// The paper's inequalities (13), (14), whose claim is checked and mostly false (method sheet 3.6).
        Paper = "lmi_paper",
        /// The matrices `L` or `H`, and `V`.
        Given = "given",
    }
}

impl DesignType {
    /// Whether the gain comes from matrix inequalities.
    pub fn needs_solver(self) -> bool {
        self.has_lyapunov_matrix() || self == Self::Paper
    }

    /// Whether the gain comes from a Riccati equation.
    pub fn is_riccati(self) -> bool {
        matches!(self, Self::RiccatiDiscrete | Self::RiccatiContinuous)
    }

    /// Whether a Lyapunov matrix proves the bound of the design.
    pub fn has_lyapunov_matrix(self) -> bool {
        matches!(
            self,
            Self::TwoStageDiscrete | Self::TwoStageContinuous | Self::Mixed
        )
    }

    /// Whether the gain is found in continuous time, as H, whatever the sampled form of the filter.
    pub fn is_continuous(self) -> bool {
        matches!(
            self,
            Self::RiccatiContinuous | Self::TwoStageContinuous | Self::Mixed | Self::Paper
        )
    }

    /// The Riccati design that takes the place of a failed search by matrix inequalities.
    pub fn fallback(self) -> Self {
        match self.is_continuous() {
            true => Self::RiccatiContinuous,
            false => Self::RiccatiDiscrete,
        }
    }
}

choice! {
    /// The blocks of d and f in the paper's inequality (13), and what it claims.
    #[derive(Default)]
    Normalisation {
        /// -I and the claim J < √γ.
        Printed = "printed",
        /// -γI and the claim J < γ.
        #[default] Lemma1 = "lemma1",
    }
}

choice! {
    /// How a filter is read from a solution of the paper's inequalities.
    #[derive(Default)]
    Recovery {
        /// H = R⁻¹Z and W_F from M, K, N, T: the claim does not hold for it.
        AsPrinted = "as_printed",
        /// H = X⁻¹Y', W_F = T_rf.
        #[default] Sound = "sound",
    }
}

/// Where the gain comes from, and how it is weighted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SynthesisOptions {
    /// `"riccati_dt"` (default), `"riccati_ct"`, `"matched"`, `"lmi_two_stage_dt"`, `"lmi_two_stage_ct"`,
    /// `"lmi_mixed"`, `"lmi_paper"` or `"given"`.
    #[serde(rename = "type")]
    pub design: DesignType,
    /// w_d, length m; default: the amplitudes of d. Of the Riccati designs, those of blind filters among them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub disturbance_weight: Option<Vec<f64>>,
    /// w_n, length q, units of y per unit of w_d; default: `disturbance.noise_std`, else 7 % of σ_max(Dd diag w_d).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise_weight: Option<Vec<f64>>,
    /// By how much, relative, the second stage may exceed the optimum of the first; default 0.01; `lmi_two_stage_*` only.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub slack: Option<f64>,
    /// L, n x q, discrete gain; `given` only.
    #[serde(rename = "L", skip_serializing_if = "Option::is_none")]
    pub l: Option<Vec<Vec<f64>>>,
    /// H, n x q, continuous gain in 1/s; `given` only.
    #[serde(rename = "H", skip_serializing_if = "Option::is_none")]
    pub h: Option<Vec<Vec<f64>>>,
    /// V, s x q, post-filter of the residual; `given` and `matched` only, default the identity.
    #[serde(rename = "V", skip_serializing_if = "Option::is_none")]
    pub v: Option<Vec<Vec<f64>>>,
    /// What the designer of a given gain claims of ‖T_rd‖∞; checked.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub claimed_bound: Option<f64>,
    /// α, 1/s: Re λ < -α (continuous), |λ| < e^{-αTs} (discrete); asked of `lmi_*` designs, claimed of a given gain.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pole_decay: Option<f64>,
    /// ρ, 1/s: |λ| < ρ of a continuous gain.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pole_radius: Option<f64>,
    /// r, below 1: |λ| < r of a discrete gain.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub radius_z: Option<f64>,
    /// `"printed"` or `"lemma1"` (default); `lmi_paper` only.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub normalisation: Option<Normalisation>,
    /// `"as_printed"` or `"sound"` (default); `lmi_paper` only.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub recovery: Option<Recovery>,
    /// Largest accepted norm of the gain: 1/s for H, 1 for L.
    pub max_gain: f64,
    /// Whether a gain that fails its certificate (but is stable) may run, without guarantee.
    pub allow_uncertified: bool,
}

impl Default for SynthesisOptions {
    fn default() -> Self {
        Self {
            design: DesignType::default(),
            disturbance_weight: None,
            noise_weight: None,
            slack: None,
            l: None,
            h: None,
            v: None,
            claimed_bound: None,
            pole_decay: None,
            pole_radius: None,
            radius_z: None,
            normalisation: None,
            recovery: None,
            max_gain: 1e4,
            allow_uncertified: false,
        }
    }
}

choice! {
    /// The sampled form of the filter.
    #[derive(Default)]
    RealisationType {
        /// Exact: no command in the residual.
        #[default] DiscreteObserver = "discrete_observer",
        /// First-order hold of the continuous filter.
        FirstOrderHold = "filter_foh",
        /// Zero-order hold of the continuous filter.
        ZeroOrderHold = "filter_zoh",
    }
}

choice! {
    /// Where the filter begins.
    #[derive(Default)]
    InitialType {
        /// From the first complete sample; also after a long gap or a missing command.
        #[default] FirstOutput = "first_output",
        /// From `initial_state`, which speaks of the first instant only.
        Given = "given",
    }
}

/// Sampled form, start and lost samples.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FilterOptions {
    /// `"discrete_observer"` (default), `"filter_foh"` or `"filter_zoh"`; the latter two give no guarantee.
    pub realisation: RealisationType,
    /// `"first_output"` (default) or `"given"`.
    pub initial: InitialType,
    /// x̂₀ (or the prior of what the first output does not show), length n, units of x; default zero.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub initial_state: Option<Vec<f64>>,
    /// ē: |x - `initial_state`| <= ē, length n, units of x. With `first_output` it must hold whenever the filter
    /// starts again, and is not needed if C has full column rank.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub initial_error_bound: Option<Vec<f64>>,
    /// ε: ‖x - `initial_state`‖₂ <= ε, instead of `initial_error_bound`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub initial_error_norm: Option<f64>,
    /// Lost samples in a row after which the filter starts again at the next complete sample.
    pub max_gap: u32,
    /// Largest deviation of the time between two steps, as a part of the period.
    pub jitter_tolerance: f64,
}

impl Default for FilterOptions {
    fn default() -> Self {
        Self {
            realisation: RealisationType::default(),
            initial: InitialType::default(),
            initial_state: None,
            initial_error_bound: None,
            initial_error_norm: None,
            max_gap: 100,
            jitter_tolerance: 0.1,
        }
    }
}

choice! {
    /// What the energy is compared with.
    #[derive(Default)]
    ThresholdType {
        /// The largest energy without fault, sample by sample.
        #[default] Guaranteed = "guaranteed",
        /// `constant_threshold`, as in the paper.
        Constant = "constant",
    }
}

/// Window and thresholds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct EvaluationOptions {
    /// Length of the window, s, a multiple of the period; `"cumulative"`, infinite: from the start on.
    #[serde(with = "window_length")]
    pub window: f64,
    /// Whether the present sample counts (default true); false: left rectangle, as in the paper.
    pub include_current: bool,
    /// Whether each residual is tested by itself; default: whenever amplitudes of d are declared.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub peak_test: Option<bool>,
    /// `"guaranteed"` (default) or `"constant"`.
    pub threshold: ThresholdType,
    /// Units of the residual times √s; `constant` only.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub constant_threshold: Option<f64>,
}

impl Default for EvaluationOptions {
    fn default() -> Self {
        Self {
            window: 1.0,
            include_current: true,
            peak_test: None,
            threshold: ThresholdType::default(),
            constant_threshold: None,
        }
    }
}

/// Bank of filters that are blind to some faults, and the fault estimate (method sheet 4.5).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct IsolationOptions {
    /// One filter per entry: the faults to which it is blind.
    #[serde(default)]
    pub blind_sets: Vec<Vec<String>>,
    /// w_b: how much the blind faults weigh in the design against a disturbance of weight 1.
    #[serde(default = "blind_weight")]
    pub blind_weight: f64,
    /// Names of the columns of Bf and Df; default f1, f2, ...
    #[serde(default)]
    pub fault_names: Vec<String>,
    /// |f| <= bound, length l, units of f: what a blind filter must bear.
    pub fault_bound: Vec<f64>,
    /// |f'| <= slew, length l, units of f per s. Without it faults change at sampling instants only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fault_slew: Option<Vec<f64>>,
    /// s: how long a filter may keep silent before the faults it sees are ruled out, and how long everything must be
    /// silent before what has fired is forgotten.
    #[serde(default = "isolation_wait")]
    pub isolation_wait: f64,
    /// Whether faults are estimated.
    #[serde(default)]
    pub fault_estimate: bool,
}

fn yes() -> bool {
    true
}

fn blind_weight() -> f64 {
    100.0
}

fn isolation_wait() -> f64 {
    1.0
}
