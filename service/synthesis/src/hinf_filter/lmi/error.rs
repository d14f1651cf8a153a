//! Why a synthesis by matrix inequalities has no gain.

use crate::semidefinite::SemidefiniteError;
use thiserror::Error;

/// Why a synthesis by matrix inequalities has no gain.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum LmiError {
    /// Matrices whose shapes do not fit together.
    #[error("{matrix} has the wrong shape {rows} x {columns}; make it fit A and C")]
    Shape {
        /// The matrix.
        matrix: &'static str,
        /// Its rows.
        rows: usize,
        /// Its columns.
        columns: usize,
    },
    /// An entry is infinite or not a number.
    #[error("{matrix} has an entry that is not finite; correct it")]
    NotFinite {
        /// The matrix.
        matrix: &'static str,
    },
    /// Bd and Dd are zero.
    #[error("no disturbance acts on the error, so that there is nothing to attenuate; give Bd or Dd")]
    NoDisturbance,
    /// The infimum is 0 and needs an infinite gain.
    #[error(
        "Dd is zero, so that larger gains are always better and no optimum exists; give measurement noise in Dd or a \
         pole radius"
    )]
    Unbounded,
    /// The region is empty or unusable.
    #[error("no pole can lie in the region {region}; enlarge it")]
    EmptyRegion {
        /// The region in symbols.
        region: String,
    },
    /// A mode that no gain moves lies outside the region.
    #[error(
        "the pole {pole} cannot be moved by the gain and lies outside the region {region}; measure that mode or \
         enlarge the region"
    )]
    FixedPole {
        /// The pole.
        pole: String,
        /// The region in symbols.
        region: String,
    },
    /// The solver has no solution.
    #[error("{problem}: {source}; region {region}")]
    Solver {
        /// The problem.
        problem: String,
        /// The region in symbols.
        region: String,
        /// The solver's words.
        source: SemidefiniteError,
    },
    /// The solver's level lies below what any gain can reach.
    #[error(
        "{problem}: the solver's level {level} is below σ_max(Dd) = {least}, which no gain reaches; scale states, \
         disturbances and outputs to comparable size"
    )]
    ImpossibleLevel {
        /// The problem.
        problem: String,
        /// The solver's level.
        level: f64,
        /// σ_max(Dd).
        least: f64,
    },
    /// A pole of the recovered gain lies outside the region.
    #[error(
        "a pole of the gain recovered from the solver's point lies {margin:e} outside the region {region}; scale \
         states, disturbances and outputs to comparable size or enlarge the region"
    )]
    OutsideRegion {
        /// The region in symbols.
        region: String,
        /// How far outside.
        margin: f64,
    },
    /// What was recovered from the solver's point does not do what it should.
    #[error(
        "the gain recovered from the solver's point fails the condition {condition} by {margin:e}; scale states, \
         disturbances and outputs to comparable size or enlarge the region"
    )]
    Recovery {
        /// The condition.
        condition: String,
        /// By how much it is violated.
        margin: f64,
    },
}
