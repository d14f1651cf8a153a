//! The smallest constant fault that any method can guarantee to tell from a mode (method sheet 3.4).
//!
//! Over a window of n transitions, multiply the model equations by λ_k and add. With λ_{-1} = λ_n = 0,
//! λ_{k-1} = A0'λ_k + C'μ_k (k = 0..=n) and F'λ_k = 0 (k = 0..n) the combination
//! r = Σ μ_k'y_k - Σ λ_k'B u_k is independent of the state and of the mode's own faults, and while the mode holds
//! |r| <= h = Σ |μ_k|'v + Σ |D'λ_k|'w + Σ |λ_k|'A⁺x_nom. The linear program maximises the response of r to a unit
//! fault over the last L transitions subject to h <= 1. By duality, floor = 2 / gain.
//!
//! | symbol | meaning |
//! |---|---|
//! | λ_k, μ_k | multipliers of transition k (nx) and of sample k (ny) |
//! | a_k, b_k, g_k | upper bounds of \|λ_k\| where A⁺x_nom > 0, of \|D'λ_k\| where w > 0, of \|μ_k\| where v > 0 |
//! | F | columns of B of the mode |

use crate::bounds::NoiseBounds;
use crate::conic::SolverError;
use crate::linear_program::LinearProgram;
use crate::unknown_input_filter::window_equalities::{Multipliers, WindowEqualities};
use nalgebra::{DMatrix, DVector};
use residual_diagnosis::gains::SolverRun;
use residual_diagnosis::model::LinearModel;
use residual_diagnosis::unknown_input_filter::modes::FaultMode;
use thiserror::Error;

/// A gain at or below this is none: the fault cannot be told from the mode within the window.
const SMALLEST_GAIN: f64 = 1e-9;

/// Largest relative difference between the primal and the dual objective, and largest relative violation.
const TOLERANCE: f64 = 1e-6;

/// Which fault is to be told from which mode, over which window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FloorQuestion {
    /// The mode to be falsified; its own faults are unlimited.
    pub mode: FaultMode,
    /// The faulty actuator, from 0; not one of the mode.
    pub actuator: usize,
    /// L: number of last transitions over which the fault lasts, at least 1.
    pub length: usize,
    /// Transitions before the fault that the window contains.
    pub pre_samples: usize,
}

impl FloorQuestion {
    /// n: number of transitions of the window.
    pub fn transitions(&self) -> usize {
        self.length + self.pre_samples
    }
}

/// The multipliers that answer a question, as the solver left them: equalities hold to its accuracy only.
#[derive(Clone, Debug, PartialEq)]
pub struct FloorSolution {
    /// Response Σ B_j'λ_k to the unit fault at threshold 1; the floor is 2 / gain.
    pub gain: f64,
    /// λ, nx x n, oldest transition first.
    pub lambda: DMatrix<f64>,
    /// μ, ny x (n + 1), oldest sample first.
    pub mu: DMatrix<f64>,
    /// What the solver said.
    pub run: SolverRun,
}

impl FloorSolution {
    /// The smallest constant fault, in units of u, that is guaranteed to be seen.
    pub fn floor(&self) -> f64 {
        2.0 / self.gain
    }
}

/// Why a question has no answer.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum FloorError {
    /// An actuator that the model does not have.
    #[error("actuator {actuator} does not exist; the model has {count} actuators, counted from 0")]
    UnknownActuator {
        /// The actuator.
        actuator: usize,
        /// nu.
        count: usize,
    },
    /// The fault belongs to the mode.
    #[error("actuator {actuator} belongs to the mode {mode} itself; ask about another actuator")]
    FaultInMode {
        /// The actuator.
        actuator: usize,
        /// The mode.
        mode: FaultMode,
    },
    /// A window without transition.
    #[error("the fault lasts 0 transitions; ask for a length of at least 1")]
    EmptyWindow,
    /// Bounds or nominal state of the wrong length, negative or not finite.
    #[error("{what} must be {expected} finite numbers >= 0; correct its length and signs")]
    InvalidVector {
        /// Which vector.
        what: &'static str,
        /// Its length.
        expected: usize,
    },
    /// The response is unlimited: some combination of samples is free of noise and disturbances.
    #[error(
        "a fault of actuator {actuator} of any size is visible because some combination of outputs is free of \
         noise; give every output a noise bound above zero"
    )]
    Unlimited {
        /// The actuator.
        actuator: usize,
    },
    /// The solver did not get there.
    #[error("the floor of actuator {actuator} could not be computed: {source}")]
    Solver {
        /// The actuator.
        actuator: usize,
        /// What the solver said.
        source: SolverError,
    },
    /// The solver's point does not pass the check.
    #[error(
        "the floor of actuator {actuator} is not accurate: relative error {error:e} (solver status {status}); \
         scale states, inputs and outputs to comparable size"
    )]
    Inaccurate {
        /// The actuator.
        actuator: usize,
        /// Difference of primal and dual objective, or violation of a constraint.
        error: f64,
        /// The solver's word.
        status: String,
    },
}

