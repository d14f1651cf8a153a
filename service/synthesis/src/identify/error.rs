//! What can go wrong in an identification.

use crate::conic::SolverError;
use crate::unknown_input_filter::floors::FloorError;
use thiserror::Error;

/// Why no bounds could be identified. Outputs, disturbances and instants count from 0.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum IdentifyError {
    /// No training run.
    #[error("there is no training run; give at least one fault-free recording, better several")]
    NoTrainingRuns,
    /// An option outside its range.
    #[error("the option `{option}` is {value}; {help}")]
    InvalidOption {
        /// Its name.
        option: &'static str,
        /// Its value.
        value: String,
        /// What is possible.
        help: &'static str,
    },
    /// A model that lacks the unit of its noise.
    #[error(
        "the measurement noise bound of output {output} is 0; give its order of magnitude in the model: the \
         identification scales it"
    )]
    NoNoiseBound {
        /// The output.
        output: usize,
    },
    /// Commands and measurements of different number.
    #[error(
        "run {run} has {commands} commands but {measurements} measurements; align both at the same sampling \
         instants, NaN where nothing was received"
    )]
    LengthMismatch {
        /// Name of the run.
        run: String,
        /// Number of commands.
        commands: usize,
        /// Number of measurements.
        measurements: usize,
    },
    /// A command or measurement of the wrong width.
    #[error("run {run}, instant {instant}: {actual} {what}, but the model has {expected}")]
    WrongWidth {
        /// Name of the run.
        run: String,
        /// Commands or measurements.
        what: &'static str,
        /// Sampling instant in the run.
        instant: usize,
        /// Width found.
        actual: usize,
        /// Width needed.
        expected: usize,
    },
    /// An infinite value; a missing one is NaN.
    #[error(
        "run {run}, instant {instant}: element {element} of the {what} is infinite; write NaN for a missing value"
    )]
    Infinite {
        /// Name of the run.
        run: String,
        /// Commands or measurements.
        what: &'static str,
        /// Sampling instant in the run.
        instant: usize,
        /// Element.
        element: usize,
    },
    /// A run without two successive instants, or without measurement.
    #[error(
        "run {run} has no transition between two instants with a command and a received measurement; leave it out \
         or repair the recording"
    )]
    NothingToFit {
        /// Name of the run.
        run: String,
    },
    /// No noise scale explains the training runs.
    #[error(
        "run {run} cannot be explained with the noise scales {tried:?}, whatever the disturbances; it needs at \
         least {factor:.3} times these: raise the noise bounds, or let D (with a bound above zero) act on the states \
         that the model gets wrong"
    )]
    Infeasible {
        /// Name of the run.
        run: String,
        /// The noise scales that came closest, one an output.
        tried: Vec<f64>,
        /// The factor.
        factor: f64,
    },
    /// The solver did not get there.
    #[error("run {run}: {source}")]
    Solver {
        /// Name of the run.
        run: String,
        /// What the solver said.
        source: SolverError,
    },
    /// The solver's trajectory does not fulfil the model.
    #[error(
        "run {run}: the solver's trajectory (status {status}) misses the model by {residual:e}, relative; scale \
         states, inputs and outputs to comparable size"
    )]
    Unverified {
        /// Name of the run.
        run: String,
        /// Largest residual relative to the terms of its equation.
        residual: f64,
        /// The solver's word.
        status: String,
    },
    /// The floor that the choice rests on could not be computed.
    #[error("the smallest detectable fault could not be computed: {0}")]
    Floor(#[from] FloorError),
    /// A window that no run is long enough for.
    #[error(
        "the window has {window} transitions, but the longest run {longest}; shorten the window, or give longer runs"
    )]
    WindowTooLong {
        /// L.
        window: usize,
        /// Transitions of the longest run.
        longest: usize,
    },
    /// No actuator fault is visible in the window.
    #[error(
        "no actuator fault is visible within {window} transitions, so that noise scales cannot be compared; \
         lengthen the window, or correct B and C"
    )]
    NothingDetectable {
        /// L.
        window: usize,
    },
}
