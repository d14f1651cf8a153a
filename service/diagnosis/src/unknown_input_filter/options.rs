//! What a user can set for a bank of unknown-input filters (method sheet 7).

use super::certificate::ParityCertificate;
use super::modes::{FaultMode, enumerate_modes};
use crate::choice::choice;
pub use crate::zonotope::Reduction;
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

/// The part of a diagnoser's table that belongs to `method = "unknown_input_filter"`, without its model.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct UnknownInputFilterOptions {
    /// `[diagnoser.bank]`: modes, isolation and resets.
    pub bank: BankOptions,
    /// `[diagnoser.filter]`: form and gain of the filters, what they publish.
    pub filter: FilterOptions,
    /// `[diagnoser.parity]`: tests over windows of several samples.
    pub parity: ParityOptions,
    /// `[diagnoser.missing]`: what a missing measurement means.
    pub missing: MissingOptions,
}

/// Modes, isolation and resets of the bank (method sheet 4.5, 4.6).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct BankOptions {
    /// Orders of the modes: `[1]` (default) for single faults, `[1, 2]` for single faults and pairs.
    pub simultaneous_faults: Vec<usize>,
    /// Whether the fault-free mode runs beside the others (default true): it detects sooner.
    pub fault_free_mode: bool,
    /// Whether a mode that can never be tested is kept as a never-falsified candidate instead of being refused
    /// (default false).
    pub allow_untestable_modes: bool,
    /// `"latched"` (default) or `"instantaneous"`, the paper's rule, in the paper form only.
    pub isolation: Isolation,
    /// Longest window, in samples, of the off-line search for delayed isolability; default 4 nx.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_isolation_window: Option<usize>,
    /// Tested instants without an alarm after which an episode ends; 0 = only on request. Default 50.
    pub clear_samples: u32,
    /// How a filter restarts after an alarm: `"auto"` (default), `"strip"`, `"copy"` or `"none"`.
    pub reset: ResetRule,
}

impl BankOptions {
    /// The modes of the bank for a plant with so many actuators (see [`enumerate_modes`]).
    pub fn modes(&self, actuator_count: usize) -> Vec<FaultMode> {
        enumerate_modes(
            actuator_count,
            self.fault_free_mode,
            self.simultaneous_faults.contains(&2),
        )
    }
}

impl Default for BankOptions {
    fn default() -> Self {
        Self {
            simultaneous_faults: vec![1],
            fault_free_mode: true,
            allow_untestable_modes: false,
            isolation: Isolation::default(),
            max_isolation_window: None,
            clear_samples: 50,
            reset: ResetRule::default(),
        }
    }
}

/// Form, gain and tests of each filter (method sheet 4.2, 4.10, 4.11).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FilterOptions {
    /// `"coupled"` (default), `"paper"` or `"kalman_3sigma"`.
    pub form: Form,
    /// Where the first set comes from: `"auto"` (default: strip if available), `"prior"` or `"strip"`.
    pub initialisation: Initialisation,
    /// Gain of the coupled form: `"row_wise"` (default), `"fixed"` or `"frobenius"`.
    pub gain: GainRule,
    /// Reweighted least-squares sweeps of the row-wise gain, 0 (default) to 6.
    pub gain_sweeps: usize,
    /// Generator order s: columns kept, more than nx. Default 30, in the paper form 50.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub generator_order: Option<usize>,
    /// `"girard_scaled"` or `"euclidean"`. Default: scaled, in the paper form euclidean.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reduction: Option<Reduction>,
    /// `"tight"` (default), or `"printed"` in the paper form only.
    pub test: TestRule,
    /// Whether rounding errors are bounded as well (default true).
    pub outward_rounding: bool,
    /// Initial covariance of the state, nx x nx, symmetric; required in the `kalman_3sigma` form, only there.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub initial_covariance: Option<Vec<Vec<f64>>>,
    /// Threshold of the innovation's norm, in units of y; required in the `kalman_3sigma` form, only there.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub residual_norm_threshold: Option<f64>,
    /// Free matrix S of the paper's equation (28), nx x ny; default zero. In the coupled form it only shapes the
    /// test rows (I - CS) P. The fault-free mode has none.
    #[serde(rename = "S", skip_serializing_if = "Option::is_none")]
    pub s: Option<Vec<Vec<f64>>>,
    /// Typical |x|, length nx, state units, used for off-line optimisation only; default zero.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nominal_state_magnitude: Option<Vec<f64>>,
    /// Fault sizes that must stay detectable, length nu, units of u: a record is flagged THRESHOLD_INERT while
    /// they are not. Default: never flagged.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fault_of_interest: Option<Vec<f64>>,
    /// `"all"` (default) channels, or `"worst"`: one per mode.
    pub publish: Publish,
}

impl Default for FilterOptions {
    fn default() -> Self {
        Self {
            form: Form::default(),
            initialisation: Initialisation::default(),
            gain: GainRule::default(),
            gain_sweeps: 0,
            generator_order: None,
            reduction: None,
            test: TestRule::default(),
            outward_rounding: true,
            initial_covariance: None,
            residual_norm_threshold: None,
            s: None,
            nominal_state_magnitude: None,
            fault_of_interest: None,
            publish: Publish::default(),
        }
    }
}

impl FilterOptions {
    /// The generator order in force: as configured, else 50 in the paper form and 30 otherwise.
    pub fn effective_generator_order(&self) -> usize {
        self.generator_order
            .unwrap_or(if self.form == Form::Paper { 50 } else { 30 })
    }