impl FloorError {
    /// Whether the question fits the model and only its computation failed.
    pub fn is_of_computation(&self) -> bool {
        matches!(
            self,
            Self::Unlimited { .. } | Self::Solver { .. } | Self::Inaccurate { .. }
        )
    }
}

/// Where the variables of the program are.
struct Layout {
    nx: usize,
    ny: usize,
    lambda: usize,
    mu: usize,
}

impl Layout {
    fn lambda(&self, k: usize, state: usize) -> usize {
        self.lambda + k * self.nx + state
    }

    fn mu(&self, k: usize, output: usize) -> usize {
        self.mu + k * self.ny + output
    }
}

/// Solves the linear program of method sheet 3.4 for the model's matrices under the given bounds.
///
/// `nominal_state` is x_nom, length nx, >= 0: the magnitude of the state that A⁺ acts on. `None` is the answer
/// "not separable within this window".
///
/// # Errors
/// [`FloorError`]: a question that does not fit the model, or a solver that failed its check.
pub fn solve(
    model: &LinearModel,
    bounds: &NoiseBounds,
    nominal_state: &DVector<f64>,
    question: FloorQuestion,
) -> Result<Option<FloorSolution>, FloorError> {
    check(model, bounds, nominal_state, question)?;
    let (nx, ny, n) = (model.state_count(), model.output_count(), question.transitions());
    let mut program = LinearProgram::default();
    let layout = Layout {
        nx,
        ny,
        lambda: program.add_variables(nx * n),
        mu: program.add_variables(ny * (n + 1)),
    };
    add_equalities(&mut program, model, question, &layout);

    let uncertainty = model.a_plus() * nominal_state;
    let mut threshold = Vec::new();
    for k in 0..n {
        for i in 0..nx {
            let magnitude = [(layout.lambda(k, i), 1.0)];
            add_magnitude(&mut program, &mut threshold, &magnitude, uncertainty[i]);
        }
        for (j, column) in model.d().column_iter().enumerate() {
            let magnitude: Vec<_> = (0..nx).map(|i| (layout.lambda(k, i), column[i])).collect();
            add_magnitude(&mut program, &mut threshold, &magnitude, bounds.disturbance[j]);
        }
    }
    for k in 0..=n {
        for i in 0..ny {
            let magnitude = [(layout.mu(k, i), 1.0)];
            add_magnitude(&mut program, &mut threshold, &magnitude, bounds.measurement[i]);
        }
    }
    program.at_most(threshold, 1.0);
    for k in question.pre_samples..n {
        for i in 0..nx {
            program.add_cost(layout.lambda(k, i), -model.b()[(i, question.actuator)]);
        }
    }

    let actuator = question.actuator;
    let solution = program.solve().map_err(|source| match source {
        SolverError::Unbounded { .. } => FloorError::Unlimited { actuator },
        source => FloorError::Solver { actuator, source },
    })?;
    let gain = -solution.run.objective;
    let gap = (solution.run.objective - solution.run.dual_objective).abs();
    let accurate = |error: f64| {
        if error <= TOLERANCE {
            Ok(())
        } else {
            Err(FloorError::Inaccurate {
                actuator,
                error,
                status: solution.run.status.clone(),
            })
        }
    };
    if gain <= SMALLEST_GAIN {
        accurate(gap)?;
        return Ok(None);
    }
    // Relative to the gain, so that the unit of the fault does not matter.
    accurate(gap / gain)?;
    let z = Multipliers {
        lambda: DMatrix::from_fn(nx, n, |i, k| solution.values[layout.lambda(k, i)]),
        mu: DMatrix::from_fn(ny, n + 1, |i, k| solution.values[layout.mu(k, i)]),
    };
    let violation = WindowEqualities::new(model, question.mode).violation(&z);
    accurate(violation / z.largest().max(f64::MIN_POSITIVE))?;
    accurate(threshold_of(model, bounds, nominal_state, &z) - 1.0)?;
    let Multipliers { lambda, mu } = z;
    let run = SolverRun {
        problem: format!(
            "largest response to fault {actuator}, mode {}, window of {n} transitions",
            question.mode
        ),
        ..solution.run
    };
    Ok(Some(FloorSolution {
        gain,
        lambda,
        mu,
        run,
    }))
}

