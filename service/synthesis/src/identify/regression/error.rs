//! Why no regression was possible.

use thiserror::Error;

/// Why no coefficients could be identified. Rows count from 0.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum RegressionError {
    /// No equation.
    #[error("there is no equation; write at least one [[equation]]")]
    NoEquations,
    /// An equation without terms.
    #[error("the equation of `{output}` has no terms; give it at least one")]
    NoTerms {
        /// Its output.
        output: String,
    },
    /// The output on its own right side, at the same row.
    #[error(
        "the equation of `{output}` uses its own output at the same row; give that term a lag of 1 or more"
    )]
    OwnOutput {
        /// The output.
        output: String,
    },
    /// Two terms with the same signal and lag.
    #[error("the equation of `{output}` has `{term}` twice; remove one")]
    Twice {
        /// The output.
        output: String,
        /// The term.
        term: String,
    },
    /// A given coefficient that is not finite.
    #[error("the equation of `{output}` gives `{term}` the coefficient {value}; use a finite number")]
    Coefficient {
        /// The output.
        output: String,
        /// The term.
        term: String,
        /// The coefficient.
        value: f64,
    },
    /// A row of the wrong width.
    #[error("run {run}, row {row}: {actual} values for {expected} signals")]
    WrongWidth {
        /// The run.
        run: String,
        /// The row.
        row: usize,
        /// Values found.
        actual: usize,
        /// Signals.
        expected: usize,
    },
    /// An infinite value.
    #[error("run {run}, row {row}: `{signal}` is infinite; write NaN for a missing value")]
    Infinite {
        /// The run.
        run: String,
        /// The row.
        row: usize,
        /// The signal.
        signal: String,
    },
    /// No training run.
    #[error("there is no training run; give at least two fault-free recordings")]
    NoTrainingRuns,
    /// Nothing to check the coefficients with.
    #[error(
        "run {run} is the only training run, so that no run is left to check the coefficients with; record several \
         runs, or cut the recording into parts"
    )]
    SingleRun {
        /// Its name.
        run: String,
    },
    /// Too few rows.
    #[error(
        "the equation of `{output}` has {coefficients} free coefficients, but only {rows} complete rows ({skipped} rows \
         lack a value or a past); {needed} are needed: record more, repair the columns, or use fewer terms"
    )]
    TooFew {
        /// The output.
        output: String,
        /// Complete rows.
        rows: usize,
        /// Incomplete rows.
        skipped: usize,
        /// Free coefficients.
        coefficients: usize,
        /// Rows needed.
        needed: usize,
    },
    /// A signal that tells nothing.
    #[error(
        "`{signal}` has the same value ({value}) in all rows of the training runs; leave it out (`constant = true` adds \
         a constant), or record runs in which it changes"
    )]
    Constant {
        /// The signal.
        signal: String,
        /// Its value.
        value: f64,
    },
    /// Regressors that follow from each other.
    #[error(
        "the regressors {} of `{output}` are linearly dependent: each follows from the others; leave one of them out, \
         or give it a coefficient",
        regressors.join(", ")
    )]
    Dependent {
        /// The output.
        output: String,
        /// Those that take part.
        regressors: Vec<String>,
    },
    /// A part of the runs does not determine the coefficients.
    #[error(
        "the regressors of `{output}` are linearly dependent when one in {folds} of the runs is left out: a single run \
         determines a coefficient; record more runs like it, or use fewer terms"
    )]
    DependentInFold {
        /// The output.
        output: String,
        /// Number of groups.
        folds: usize,
    },
    /// Equations without rows in common.
    #[error("only {rows} rows have a residual of every equation; repair the columns that are often empty")]
    NoCommonRows {
        /// Common rows.
        rows: usize,
    },
    /// Equations that are no model of first order.
    #[error("{reason}; use `method = \"chi_square\"`, or a [model] with states")]
    NotFirstOrder {
        /// What is in the way.
        reason: String,
    },
}
