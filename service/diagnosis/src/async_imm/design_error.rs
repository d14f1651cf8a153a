//! Why a design cannot run, and what to do about it.

use crate::tables::TableError;
use thiserror::Error;

/// The first condition of method sheet 3 that a design does not meet.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum DesignError {
    /// A list or matrix is not rectangular, not finite or of the wrong shape.
    #[error(transparent)]
    Table(#[from] TableError),
    /// A list or matrix does not have the shape that the others ask for.
    #[error("`{name}` is {actual}, but {expected} is needed; correct its shape")]
    DimensionMismatch {
        /// Dotted path of the entry.
        name: String,
        /// The shape found.
        actual: String,
        /// The shape needed and its meaning.
        expected: String,
    },
    /// An entry is infinite or not a number.
    #[error("`{name}` holds an entry that is not finite; use finite numbers")]
    NotFinite {
        /// Dotted path of the entry.
        name: String,
    },
    /// A setting is missing, superfluous or out of its range.
    #[error("`{key}` is {value}; {allowed}")]
    InvalidSetting {
        /// Dotted path of the entry.
        key: String,
        /// What is configured.
        value: String,
        /// What is allowed.
        allowed: String,
    },
    /// The first mode has a direction that is not zero.
    #[error(
        "the first mode has a fault direction that is not zero; list the normal mode, with a direction of zeros, first"
    )]
    FirstModeNotNormal,
    /// Two modes are the same hypothesis.
    #[error("the modes {i} and {j} (counted from 0) have the same direction; remove one of them")]
    DuplicateModes {
        /// The first.
        i: usize,
        /// The second.
        j: usize,
    },
    /// R of a sensor is no covariance of noise.
    #[error(
        "`sensor.{sensor}.noise_covariance` (sensor \"{name}\") is not symmetric and positive definite; give every \
         row of the sensor a noise of its own"
    )]
    NoiseCovarianceNotPositiveDefinite {
        /// Number of the sensor, from 0.
        sensor: usize,
        /// Its name.
        name: String,
    },
    /// A covariance has a negative eigenvalue or is not symmetric.
    #[error("`{name}` is not symmetric and positive semidefinite; correct its entries")]
    CovarianceNotPositiveSemidefinite {
        /// Dotted path of the entry.
        name: String,
    },
    /// A row of Λ or Γ is no row of probabilities or rates.
    #[error("row {row} of `{key}` {what}; correct it")]
    TransitionInvalid {
        /// Dotted path of the matrix.
        key: &'static str,
        /// The row, from 0.
        row: usize,
        /// What is wrong with it.
        what: &'static str,
    },
    /// μ₀ is no distribution.
    #[error("`initial.mode_probability` is not a list of probabilities that sum to 1; correct it")]
    ModeProbabilityInvalid,
    /// An unstable or undamped part of the plant is seen by no sensor.
    #[error(
        "the sensors together do not see the eigenvalue {re} + {im}i (1/s) of `plant.A`, which does not decay; the \
         estimate would drift away: add a sensor that sees it or take it out of the model"
    )]
    NotDetectable {
        /// Real part of the eigenvalue.
        re: f64,
        /// Imaginary part.
        im: f64,
    },
    /// The eigenvalues of A could not be computed.
    #[error("the eigenvalues of `plant.A` cannot be computed; scale the states to comparable units")]
    EigenvaluesNotFound,
    /// The sensors cannot tell the amplitude of a mode from the rest.
    #[error(
        "the amplitude of mode {mode} (\"{name}\") cannot be estimated from these sensors in the steady state; add a \
         sensor, or leave out one of its channels"
    )]
    AmplitudeNotObservable {
        /// Number of the mode, from 0.
        mode: usize,
        /// Its name.
        name: String,
    },
    /// The paper's form does not fit the rest.
    #[error("`form` = \"batch_unobserved\" does not apply: {reason}; use \"sequential\"")]
    BatchFormNotApplicable {
        /// Why.
        reason: String,
    },
    /// More channels than a record has.
    #[error(
        "{count} channels are needed (1 + fault modes + fault channels), but a record has {limit}; configure fewer \
         modes or several diagnosers"
    )]
    TooManyChannels {
        /// Channels needed.
        count: usize,
        /// Channels of a record.
        limit: usize,
    },
}

impl DesignError {
    /// Dotted path, inside the diagnoser's table, of the entry to look at.
    pub fn key(&self) -> String {
        match self {
            Self::Table(error) => error.key(),
            Self::DimensionMismatch { name, .. }
            | Self::NotFinite { name }
            | Self::CovarianceNotPositiveSemidefinite { name } => name.clone(),
            Self::InvalidSetting { key, .. } => key.clone(),
            Self::FirstModeNotNormal => "mode.0.direction".to_owned(),
            Self::DuplicateModes { j, .. } => format!("mode.{j}.direction"),
            Self::NoiseCovarianceNotPositiveDefinite { sensor, .. } => {
                format!("sensor.{sensor}.noise_covariance")
            }
            Self::TransitionInvalid { key, row, .. } => format!("{key}.{row}"),
            Self::ModeProbabilityInvalid => "initial.mode_probability".to_owned(),
            Self::NotDetectable { .. } | Self::EigenvaluesNotFound => "plant.A".to_owned(),
            Self::AmplitudeNotObservable { mode, .. } => format!("mode.{mode}.direction"),
            Self::BatchFormNotApplicable { .. } => "form".to_owned(),
            Self::TooManyChannels { .. } => "mode".to_owned(),
        }
    }

    pub(super) fn setting(key: impl Into<String>, value: impl ToString, allowed: impl Into<String>) -> Self {
        Self::InvalidSetting {
            key: key.into(),
            value: value.to_string(),
            allowed: allowed.into(),
        }
    }
}