fn check(
    model: &LinearModel,
    bounds: &NoiseBounds,
    nominal_state: &DVector<f64>,
    question: FloorQuestion,
) -> Result<(), FloorError> {
    let FloorQuestion {
        mode,
        actuator,
        length,
        ..
    } = question;
    let count = model.actuator_count();
    if let Some(actuator) = [actuator]
        .into_iter()
        .chain(mode.actuators())
        .find(|&j| j >= count)
    {
        return Err(FloorError::UnknownActuator { actuator, count });
    }
    if mode.contains(actuator) {
        return Err(FloorError::FaultInMode { actuator, mode });
    }
    if length == 0 {
        return Err(FloorError::EmptyWindow);
    }
    for (what, vector, expected) in [
        (
            "the disturbance bound",
            &bounds.disturbance,
            model.disturbance_count(),
        ),
        (
            "the measurement noise bound",
            &bounds.measurement,
            model.output_count(),
        ),
        ("the nominal state magnitude", nominal_state, model.state_count()),
    ] {
        if vector.len() != expected || !vector.iter().all(|value| value.is_finite() && *value >= 0.0) {
            return Err(FloorError::InvalidVector { what, expected });
        }
    }
    Ok(())
}

/// λ_{k-1} = A0'λ_k + C'μ_k for k = 0..=n and F'λ_k = 0 for k = 0..n.
fn add_equalities(
    program: &mut LinearProgram,
    model: &LinearModel,
    question: FloorQuestion,
    layout: &Layout,
) {
    let (nx, n) = (layout.nx, question.transitions());
    for k in 0..=n {
        for i in 0..nx {
            let previous = (k > 0).then(|| (layout.lambda(k - 1, i), 1.0));
            let next = (0..if k < n { nx } else { 0 }).map(|r| (layout.lambda(k, r), -model.a0()[(r, i)]));
            let sample = (0..layout.ny).map(|r| (layout.mu(k, r), -model.c()[(r, i)]));
            program.equal(previous.into_iter().chain(next).chain(sample), 0.0);
        }
    }
    for column in question.mode.unknown_input_matrix(model.b()).column_iter() {
        for k in 0..n {
            program.equal((0..nx).map(|i| (layout.lambda(k, i), column[i])), 0.0);
        }
    }
}

/// A variable that is at least the magnitude of the terms and costs `weight` of the threshold; nothing if the
/// weight is zero.
fn add_magnitude(
    program: &mut LinearProgram,
    threshold: &mut Vec<(usize, f64)>,
    terms: &[(usize, f64)],
    weight: f64,
) {
    if weight > 0.0 {
        let magnitude = program.add_variables(1);
        for sign in [1.0, -1.0] {
            let signed = terms.iter().map(|&(variable, value)| (variable, sign * value));
            program.at_most(signed.chain([(magnitude, -1.0)]), 0.0);
        }
        threshold.push((magnitude, weight));
    }
}

/// h of the multipliers with the state at x_nom.
pub(crate) fn threshold_of(
    model: &LinearModel,
    bounds: &NoiseBounds,
    nominal_state: &DVector<f64>,
    z: &Multipliers,
) -> f64 {
    let weighted = |matrix: &DMatrix<f64>, weights: &DVector<f64>| -> f64 {
        matrix.column_iter().map(|column| column.abs().dot(weights)).sum()
    };
    weighted(&z.lambda, &(model.a_plus() * nominal_state))
        + weighted(&(model.d().transpose() * &z.lambda), &bounds.disturbance)
        + weighted(&z.mu, &bounds.measurement)
}
