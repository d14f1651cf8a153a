//! Why a bank could not be built.

use thiserror::Error;

use super::{checks::CheckError, gains_check::GainsError, modes::FaultMode, options_error::OptionsError};

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
    /// Gains that fail a condition.
    #[error(transparent)]
    Gains(#[from] GainsError),
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
    /// `gain = "fixed"` with a mode that has none.
    #[error(
        "no stable fixed gain is known for the mode {mode}; use `filter.gain` = \"row_wise\", which needs none"
    )]
    NoStableFixedGain {
        /// The mode.
        mode: FaultMode,
    },
}
