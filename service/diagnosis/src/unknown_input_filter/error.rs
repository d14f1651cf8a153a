//! Why a bank could not be built.

use thiserror::Error;

use super::{certificate::CertificateError, modes::FaultMode, options_error::OptionsError};

/// Why a bank of unknown-input filters could not be built from a model and options.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ConstructionError {
    /// Options that do not fit together or do not fit the model.
    #[error(transparent)]
    Options(#[from] OptionsError),
    /// A certificate that does not belong to the model.
    #[error(transparent)]
    Certificate(#[from] CertificateError),
    /// A certificate for a mode that the bank does not have.
    #[error(
        "`parity.certificates` has an entry for the mode {mode}, which is not a mode of this bank; remove it, or \
         add its order to `bank.simultaneous_faults`"
    )]
    CertificateWithoutMode {
        /// The mode of the certificate.
        mode: FaultMode,
    },
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
    /// `gain = "fixed"` with a mode for which no stable fixed gain was found.
    #[error(
        "no stable fixed gain was found for the mode {mode}; use `filter.gain` = \"row_wise\", which needs none"
    )]
    NoStableFixedGain {
        /// The mode.
        mode: FaultMode,
    },
}
