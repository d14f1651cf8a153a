//! Why a bank could not be built.

use thiserror::Error;

use super::{
    certificate::CertificateError, checks::CheckError, modes::FaultMode, options_error::OptionsError,
};

/// Why a bank of unknown-input filters could not be built from a model and options.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ConstructionError {
    /// Options that do not fit together or do not fit the model.
    #[error(transparent)]
    Options(#[from] OptionsError),
    /// A mode that can never be falsified.
    #[error(transparent)]
    Check(#[from] CheckError),
    /// A certificate that does not belong to the model.
    #[error(transparent)]
    Certificate(#[from] CertificateError),
    /// More channels than a record holds.
    #[error(
        "the bank would publish {count} channels, a record holds {limit}; set `filter.publish` = \"worst\", or \
         fewer `parity.lengths`"
    )]
    TooManyChannels {
        /// Channels of the bank.
        count: usize,
        /// Largest number of channels.
        limit: usize,
    },
    /// `gain = "fixed"` with a mode that has none, or a loaded gain that is not stable.
    #[error(
        "no stable fixed gain is known for the mode {mode}; use `filter.gain` = \"row_wise\", which needs none"
    )]
    NoStableFixedGain {
        /// The mode.
        mode: FaultMode,
    },
    /// A fixed gain for a mode without filter.
    #[error("there is no filter for the mode {mode}, so that no gain can be loaded for it")]
    FixedGainWithoutMode {
        /// The mode.
        mode: FaultMode,
    },
    /// A fixed gain of the wrong shape.
    #[error("the fixed gain of the mode {mode} is {actual:?} but must be {expected:?} (states, outputs)")]
    FixedGainShape {
        /// The mode.
        mode: FaultMode,
        /// Rows and columns found.
        actual: (usize, usize),
        /// Rows and columns needed.
        expected: (usize, usize),
    },
}
