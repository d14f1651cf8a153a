//! Linear programs: minimise cost'z subject to equalities and inequalities, solved by Clarabel.
//!
//! The solver's status is only a hint. A [`Solution`] is the last point it reached; whoever uses it checks it
//! against the problem it stands for.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{
    DefaultSettingsBuilder, DefaultSolver, IPSolver, SolverStatus, SupportedConeT::NonnegativeConeT,
    SupportedConeT::ZeroConeT,
};
use thiserror::Error;

/// Accuracy asked of the solver, relative and absolute; the check of a solution allows more.
pub const TOLERANCE: f64 = 1e-10;

/// The solver, as gains files name it.
pub const SOLVER: &str = "Clarabel 0.11.1";

/// Why there is no solution to check.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum LinearProgramError {
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

/// The last point of the solver, to be checked by its user.
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    /// z.
    pub values: Vec<f64>,
    /// cost'z.
    pub objective: f64,
    /// The dual objective: a lower bound of the smallest cost, as exact as the dual point.
    pub dual_objective: f64,
    /// The solver's word.
    pub status: String,
    /// Iterations of the solver.
    pub iterations: u32,
}

/// Rows of a constraint matrix in triplet form, with their right-hand sides.
#[derive(Clone, Debug, Default)]
struct Rows {
    row: Vec<usize>,
    column: Vec<usize>,
    value: Vec<f64>,
    right_hand_side: Vec<f64>,
}

impl Rows {
    fn push(&mut self, terms: impl IntoIterator<Item = (usize, f64)>, right_hand_side: f64) {
        let row = self.right_hand_side.len();
        for (column, value) in terms.into_iter().filter(|term| term.1 != 0.0) {
            self.row.push(row);
            self.column.push(column);
            self.value.push(value);
        }
        self.right_hand_side.push(right_hand_side);
    }
}

/// A linear program under construction. Variables are free unless a row restricts them; terms are
/// (variable, coefficient), and coefficients of a variable that occurs twice in a row add up.
#[derive(Clone, Debug, Default)]
pub struct LinearProgram {
    cost: Vec<f64>,
    equalities: Rows,
    inequalities: Rows,
}

impl LinearProgram {
    /// Adds `count` variables and returns the index of the first.
    pub fn add_variables(&mut self, count: usize) -> usize {
        let first = self.cost.len();
        self.cost.resize(first + count, 0.0);
        first
    }

    /// Adds to the cost of a variable.
    pub fn add_cost(&mut self, variable: usize, cost: f64) {
        self.cost[variable] += cost;
    }

    /// Demands that the sum of the terms equals `value`.
    pub fn equal(&mut self, terms: impl IntoIterator<Item = (usize, f64)>, value: f64) {
        self.equalities.push(terms, value);
    }

    /// Demands that the sum of the terms is at most `limit`.
    pub fn at_most(&mut self, terms: impl IntoIterator<Item = (usize, f64)>, limit: f64) {
        self.inequalities.push(terms, limit);
    }

    /// Solves the program.
    ///
    /// # Errors
    /// [`LinearProgramError`] when the solver reports no point that would be worth checking.
    pub fn solve(self) -> Result<Solution, LinearProgramError> {
        let Self {
            cost,
            equalities,
            inequalities,
        } = self;
        let equality_count = equalities.right_hand_side.len();
        let inequality_count = inequalities.right_hand_side.len();
        let shifted = inequalities.row.iter().map(|row| row + equality_count);
        let matrix = CscMatrix::new_from_triplets(
            equality_count + inequality_count,
            cost.len(),
            equalities.row.into_iter().chain(shifted).collect(),
            [equalities.column, inequalities.column].concat(),
            [equalities.value, inequalities.value].concat(),
        );
        let right_hand_side = [equalities.right_hand_side, inequalities.right_hand_side].concat();
        let no_quadratic_term = CscMatrix::zeros((cost.len(), cost.len()));
        let failed = |reason: String| LinearProgramError::Failed { status: reason };
        let settings = DefaultSettingsBuilder::default()
            .verbose(false)
            .tol_feas(TOLERANCE)
            .tol_gap_abs(TOLERANCE)
            .tol_gap_rel(TOLERANCE)
            .build()
            .map_err(|error| failed(error.to_string()))?;
        let cones = [ZeroConeT(equality_count), NonnegativeConeT(inequality_count)];
        let mut solver = DefaultSolver::new(
            &no_quadratic_term,
            &cost,
            &matrix,
            &right_hand_side,
            &cones,
            settings,
        )
        .map_err(|error| failed(error.to_string()))?;
        solver.solve();
        let status = format!("{:?}", solver.solution.status);
        match solver.solution.status {
            SolverStatus::Solved | SolverStatus::AlmostSolved | SolverStatus::InsufficientProgress => {
                Ok(Solution {
                    objective: solver.solution.obj_val,
                    dual_objective: solver.solution.obj_val_dual,
                    values: solver.solution.x,
                    iterations: solver.solution.iterations,
                    status,
                })
            }
            SolverStatus::PrimalInfeasible | SolverStatus::AlmostPrimalInfeasible => {
                Err(LinearProgramError::Infeasible { status })
            }
            SolverStatus::DualInfeasible | SolverStatus::AlmostDualInfeasible => {
                Err(LinearProgramError::Unbounded { status })
            }
            _ => Err(LinearProgramError::Failed { status }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_smallest_cost_and_its_point_are_found() {
        let mut program = LinearProgram::default();
        let x = program.add_variables(2);
        program.add_cost(x, 1.0);
        program.add_cost(x + 1, 2.0);
        program.equal([(x, 1.0), (x + 1, 1.0)], 3.0);
        program.at_most([(x, 1.0)], 2.0);
        let solution = program.solve().unwrap();
        assert!((solution.values[0] - 2.0).abs() < 1e-8 && (solution.values[1] - 1.0).abs() < 1e-8);
        assert!((solution.objective - 4.0).abs() < 1e-8 && (solution.dual_objective - 4.0).abs() < 1e-8);
    }

    #[test]
    fn contradictory_and_unlimited_programs_are_told_apart() {
        let mut contradictory = LinearProgram::default();
        let x = contradictory.add_variables(1);
        contradictory.at_most([(x, 1.0)], -1.0);
        contradictory.at_most([(x, -1.0)], -1.0);
        assert!(matches!(
            contradictory.solve(),
            Err(LinearProgramError::Infeasible { .. })
        ));

        let mut unlimited = LinearProgram::default();
        let x = unlimited.add_variables(1);
        unlimited.add_cost(x, 1.0);
        unlimited.at_most([(x, 1.0)], 1.0);
        assert!(matches!(
            unlimited.solve(),
            Err(LinearProgramError::Unbounded { .. })
        ));
    }
}
