//! What can be wrong with a model.

use thiserror::Error;

/// Why a model was refused. [`ModelError::key`] names the entry of the configuration to look at.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ModelError {
    /// A matrix or vector without entries where at least one is needed.
    #[error("`{key}` is empty; it needs at least one {what}")]
    EmptyModel {
        /// Dotted path of the entry.
        key: &'static str,
        /// What is missing: state, actuator or output.
        what: &'static str,
    },
    /// A matrix or vector of the wrong shape.
    #[error("`{key}` is {actual} but must be {expected} ({meaning}); correct it or the matrix it must fit")]
    DimensionMismatch {
        /// Dotted path of the entry.
        key: &'static str,
        /// The shape found, for instance "3 x 2".
        actual: String,
        /// The shape needed.
        expected: String,
        /// What the numbers stand for, for instance "states x actuators".
        meaning: &'static str,
    },
    /// The rows of a matrix have different lengths.
    #[error("row {row} of `{key}` has {actual} entries, row 0 has {expected}; all rows need the same length")]
    RaggedRows {
        /// Dotted path of the entry.
        key: &'static str,
        /// The row, from 0.
        row: usize,
        /// Its length.
        actual: usize,
        /// The length of row 0.
        expected: usize,
    },
    /// An infinite entry or one that is not a number.
    #[error("`{key}` has the entry {value} at {position}; only finite numbers are allowed")]
    NonFinite {
        /// Dotted path of the entry.
        key: &'static str,
        /// Where, for instance "row 0, column 2".
        position: String,
        /// The entry.
        value: f64,
    },
    /// A bound or radius below zero.
    #[error("`{key}` has the entry {value} at {position}; a bound is never negative")]
    NegativeBound {
        /// Dotted path of the entry.
        key: &'static str,
        /// Where in the vector or matrix.
        position: String,
        /// The entry.
        value: f64,
    },
    /// A lower bound above its upper bound.
    #[error("`{key}`[{index}] = {lower} is above its upper bound {upper}; exchange or correct the two")]
    LowerAboveUpper {
        /// Dotted path of the lower bound.
        key: &'static str,
        /// Position, from 0.
        index: usize,
        /// The lower bound.
        lower: f64,
        /// The upper bound.
        upper: f64,
    },
    /// An entry that only makes sense together with another one.
    #[error("`{present}` is given without `{key}`; give both or neither")]
    MissingPartner {
        /// Dotted path of the missing entry.
        key: &'static str,
        /// Dotted path of the given entry.
        present: &'static str,
    },
    /// Two states, actuators or outputs with the same name.
    #[error("`{key}` contains the name \"{name}\" twice; names must be unique")]
    DuplicateName {
        /// Dotted path of the list.
        key: &'static str,
        /// The name.
        name: String,
    },
    /// An empty name.
    #[error("`{key}`[{index}] is empty; every name needs at least one character")]
    EmptyName {
        /// Dotted path of the list.
        key: &'static str,
        /// Position, from 0.
        index: usize,
    },
    /// More actuators than a fault set can hold.
    #[error("`model.B` has {count} columns; at most {limit} actuators can be monitored by one diagnoser")]
    TooManyActuators {
        /// Number of actuators.
        count: usize,
        /// The largest number.
        limit: usize,
    },
    /// The sampling period is not a positive finite number.
    #[error("`sample_time_s` is {value}; it must be a positive number of seconds")]
    InvalidSampleTime {
        /// The value.
        value: f64,
    },
    /// A continuous model without a discretisation rule.
    #[error(
        "`model.time` is \"continuous\" but `model.discretisation` is missing; choose \"zero_order_hold\" (exact \
         for held inputs) or \"euler\""
    )]
    DiscretisationMissing,
    /// A discretisation rule for a model that is discrete already.
    #[error(
        "`model.discretisation` is given for a discrete model; remove it or set `model.time` to \"continuous\""
    )]
    DiscretisationUnused,
    /// Parameter uncertainty together with zero-order hold.
    #[error(
        "`model.A_uncertainty` cannot be carried through the matrix exponential without losing its entrywise form \
         (it would also make B and D uncertain); use `discretisation = \"euler\"`, or discretise the model \
         yourself and give the uncertainty per step"
    )]
    UncertaintyWithZeroOrderHold,
    /// The discretised matrices overflow.
    #[error(
        "discretising the model over {sample_time_s} s gives non-finite entries; the entries of `model.A` are too \
         large for this sampling period"
    )]
    DiscretisationOverflow {
        /// The sampling period.
        sample_time_s: f64,
    },
}

impl ModelError {
    /// Dotted path, inside the diagnoser's table, of the entry to look at: for instance `model.B`.
    pub fn key(&self) -> String {
        match self {
            Self::EmptyModel { key, .. }
            | Self::DimensionMismatch { key, .. }
            | Self::RaggedRows { key, .. }
            | Self::NonFinite { key, .. }
            | Self::NegativeBound { key, .. }
            | Self::LowerAboveUpper { key, .. }
            | Self::MissingPartner { key, .. }
            | Self::DuplicateName { key, .. }
            | Self::EmptyName { key, .. } => key,
            Self::TooManyActuators { .. } => "model.B",
            Self::InvalidSampleTime { .. } => "sample_time_s",
            Self::DiscretisationMissing => "model.time",
            Self::DiscretisationUnused => "model.discretisation",
            Self::UncertaintyWithZeroOrderHold => "model.A_uncertainty",
            Self::DiscretisationOverflow { .. } => "model.A",
        }
        .to_owned()
    }
}
