//! Which options do not fit together or do not fit the model, and what to do about it.

use thiserror::Error;

/// Why the options of an unknown-input filter bank were refused.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum OptionsError {
    /// The generator order leaves no column beside the box.
    #[error(
        "`filter.generator_order` is {order} but the model has {states} states; it must be at least {states} + 1"
    )]
    GeneratorOrderTooSmall {
        /// The configured order s.
        order: usize,
        /// nx.
        states: usize,
    },
    /// Orders of modes other than singles, or singles and pairs.
    #[error(
        "`bank.simultaneous_faults` is {orders:?}; use [1] for single faults or [1, 2] for single faults and pairs \
         (pairs never run without the single modes)"
    )]
    SimultaneousFaults {
        /// The configured orders.
        orders: Vec<usize>,
    },
    /// A number outside its range.
    #[error("`{key}` is {value}; {allowed}")]
    OutOfRange {
        /// Dotted path of the entry.
        key: &'static str,
        /// The configured value.
        value: f64,
        /// What is allowed.
        allowed: &'static str,
    },
    /// An option that belongs to another form of the filter.
    #[error("`{key}` = {value} needs `filter.form` = \"{form}\"; remove it or change the form")]
    NeedsForm {
        /// Dotted path of the entry.
        key: &'static str,
        /// The configured value.
        value: String,
        /// The form it belongs to.
        form: &'static str,
    },
    /// An option without which the chosen form cannot run.
    #[error("`{key}` is missing; {reason}")]
    Missing {
        /// Dotted path of the missing entry.
        key: &'static str,
        /// Why it is needed and what to do.
        reason: &'static str,
    },
    /// A list or matrix of the wrong shape.
    #[error("`{key}` is {actual} but must be {expected}")]
    DimensionMismatch {
        /// Dotted path of the entry.
        key: &'static str,
        /// The shape found.
        actual: String,
        /// The shape needed and its meaning.
        expected: String,
    },
    /// An entry that is negative, infinite or not a number.
    #[error("`{key}` has the entry {value} at position {index}; it must be finite and not negative")]
    NegativeBound {
        /// Dotted path of the entry.
        key: &'static str,
        /// Position, from 0.
        index: usize,
        /// The entry.
        value: f64,
    },
    /// A matrix entry that is infinite or not a number.
    #[error("`{key}` has the entry {value} in row {row}, column {column}; only finite numbers are allowed")]
    NonFinite {
        /// Dotted path of the entry.
        key: &'static str,
        /// Row, from 0.
        row: usize,
        /// Column, from 0.
        column: usize,
        /// The entry.
        value: f64,
    },
    /// A covariance that is not symmetric and positive semidefinite.
    #[error("`filter.initial_covariance` must be symmetric and positive semidefinite; correct its entries")]
    NotACovariance,
    /// A start or reset from one measurement, which does not determine the state.
    #[error(
        "`{key}` = \"strip\" needs a C of full column rank, but one measurement of this model does not determine \
         the state; use {alternative}"
    )]
    StripUnavailable {
        /// Dotted path of the entry.
        key: &'static str,
        /// What to configure instead.
        alternative: &'static str,
    },
}

impl OptionsError {
    /// Dotted path, inside the diagnoser's table, of the entry to look at.
    pub fn key(&self) -> String {
        match self {
            Self::GeneratorOrderTooSmall { .. } => "filter.generator_order",
            Self::SimultaneousFaults { .. } => "bank.simultaneous_faults",
            Self::NotACovariance => "filter.initial_covariance",
            Self::OutOfRange { key, .. }
            | Self::NeedsForm { key, .. }
            | Self::Missing { key, .. }
            | Self::DimensionMismatch { key, .. }
            | Self::NegativeBound { key, .. }
            | Self::NonFinite { key, .. }
            | Self::StripUnavailable { key, .. } => key,
        }
        .to_owned()
    }
}
