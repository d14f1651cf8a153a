//! Models, bounds and covariances from fault-free recordings: state-space structures in [`model`], equations in
//! [`regression`], and here the bounds of disturbances and measurement noise of a given model.
//!
//! For a given noise bound ν v, linear programming finds for each run the smallest scales s_j of the disturbances
//! with which a trajectory exists that fulfils the model exactly:
//!
//! x_{k+1} = A0 x_k + B u_k + D d_k,  |d_{k,j}| <= s_j w_j,  |y_k - C x_k| <= ν v for every received element,
//!
//! with x_0 free. The bound is the elementwise maximum over the training runs, plus a margin, rounded up. Each
//! trajectory is checked after the solver, so that the bounds explain every training run for certain; that they
//! explain a run not seen before is only as likely as the runs are alike. Small noise scales need large
//! disturbances and the other way round; among the noise scales tried, the one is chosen for which the fewest
//! training runs contradict the bounds found from the other runs, and among these the one with the smallest
//! detectable faults ([`floors`](crate::unknown_input_filter::floors), fault-free mode, geometric mean over the actuators). Validation
//! runs are reported and never decide. A noise bound so large that some disturbance is not needed at all passes the
//! left-out check by itself; [`IdentifyOptions::tolerated_left_out_failures`] lets the detectable faults decide.
//!
//! The uncertainty A⁺ of the model is taken as zero: the disturbances then also account for it, and keeping
//! A⁺ > 0 in a filter with these bounds only makes it more cautious. w and v of the model are the units of the
//! scales; w_j = 0 keeps disturbance j at zero.
//!
//! | symbol | meaning |
//! |---|---|
//! | ν | noise scale, one an output |
//! | s_j | disturbance scale: bound of disturbance j in units of w_j |
//! | t | consistency factor of a run: by what both bounds would have to be multiplied to explain it |

mod error;
mod evaluate;
mod likelihood;
pub mod model;
mod options;
pub mod regression;
mod report;
mod run_data;
mod search;
mod trajectory;

pub use error::IdentifyError;
pub use options::{IdentifyOptions, NoiseSearch};
pub use report::{Figures, Identification, LadderStep, StepBounds, StepOutcome};
pub use run_data::RunData;

use evaluate::Evaluator;
use residual_diagnosis::model::LinearModel;
use search::Search;

/// How far an identification has come.
#[derive(Clone, Debug, PartialEq)]
pub struct Progress {
    /// Number of noise scales finished so far.
    pub finished_steps: usize,
    /// The noise scales being tried, one an output.
    pub noise_scales: Vec<f64>,
    /// Programs solved for these noise scales.
    pub runs_done: usize,
    /// Number of training and validation runs, each of which needs one program per step.
    pub runs: usize,
}

/// Identifies the bounds of disturbances and measurement noise of `model`, see the module's description.
///
/// `progress` is called after every run of every step.
///
/// # Errors
/// [`IdentifyError`]: options or runs that do not fit, no noise scale that explains the training runs, or a solver
/// whose result does not pass its check.
pub fn identify_bounds(
    model: &LinearModel,
    training: &[RunData],
    validation: &[RunData],
    options: &IdentifyOptions,
    progress: &mut dyn FnMut(Progress),
) -> Result<Identification, IdentifyError> {
    options.validate()?;
    if training.is_empty() {
        return Err(IdentifyError::NoTrainingRuns);
    }
    if let Some(output) = model.v().iter().position(|&bound| bound <= 0.0) {
        return Err(IdentifyError::NoNoiseBound { output });
    }
    let evaluator = Evaluator::new(model, training, validation, options)?;
    let lengths = training.iter().map(|run| run.measurements.len());
    let longest = lengths.max().unwrap_or(0).saturating_sub(1);
    if options.window > longest {
        return Err(IdentifyError::WindowTooLong {
            window: options.window,
            longest,
        });
    }
    let mut search = Search::new(evaluator, options, progress);
    for level in 0..options.noise_scales.len() {
        search.evaluate(vec![level; model.output_count()])?;
    }
    if options.search == NoiseSearch::PerOutput {
        while let Some(levels) = search.untried_neighbour() {
            search.evaluate(levels)?;
        }
    }
    let (chosen, best) = match search.best() {
        Some((chosen, best)) => (chosen, best.clone()),
        None => return Err(search.infeasible()),
    };
    let names = |runs: &[RunData]| runs.iter().map(|run| run.name.clone()).collect();
    Ok(Identification {
        best,
        chosen,
        steps: search.into_steps(),
        options: options.clone(),
        outputs: model.outputs().to_vec(),
        actuators: model.actuators().to_vec(),
        training: names(training),
        validation: names(validation),
        uncertain: model.a_plus().amax() > 0.0,
    })
}
