//! What the checks found, and what to do about it.

use crate::unknown_input_filter::modes::FaultMode;
use crate::unknown_input_filter::options::Form;
use std::fmt;
use thiserror::Error;

/// The result of the checks of a bank.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CheckReport {
    /// Whether each mode can be tested, in the order of the modes checked.
    pub testable: Vec<bool>,
    /// How well each testable mode tells foreign faults from its own.
    pub isolability: Vec<Isolability>,
    /// What works less well than one might expect.
    pub warnings: Vec<CheckWarning>,
}

/// How well the fault of one actuator is told from those of a mode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Isolability {
    /// The mode.
    pub mode: FaultMode,
    /// An actuator outside the mode.
    pub actuator: usize,
    /// Smallest singular value of the normalised columns C\[F B_j\]: 1 = orthogonal, 0 = not separable.
    pub sigma_min: f64,
    /// Samples that a constant fault must last to be told from the mode: 1 if σ_min >= 1e-6; `None` if no window up to
    /// the longest one searched can tell them apart.
    pub samples: Option<usize>,
}

/// Why a mode is refused.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum CheckError {
    /// No output reacts to the fault within one step.
    #[error(
        "no output shows a fault of \"{name}\" (actuator {actuator}) one step later: C B_j = 0; add a sensor that \
         sees it, leave the actuator out of the model, or set `bank.allow_untestable_modes`"
    )]
    FaultNotVisible {
        /// The actuator.
        actuator: usize,
        /// Its name.
        name: String,
    },
    /// The outputs cannot separate the mode's own faults from each other.
    #[error(
        "the faults of the mode {mode} ({name}) look alike in the outputs (smallest singular value {sigma_min:e}, \
         1e-6 needed); add a sensor, merge the actuators into one, or set `bank.allow_untestable_modes`"
    )]
    FaultsNotDecouplable {
        /// The mode.
        mode: FaultMode,
        /// Names of its actuators.
        name: String,
        /// Smallest singular value of the normalised columns of CF.
        sigma_min: f64,
    },
    /// The mode's faults explain every output.
    #[error(
        "the mode {mode} ({name}) has as many unknown faults as there are outputs ({outputs}) and could never be \
         falsified; add a sensor, leave `2` out of `bank.simultaneous_faults`, or set `bank.allow_untestable_modes`"
    )]
    NoTestRow {
        /// The mode.
        mode: FaultMode,
        /// Names of its actuators.
        name: String,
        /// ny.
        outputs: usize,
    },
    /// S removes every foreign fault from the test.
    #[error(
        "with this `filter.S` no fault can falsify the mode {mode} ({name}): S is too close to a left inverse of C; \
         leave it out (zero is the best choice)"
    )]
    VacuousTest {
        /// The mode.
        mode: FaultMode,
        /// Names of its actuators.
        name: String,
    },
}

impl CheckError {
    /// Dotted path, inside the diagnoser's table, of the entry to look at.
    pub fn key(&self) -> String {
        match self {
            Self::FaultNotVisible { .. } | Self::FaultsNotDecouplable { .. } => "model.C",
            Self::NoTestRow { mode, .. } if mode.len() > 1 => "bank.simultaneous_faults",
            Self::NoTestRow { .. } => "model.C",
            Self::VacuousTest { .. } => "filter.S",
        }
        .to_owned()
    }
}

/// What works less well than one might expect; the guarantee holds all the same.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum CheckWarning {
    /// A mode without a filter.
    UntestableMode {
        /// The mode.
        mode: FaultMode,
        /// Names of its actuators.
        name: String,
    },
    /// A foreign fault that falsifies the mode only when it lasts.
    IsolableAfter {
        /// The mode.
        mode: FaultMode,
        /// Names of its actuators.
        name: String,
        /// The foreign actuator.
        actuator: usize,
        /// Its name.
        fault: String,
        /// L: samples the fault has to last.
        length: usize,
    },
    /// A constant foreign fault that the mode's own faults imitate over the whole search window.
    NotIsolable {
        /// The mode.
        mode: FaultMode,
        /// Names of its actuators.
        name: String,
        /// The foreign actuator.
        actuator: usize,
        /// Its name.
        fault: String,
        /// Longest window searched, samples.
        longest: usize,
    },
    /// A set whose radius grows: a mode of the plant that is not stable and that the tests do not see.
    UnboundedSet {
        /// The mode.
        mode: FaultMode,
        /// Names of its actuators.
        name: String,
        /// Real part of the eigenvalue λ.
        real: f64,
        /// Imaginary part of the eigenvalue λ, >= 0.
        imaginary: f64,
    },
    /// The eigenvalues for the check of boundedness could not be computed.
    BoundednessUnknown {
        /// The mode.
        mode: FaultMode,
        /// Names of its actuators.
        name: String,
    },
    /// After a missing measurement no set may ever be found again.
    LossNotRecoverable {
        /// The form of the filter.
        form: Form,
    },
}

impl CheckWarning {
    /// Dotted path, inside the diagnoser's table, of the entry to look at.
    pub fn key(&self) -> String {
        match self {
            Self::UntestableMode { .. } => "bank.allow_untestable_modes",
            Self::IsolableAfter { .. } | Self::NotIsolable { .. } => "model.C",
            Self::UnboundedSet { .. } | Self::BoundednessUnknown { .. } => "model.A",
            Self::LossNotRecoverable { form: Form::Coupled } => "missing.policy",
            Self::LossNotRecoverable { .. } => "model.state_box_lower",
        }
        .to_owned()
    }
}

impl fmt::Display for CheckWarning {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::UntestableMode { mode, name } => write!(
                formatter,
                "the mode {mode} ({name}) has no test: it is never falsified and stays a candidate in every \
                 decision; add a sensor to test it"
            ),
            Self::IsolableAfter { mode, name, fault, length, .. } => write!(
                formatter,
                "a fault of \"{fault}\" looks like the mode {mode} ({name}) in one sample; only one that lasts \
                 {length} samples or more can be told from it, by a parity test: keep a length of at least {length} \
                 in `parity.lengths`"
            ),
            Self::NotIsolable { mode, name, fault, longest, .. } => write!(
                formatter,
                "a constant fault of \"{fault}\" cannot be told from the mode {mode} ({name}) by {longest} samples \
                 or fewer: decisions will list both; add a sensor that separates them or raise \
                 `bank.max_isolation_window`"
            ),
            Self::UnboundedSet { mode, name, real, imaginary } => write!(
                formatter,
                "the state set of the mode {mode} ({name}) grows without bound along the eigenvalue {real} ± \
                 {imaginary}i, which its tests do not see: its thresholds may become useless; add a sensor for that \
                 part of the plant"
            ),
            Self::BoundednessUnknown { mode, name } => write!(
                formatter,
                "the eigenvalues of the mode {mode} ({name}) could not be computed, so that its set may grow \
                 without bound; scale the states to comparable size"
            ),
            Self::LossNotRecoverable { form: Form::Coupled } => formatter.write_str(
                "with `missing.policy` = \"unbounded_fault\" a missing measurement leaves a set that may stay unbounded, \
                 because one measurement does not determine the state; use \"bounded_fault\" with \
                 `missing.fault_bound`, or give `model.state_box_lower` and `model.state_box_upper`",
            ),
            Self::LossNotRecoverable { .. } => formatter.write_str(
                "after a missing measurement this form restarts from one complete measurement or from a box, but one \
                 measurement does not determine the state and there is no box; give `model.state_box_lower` and \
                 `model.state_box_upper`",
            ),
        }
    }
}
