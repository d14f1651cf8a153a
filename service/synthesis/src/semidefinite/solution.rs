//! The last point of the solver, with the margins of the constraints recomputed there.

use super::MatrixVariable;
use crate::conic::ConicSolution;
use nalgebra::DMatrix;
use residual_diagnosis::gains::SolverRun;

/// The last point of the solver. Only its [margins](Self::margin) say what holds there.
#[derive(Clone, Debug, PartialEq)]
pub struct SemidefiniteSolution {
    unknowns: Vec<f64>,
    margins: Vec<(String, f64)>,
    /// The solver's words.
    pub run: SolverRun,
    /// The solver stopped short of the accuracy asked for.
    pub almost: bool,
}

impl SemidefiniteSolution {
    pub(super) fn new(solution: ConicSolution, margins: Vec<(String, f64)>) -> Self {
        Self {
            unknowns: solution.values,
            margins,
            run: solution.run,
            almost: !solution.solved,
        }
    }

    /// The value of a variable.
    pub fn value(&self, variable: MatrixVariable) -> DMatrix<f64> {
        variable.value(&self.unknowns)
    }

    /// The value of a scalar; of a matrix the sum of its diagonal.
    pub fn number(&self, scalar: MatrixVariable) -> f64 {
        self.value(scalar).diagonal().sum()
    }

    /// How far the constraint of this name is from being violated, recomputed: the smallest eigenvalue of an
    /// inequality, minus the largest deviation of an equality. The least of several constraints of one name; `None`
    /// without any.
    pub fn margin(&self, name: &str) -> Option<f64> {
        let margins = self.margins.iter().filter(|margin| margin.0 == name);
        margins.map(|margin| margin.1).reduce(f64::min)
    }

    /// The least margin of all constraints, with the name of the constraint; `None` without constraints.
    pub fn least_margin(&self) -> Option<(&str, f64)> {
        let least = self
            .margins
            .iter()
            .min_by(|left, right| left.1.total_cmp(&right.1))?;
        Some((&least.0, least.1))
    }
}
