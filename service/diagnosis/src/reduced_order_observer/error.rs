//! Why an observer cannot be constructed, and what to do about it.

use crate::{method::Refusal, tables::TableError};
use thiserror::Error;

/// Why the configuration of a reduced-order observer was refused.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ConstructionError {
    /// A list of the wrong shape, or with an entry that is not finite (method sheet: `DimensionMismatch`).
    #[error(transparent)]
    Table(#[from] TableError),
    /// A box without a point.
    #[error(
        "entry {index} of `{lower_key}` is {lower}, above {upper} of `{upper_key}`; exchange or correct them"
    )]
    EmptyBox {
        /// Dotted path of the lower bounds.
        lower_key: &'static str,
        /// Dotted path of the upper bounds.
        upper_key: &'static str,
        /// Position, from 0.
        index: usize,
        /// The lower bound.
        lower: f64,
        /// The upper bound.
        upper: f64,
    },
    /// A number outside its range.
    #[error("`{key}` is {value}; {allowed}")]
    OutOfRange {
        /// Dotted path of the entry.
        key: &'static str,
        /// The configured value.
        value: String,
        /// What is allowed.
        allowed: &'static str,
    },
    /// An entry without which the others cannot be used.
    #[error("`{key}` is missing; {reason}")]
    Missing {
        /// Dotted path of the missing entry.
        key: &'static str,
        /// Why it is needed and what to do.
        reason: &'static str,
    },
    /// The generator order has no room for the box that an order reduction needs.
    #[error(
        "`bounds.generator_order` is {order}, fewer than the {rows} rows of the set; use at least {rows}"
    )]
    GeneratorOrderTooSmall {
        /// The configured order d.
        order: usize,
        /// n in the joint mode, p in the paper's.
        rows: usize,
    },
    /// Outputs that depend on each other.
    #[error(
        "the rows of `model.C` are linearly dependent (singular values {smallest:.3e} to {largest:.3e}); remove \
         outputs that others determine"
    )]
    OutputMatrixRankDeficient {
        /// σ_min(C).
        smallest: f64,
        /// σ_max(C).
        largest: f64,
    },
    /// Disturbances that depend on each other.
    #[error(
        "the columns of `model.D` are linearly dependent (singular values {smallest:.3e} to {largest:.3e}); merge \
         disturbances of one direction, remove zero columns"
    )]
    DisturbanceMatrixRankDeficient {
        /// σ_min(D).
        smallest: f64,
        /// σ_max(D).
        largest: f64,
    },
    /// A disturbance that the next output does not show.
    #[error(
        "{inputs} unknown inputs act through `model.D` but the next sample of {outputs} outputs does not tell them \
         apart (smallest singular value of C D {smallest:.3e}, 1e-9 |C| |D| is {limit:.3e}); measure more outputs or \
         model fewer disturbances"
    )]
    DisturbanceNotMatched {
        /// Columns of D.
        inputs: usize,
        /// p.
        outputs: usize,
        /// σ_q(CD).
        smallest: f64,
        /// What it must exceed.
        limit: f64,
    },
    /// A state that no gain can make converge.
    #[error(
        "the plant from `model.D` to the outputs has the invariant zero {re} + {im}i on or outside the unit circle; \
         no observer converges: measure other outputs or model other disturbances"
    )]
    UnstableInvariantZero {
        /// Real part of λ.
        re: f64,
        /// Imaginary part of λ.
        im: f64,
    },
    /// A numerical iteration that does not end.
    #[error(
        "the eigenvalues of {what} could not be computed; scale the entries of `model.A` to comparable size"
    )]
    EigenvaluesNotFound {
        /// Of which matrix.
        what: &'static str,
    },
    /// No gain passed the checks.
    #[error("no gain is accepted: {reason}")]
    SynthesisRejected {
        /// Dotted path of the entry to look at.
        key: &'static str,
        /// What was wrong with the candidates; what to do.
        reason: String,
    },
    /// Gains that do not fulfil a condition they must fulfil.
    #[error("`{key}` is refused: {reason}; design the gains again")]
    GainsRefused {
        /// Dotted path of the entry of the gains.
        key: String,
        /// The condition, and by how much it is violated.
        reason: String,
    },
    /// More channels than a record holds.
    #[error(
        "the diagnoser would have {count} channels but a record holds {limit}; reduce `bounds.max_directions`"
    )]
    TooManyChannels {
        /// Channels needed.
        count: usize,
        /// Channels a record holds.
        limit: usize,
    },
    /// More actuators than a fault set holds.
    #[error("the model has {count} actuators but a fault set holds {limit}; use several diagnosers")]
    TooManyFaults {
        /// Columns of B.
        count: usize,
        /// Bits of a fault set.
        limit: usize,
    },
}

impl ConstructionError {
    /// Dotted path, inside the diagnoser's table, of the entry to look at.
    pub fn key(&self) -> String {
        match self {
            Self::Table(error) => return error.key(),
            Self::GainsRefused { key, .. } => return key.clone(),
            Self::EmptyBox { lower_key, .. } => lower_key,
            Self::OutOfRange { key, .. }
            | Self::Missing { key, .. }
            | Self::SynthesisRejected { key, .. } => key,
            Self::GeneratorOrderTooSmall { .. } => "bounds.generator_order",
            Self::OutputMatrixRankDeficient { .. } => "model.C",
            Self::DisturbanceMatrixRankDeficient { .. }
            | Self::DisturbanceNotMatched { .. }
            | Self::UnstableInvariantZero { .. } => "model.D",
            Self::EigenvaluesNotFound { .. } => "model.A",
            Self::TooManyChannels { .. } => "bounds.max_directions",
            Self::TooManyFaults { .. } => "model.B",
        }
        .to_owned()
    }
}

impl From<ConstructionError> for Refusal {
    fn from(error: ConstructionError) -> Self {
        Self {
            key: error.key(),
            message: error.to_string(),
        }
    }
}
