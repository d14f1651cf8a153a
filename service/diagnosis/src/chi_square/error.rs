//! Why the chi-square tests cannot run as configured.

use crate::{method::Refusal, tables::TableError};
use thiserror::Error;

/// Why a model or an option was refused.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ChiSquareError {
    /// A list or matrix of the wrong shape or with an entry that is not finite.
    #[error(transparent)]
    Table(#[from] TableError),
    /// A required entry is not there.
    #[error("`{key}` is missing; {need}")]
    Missing {
        /// Dotted path of the entry.
        key: String,
        /// What to give.
        need: &'static str,
    },
    /// An entry that makes no sense, alone or with others.
    #[error("`{key}` is {value}; {allowed}")]
    InvalidSetting {
        /// Dotted path of the entry.
        key: String,
        /// What was found.
        value: String,
        /// What is allowed.
        allowed: String,
    },
    /// A covariance that is not symmetric.
    #[error("`{key}` is not symmetric: entry ({row}, {column}) differs from its mirror; correct one of them")]
    NotSymmetric {
        /// Dotted path of the matrix.
        key: String,
        /// Row, from 0.
        row: usize,
        /// Column, from 0.
        column: usize,
    },
    /// R is singular or indefinite.
    #[error("`{key}` is not positive definite; every sensor needs noise of its own")]
    MeasurementNoiseNotPositiveDefinite {
        /// Dotted path of the matrix.
        key: String,
    },
    /// Q or P_0 has a negative eigenvalue.
    #[error("`{key}` has a negative eigenvalue, so that it is no covariance; correct its entries")]
    CovarianceNotPositiveSemidefinite {
        /// Dotted path of the matrix.
        key: String,
    },
    /// The eigenvalues of Φ could not be computed.
    #[error(
        "the eigenvalues of `{key}` cannot be computed; scale the states so that its entries are of like size"
    )]
    NoEigenvalues {
        /// Dotted path of the matrix.
        key: String,
    },
    /// The filter does not converge.
    #[error(
        "the mode with the eigenvalue {eigenvalue} of `{key}` does not decay, is driven by noise and is not seen by \
         the sensors, so that the covariance of the estimate grows without bound; measure it, or remove it from the model"
    )]
    Undetectable {
        /// Dotted path of Φ.
        key: String,
        /// The eigenvalue.
        eigenvalue: String,
    },
    /// The plain state test would be blind.
    #[error(
        "`state_plain` is {verdict} (largest excited and observable eigenvalue: modulus {spectral_radius}): its \
         threshold grows without bound and hides every fault; use `state_window` and `glr` instead, or set \
         `statistics.stability_guard` to \"warn\""
    )]
    PlainStateTestRefused {
        /// Verdict of the guard.
        verdict: &'static str,
        /// ρ_eff.
        spectral_radius: f64,
    },
    /// A threshold per run without a model to simulate.
    #[error(
        "the threshold of `{statistic}` cannot be calibrated with `model.schedule` = \"external\", whose matrices are \
         unknown; set `{key}`, or remove the statistic"
    )]
    CalibrationImpossible {
        /// Dotted path of the entry that would help.
        key: &'static str,
        /// The statistic.
        statistic: &'static str,
    },
    /// Matrices per instant in a configuration.
    #[error(
        "`model.schedule` = \"external\" needs a program that gives the matrices of every instant; use \"constant\" or \
         \"selected\" in a configuration"
    )]
    ExternalSchedule,
    /// More channels than a record holds.
    #[error(
        "{count} channels would be published, a record holds {limit}; enable fewer `statistics` or windows"
    )]
    TooManyChannels {
        /// Channels wanted.
        count: usize,
        /// Largest number.
        limit: usize,
    },
    /// More faults than a record can name.
    #[error("{count} sensors and process faults can be faulty, a record names {limit}; use fewer")]
    TooManyFaults {
        /// Faults wanted.
        count: usize,
        /// Largest number.
        limit: usize,
    },
}

impl ChiSquareError {
    /// Dotted path, inside the diagnoser's table, of the entry to look at.
    pub fn key(&self) -> String {
        match self {
            Self::Table(error) => error.key(),
            Self::Missing { key, .. }
            | Self::InvalidSetting { key, .. }
            | Self::NotSymmetric { key, .. }
            | Self::MeasurementNoiseNotPositiveDefinite { key }
            | Self::CovarianceNotPositiveSemidefinite { key }
            | Self::NoEigenvalues { key }
            | Self::Undetectable { key, .. } => key.clone(),
            Self::PlainStateTestRefused { .. } | Self::TooManyChannels { .. } => {
                "statistics.enabled".to_owned()
            }
            Self::CalibrationImpossible { key, .. } => (*key).to_owned(),
            Self::ExternalSchedule => "model.schedule".to_owned(),
            Self::TooManyFaults { .. } => "model.measurement".to_owned(),
        }
    }

    /// A setting that is not allowed.
    pub(super) fn setting(key: &str, value: impl ToString, allowed: impl ToString) -> Self {
        Self::InvalidSetting {
            key: key.to_owned(),
            value: value.to_string(),
            allowed: allowed.to_string(),
        }
    }
}

impl From<ChiSquareError> for Refusal {
    fn from(error: ChiSquareError) -> Self {
        Self {
            key: error.key(),
            message: error.to_string(),
        }
    }
}
