//! What can be wrong with a structure, and why no model could be identified.

use super::super::IdentifyError;
use residual_diagnosis::covariance::CovarianceError;
use residual_diagnosis::tables::TableError;
use thiserror::Error;

/// What is wrong with a structure. Rows and columns count from 0.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum StructureError {
    /// A matrix or list of the wrong shape, or a list of numbers with one that is none.
    #[error(transparent)]
    Table(#[from] TableError),
    /// An entry that is no finite number.
    #[error("`{place}` is {value}; use a finite number, \"free\" or an expression of the parameters")]
    NotFinite {
        /// Matrix and place.
        place: String,
        /// The entry.
        value: f64,
    },
    /// An expression that cannot be read.
    #[error("`{place}` is `{expression}`, which is neither \"free\" nor an expression: {reason}")]
    Expression {
        /// Matrix and place.
        place: String,
        /// The expression.
        expression: String,
        /// What the parser says.
        reason: String,
    },
    /// An expression of an unknown parameter.
    #[error(
        "`{place}` is `{expression}`, but there is no parameter `{name}`; declare it in [model.parameters], or write \
         \"free\" for an entry that stands alone"
    )]
    UnknownParameter {
        /// Matrix and place.
        place: String,
        /// The expression.
        expression: String,
        /// The unknown name.
        name: String,
    },
    /// A parameter that no entry uses.
    #[error("no entry uses the parameter `{name}`; remove it, or write it into the entry that it belongs to")]
    Unused {
        /// Its name.
        name: String,
    },
    /// A name that is no variable.
    #[error(
        "`{name}` cannot be the name of a parameter; use a letter followed by letters and digits, not `free`"
    )]
    ParameterName {
        /// The name.
        name: String,
    },
    /// A start outside the range, or an empty range.
    #[error(
        "`{name}` starts at {start} in the range from {lower} to {upper}; give lower < upper and a start between them"
    )]
    Range {
        /// The parameter or entry.
        name: String,
        /// Start.
        start: f64,
        /// Lower end.
        lower: f64,
        /// Upper end.
        upper: f64,
    },
    /// A number outside its range.
    #[error("`{key}` holds {value}; {help}")]
    Value {
        /// The key.
        key: &'static str,
        /// The value.
        value: f64,
        /// What is possible.
        help: &'static str,
    },
    /// A covariance that is none.
    #[error(
        "`{key}` is not a covariance: {reason:?}; make it symmetric and positive (definite unless it is diagonal)"
    )]
    Covariance {
        /// The key.
        key: &'static str,
        /// What it lacks.
        reason: CovarianceError,
    },
}

/// Why no model could be identified.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ModelIdentificationError {
    /// Runs that do not fit the structure, or without any run.
    #[error(transparent)]
    Data(#[from] IdentifyError),
    /// Nothing to check the model with.
    #[error(
        "run {run} is the only training run, so that no run is left to check the model with; record several runs, or \
         cut the recording into parts"
    )]
    SingleRun {
        /// Its name.
        run: String,
    },
    /// A signal that tells nothing.
    #[error(
        "the {kind} {index} has the same value at every instant of the training runs ({value}); leave it out of the \
         structure, or record runs in which it changes"
    )]
    Constant {
        /// Measurement or command.
        kind: &'static str,
        /// Its position.
        index: usize,
        /// Its value.
        value: f64,
    },
    /// An output without measurement.
    #[error("measurement {index} has no value at any instant of the training runs; correct its expression")]
    NeverReceived {
        /// Its position.
        index: usize,
    },
    /// Too few samples.
    #[error(
        "the training runs hold {elements} measured values for {unknowns} unknowns (noise included); at least \
         {needed} are needed: record more, or free fewer entries"
    )]
    TooFew {
        /// Measured values.
        elements: usize,
        /// Unknowns.
        unknowns: usize,
        /// Values needed.
        needed: usize,
    },
    /// The start makes no model.
    #[error(
        "the predictor fails at the start values: the model is not finite or its predictions overflow; give starts \
         with stable, observable dynamics"
    )]
    Start,
    /// The search ended too early.
    #[error(
        "the search has not converged after {iterations} iterations (a step should still raise the log-likelihood by \
         {decrement:.3}); give better starts and ranges, or free fewer entries"
    )]
    NotConverged {
        /// Iterations.
        iterations: usize,
        /// What a step should gain.
        decrement: f64,
    },
    /// Entries that the data do not determine.
    #[error(
        "the data do not determine {}: they can be changed together without any change of the predictions; fix all \
         but as many as the recordings show, record runs that excite them, or start nearer to the truth",
        names.join(", ")
    )]
    Undetermined {
        /// The unknowns.
        names: Vec<String>,
    },
}
