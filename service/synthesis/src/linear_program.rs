//! Linear programs: minimise cost'z subject to equalities and inequalities, solved by Clarabel.
//!
//! A [`Solution`] is the last point that the solver reached; whoever uses it checks it against the problem.

use crate::conic::{ConicProgram, ConicSolution, Rows, SolverError};
use clarabel::solver::SupportedConeT::{NonnegativeConeT, ZeroConeT};
use residual_diagnosis::gains::SolverRun;

/// Accuracy asked of the solver, relative and absolute; the check of a solution allows more.
const TOLERANCE: f64 = 1e-10;

/// The last point of the solver, to be checked by its user.
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    /// z.
    pub values: Vec<f64>,
    /// The solver's word, cost'z, and the dual objective: a lower bound of the smallest cost, as exact as the dual
    /// point.
    pub run: SolverRun,
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
    /// [`SolverError`] when the solver reports no point that would be worth checking.
    pub fn solve(self) -> Result<Solution, SolverError> {
        let cones = [
            ZeroConeT(self.equalities.count()),
            NonnegativeConeT(self.inequalities.count()),
        ];
        let mut rows = self.equalities;
        rows.append(self.inequalities);
        let program = ConicProgram {
            problem: "linear program",
            cost: &self.cost,
            rows,
            cones: &cones,
            tolerance: TOLERANCE,
        };
        let ConicSolution { values, run, .. } = program.solve()?;
        Ok(Solution { values, run })
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
        assert!(
            (solution.run.objective - 4.0).abs() < 1e-8 && (solution.run.dual_objective - 4.0).abs() < 1e-8
        );
    }

    #[test]
    fn contradictory_and_unlimited_programs_are_told_apart() {
        let mut contradictory = LinearProgram::default();
        let x = contradictory.add_variables(1);
        contradictory.at_most([(x, 1.0)], -1.0);
        contradictory.at_most([(x, -1.0)], -1.0);
        assert!(matches!(
            contradictory.solve(),
            Err(SolverError::Infeasible { .. })
        ));

        let mut unlimited = LinearProgram::default();
        let x = unlimited.add_variables(1);
        unlimited.add_cost(x, 1.0);
        unlimited.at_most([(x, 1.0)], 1.0);
        assert!(matches!(unlimited.solve(), Err(SolverError::Unbounded { .. })));
    }
}
