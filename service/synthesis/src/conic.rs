//! Conic programs, minimise cost'x subject to A x + s = b with s in a product of cones, solved by Clarabel.
//!
//! The solver's status is only a hint. A solution is the last point that it reached; whoever uses it checks it
//! against the problem it stands for.

use crate::lapack;
use clarabel::{
    algebra::CscMatrix,
    solver::{DefaultSettingsBuilder, DefaultSolver, IPSolver, SolverStatus, SupportedConeT},
};
use residual_diagnosis::gains::SolverRun;
use thiserror::Error;

/// The solver, as records of designs name it.
const SOLVER: &str = "Clarabel 0.11.1";

/// Why there is no solution to check.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum SolverError {
    /// The solver found that no point fulfils the constraints.
    #[error("no point fulfils the constraints (solver status {status})")]
    Infeasible {
        /// The solver's word.
        status: String,
    },
    /// The solver found that the cost has no lower limit.
    #[error("the cost has no lower limit (solver status {status})")]
    Unbounded {
        /// The solver's word.
        status: String,
    },
    /// The solver stopped elsewhere.
    #[error("the solver stopped with status {status}; scale states, inputs and outputs to comparable size")]
    Failed {
        /// The solver's word.
        status: String,
    },
}

/// A constraint matrix by its entries (row, column, value), and the right-hand side.
#[derive(Clone, Debug, Default)]
pub(crate) struct Rows {
    row: Vec<usize>,
    column: Vec<usize>,
    value: Vec<f64>,
    right_hand_side: Vec<f64>,
}

impl Rows {
    /// Appends a row: the terms (column, coefficient) and its right-hand side. Terms of one column add up.
    pub(crate) fn push(&mut self, terms: impl IntoIterator<Item = (usize, f64)>, right_hand_side: f64) {
        let row = self.count();
        for (column, value) in terms.into_iter().filter(|term| term.1 != 0.0) {
            self.row.push(row);
            self.column.push(column);
            self.value.push(value);
        }
        self.right_hand_side.push(right_hand_side);
    }

    /// Appends all rows of `other`.
    pub(crate) fn append(&mut self, other: Self) {
        let shift = self.count();
        self.row.extend(other.row.into_iter().map(|row| row + shift));
        self.column.extend(other.column);
        self.value.extend(other.value);
        self.right_hand_side.extend(other.right_hand_side);
    }

    pub(crate) fn count(&self) -> usize {
        self.right_hand_side.len()
    }
}

/// A program for the solver.
pub(crate) struct ConicProgram<'a> {
    /// What it is for.
    pub(crate) problem: &'a str,
    pub(crate) cost: &'a [f64],
    pub(crate) rows: Rows,
    /// Cones of the rows, in their order.
    pub(crate) cones: &'a [SupportedConeT<f64>],
    /// Accuracy asked for, relative and absolute.
    pub(crate) tolerance: f64,
}

/// The last point of the solver, to be checked by its user.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ConicSolution {
    /// x.
    pub(crate) values: Vec<f64>,
    /// The accuracy asked for was reached.
    pub(crate) solved: bool,
    pub(crate) run: SolverRun,
}

impl ConicProgram<'_> {
    /// Solves the program.
    ///
    /// # Errors
    /// [`SolverError`] when the solver reports no point that would be worth checking.
    pub(crate) fn solve(self) -> Result<ConicSolution, SolverError> {
        lapack::link();
        let columns = self.cost.len();
        let Rows {
            row,
            column,
            value,
            right_hand_side,
        } = self.rows;
        let matrix = CscMatrix::new_from_triplets(right_hand_side.len(), columns, row, column, value);
        let no_quadratic_term = CscMatrix::zeros((columns, columns));
        let failed = |reason: String| SolverError::Failed { status: reason };
        let settings = DefaultSettingsBuilder::default()
            .verbose(false)
            .tol_feas(self.tolerance)
            .tol_gap_abs(self.tolerance)
            .tol_gap_rel(self.tolerance)
            .build()
            .map_err(|error| failed(error.to_string()))?;
        let mut solver = DefaultSolver::new(
            &no_quadratic_term,
            self.cost,
            &matrix,
            &right_hand_side,
            self.cones,
            settings,
        )
        .map_err(|error| failed(error.to_string()))?;
        solver.solve();
        let solution = solver.solution;
        let status = format!("{:?}", solution.status);
        match solution.status {
            SolverStatus::Solved | SolverStatus::AlmostSolved | SolverStatus::InsufficientProgress => {
                Ok(ConicSolution {
                    values: solution.x,
                    solved: solution.status == SolverStatus::Solved,
                    run: SolverRun {
                        problem: self.problem.to_owned(),
                        solver: SOLVER.to_owned(),
                        status,
                        iterations: solution.iterations,
                        objective: solution.obj_val,
                        dual_objective: solution.obj_val_dual,
                        tolerance: self.tolerance,
                    },
                })
            }
            SolverStatus::PrimalInfeasible | SolverStatus::AlmostPrimalInfeasible => {
                Err(SolverError::Infeasible { status })
            }
            SolverStatus::DualInfeasible | SolverStatus::AlmostDualInfeasible => {
                Err(SolverError::Unbounded { status })
            }
            _ => Err(SolverError::Failed { status }),
        }
    }
}