    /// The reduction in force: as configured, else euclidean in the paper form and scaled otherwise.
    pub fn effective_reduction(&self) -> Reduction {
        self.reduction.unwrap_or(match self.form {
            Form::Paper => Reduction::Euclidean,
            Form::Coupled | Form::Kalman3Sigma => Reduction::GirardScaled,
        })
    }
}

/// Tests over windows of several samples (method sheet 3.4, 4.4).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ParityOptions {
    /// Fault durations, in samples, for which certificates are designed; `[]` = off. Default 1, 3, 10, 30.
    pub lengths: Vec<usize>,
    /// Samples before the fault that a certificate may use: a number, or `"auto"` (default): 0 if C has full
    /// column rank, else 30.
    pub pre_samples: PreSamples,
    /// The certificates of the parity tests; without them none runs. Their design needs a solver, so that it is
    /// left to whoever builds the bank.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub certificates: Option<Vec<ParityCertificate>>,
}

impl Default for ParityOptions {
    fn default() -> Self {
        Self {
            lengths: vec![1, 3, 10, 30],
            pre_samples: PreSamples::Auto,
            certificates: None,
        }
    }
}

/// What a missing measurement means (method sheet 4.7).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MissingOptions {
    /// `"bounded_fault"` (default, needs `fault_bound`) or `"unbounded_fault"`.
    pub policy: MissingPolicy,
    /// Bound of |f|, length nu, units of u; only relied upon while samples are missing.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fault_bound: Option<Vec<f64>>,
}

choice! {
    /// How faults are isolated.
    #[derive(Default)]
    Isolation {
        /// A falsified mode stays out until the episode ends.
        #[default] Latched = "latched",
        /// The paper's rule: the modes that are silent at this instant.
        Instantaneous = "instantaneous",
    }
}

choice! {
    /// How a filter whose set may have lost the state restarts (method sheet 4.6).
    #[derive(Default)]
    ResetRule {
        /// Strip if available and the packet is complete, else copy.
        #[default] Auto = "auto",
        /// From the present measurement only.
        Strip = "strip",
        /// From the sets of the surviving modes only.
        Copy = "copy",
        /// Never.
        None = "none",
    }
}

choice! {
    /// The form of the filter.
    #[derive(Default)]
    Form {
        /// The same noise in prediction and correction: tight test and smaller sets.
        #[default] Coupled = "coupled",
        /// As printed in the paper.
        Paper = "paper",
        /// Kalman-type baseline with 3σ thresholds; no guarantee.
        Kalman3Sigma = "kalman_3sigma",
    }
}

choice! {
    /// Where the first set comes from (method sheet 4.1).
    #[derive(Default)]
    Initialisation {
        /// Strip if available, else prior.
        #[default] Auto = "auto",
        /// The configured initial box.
        Prior = "prior",
        /// The first complete measurement.
        Strip = "strip",
    }
}

choice! {
    /// How the gain of the coupled form is chosen (method sheet 4.2).
    #[derive(Default)]
    GainRule {
        /// For each state the narrowest of several candidates.
        #[default] RowWise = "row_wise",
        /// The off-line gain.
        Fixed = "fixed",
        /// The minimiser of the Frobenius norm.
        Frobenius = "frobenius",
    }
}

choice! {
    /// The half width that a residual is compared with.
    #[derive(Default)]
    TestRule {
        /// The exact spread of the residual over the predicted set.
        #[default] Tight = "tight",
        /// As printed in the paper: counts the measurement noise twice.
        Printed = "printed",
    }
}

choice! {
    /// Which channels a record has (method sheet 4.12).
    #[derive(Default)]
    Publish {
        /// Every row, every window, every estimate.
        #[default] All = "all",
        /// One channel per mode: the one nearest to alarm.
        Worst = "worst",
    }
}

choice! {
    /// What is assumed of a mode's own fault while measurements are missing (method sheet 4.7).
    #[derive(Default)]
    MissingPolicy {
        /// |f| <= `fault_bound`.
        #[default] BoundedFault = "bounded_fault",
        /// Nothing.
        UnboundedFault = "unbounded_fault",
    }
}

/// Number of samples before the fault in the window of a certificate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PreSamples {
    /// 0 if C has full column rank, else 30.
    #[default]
    Auto,
    /// As many as this.
    Count(usize),
}

impl PreSamples {
    /// The number in force; `strip_available` says whether one measurement determines the state.
    pub fn count(self, strip_available: bool) -> usize {
        match self {
            Self::Count(count) => count,
            Self::Auto if strip_available => 0,
            Self::Auto => 30,
        }
    }
}

impl Serialize for PreSamples {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Auto => serializer.serialize_str("auto"),
            Self::Count(count) => serializer.serialize_u64(*count as u64),
        }
    }
}

impl<'de> Deserialize<'de> for PreSamples {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Visitor;
        impl de::Visitor<'_> for Visitor {
            type Value = PreSamples;

            fn expecting(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                formatter.write_str("\"auto\" or a number of samples")
            }

            fn visit_str<E: de::Error>(self, text: &str) -> Result<PreSamples, E> {
                if text == "auto" {
                    Ok(PreSamples::Auto)
                } else {
                    Err(E::invalid_value(de::Unexpected::Str(text), &self))
                }
            }

            fn visit_u64<E: de::Error>(self, count: u64) -> Result<PreSamples, E> {
                usize::try_from(count).map(PreSamples::Count).map_err(E::custom)
            }

            fn visit_i64<E: de::Error>(self, count: i64) -> Result<PreSamples, E> {
                usize::try_from(count)
                    .map(PreSamples::Count)
                    .map_err(|_| E::invalid_value(de::Unexpected::Signed(count), &self))
            }
        }
        deserializer.deserialize_any(Visitor)
    }
}

#[cfg(test)]
#[path = "options_tests.rs"]
mod tests;
