//! Semidefinite programs over matrix variables: minimise a linear function subject to linear matrix inequalities.
//!
//! A constraint is a closure that computes a matrix from the variables at a [`Point`]; it must be affine. The program
//! is assembled by evaluating it at zero and at the unit vectors, so that nobody counts indices (method sheet
//! `hinf_filter` 3.4).
//!
//! | symbol | meaning |
//! |---|---|
//! | x | all entries of the variables, one after another; of symmetric ones the upper triangle, column by column |
//! | G(x) ⪰ 0 | a matrix inequality; G₀ = G(0), G_i = G(e_i) - G₀ |
//! | svec | upper triangle column by column, off-diagonal entries times √2 |
//!
//! ```
//! # use residual_synthesis::semidefinite::SemidefiniteProgram;
//! # use nalgebra::{dmatrix, DMatrix};
//! // The largest eigenvalue of A is the smallest t with tI - A ⪰ 0.
//! let a = &dmatrix![2.0, 1.0; 1.0, 2.0];
//! let mut problem = SemidefiniteProgram::new();
//! let t = problem.scalar();
//! problem.minimise(t);
//! problem.require("upper bound", move |at| DMatrix::identity(2, 2) * at.number(t) - a);
//! let solution = problem.solve()?;
//! assert!((solution.number(t) - 3.0).abs() < 1e-6);
//! # Ok::<(), residual_synthesis::semidefinite::SemidefiniteError>(())
//! ```

mod assembly;
mod blocks;
mod solution;
mod variables;

pub use assembly::svec;
pub use blocks::{hermitian, symmetric_blocks};
pub use solution::SemidefiniteSolution;
pub use variables::{MatrixVariable, Point};

use crate::conic::{ConicProgram, Rows, SolverError};
use clarabel::solver::SupportedConeT;
use nalgebra::DMatrix;
use thiserror::Error;

/// Accuracy asked of the solver, relative and absolute.
const TOLERANCE: f64 = 1e-9;

/// Why there is no solution to check.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum SemidefiniteError {
    /// The solver has none.
    #[error(transparent)]
    Solver(#[from] SolverError),
    /// A constraint has an entry that is infinite or not a number.
    #[error(
        "the constraint {constraint:?} has an entry that is not finite; check the matrices it is made of"
    )]
    NotFinite {
        /// Its name.
        constraint: String,
    },
    /// A matrix inequality that is not symmetric.
    #[error("the matrix of the inequality {constraint:?} is not symmetric; check its blocks")]
    NotSymmetric {
        /// Its name.
        constraint: String,
    },
}

/// What is demanded of the matrix of a constraint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Demand {
    /// It is positive semidefinite.
    Semidefinite,
    /// It is zero.
    Zero,
    /// It is a column whose first entry is at least the norm of the others.
    NormCone,
}

/// An affine function of the variables.
type Affine<'a> = dyn Fn(&Point<'_>) -> DMatrix<f64> + 'a;

struct Constraint<'a> {
    name: String,
    demand: Demand,
    matrix: Box<Affine<'a>>,
}

/// A semidefinite program under construction.
#[derive(Default)]
pub struct SemidefiniteProgram<'a> {
    problem: String,
    cost: Vec<f64>,
    constraints: Vec<Constraint<'a>>,
}

impl<'a> SemidefiniteProgram<'a> {
    /// A program without variables and constraints.
    pub fn new() -> Self {
        Self::named("semidefinite program")
    }

    /// The same, with the name by which its [solver run](SemidefiniteSolution::run) is recorded.
    pub fn named(problem: &str) -> Self {
        Self {
            problem: problem.to_owned(),
            ..Self::default()
        }
    }

    /// A symmetric variable of order `n`: n (n + 1) / 2 unknowns.
    pub fn symmetric(&mut self, n: usize) -> MatrixVariable {
        self.add(MatrixVariable::symmetric(self.cost.len(), n))
    }

    /// A variable of any shape, without structure.
    pub fn full(&mut self, rows: usize, columns: usize) -> MatrixVariable {
        self.add(MatrixVariable::full(self.cost.len(), rows, columns))
    }

    /// A number, as a variable of shape 1 x 1.
    pub fn scalar(&mut self) -> MatrixVariable {
        self.full(1, 1)
    }

    fn add(&mut self, variable: MatrixVariable) -> MatrixVariable {
        self.cost.resize(self.cost.len() + variable.unknowns(), 0.0);
        variable
    }

    /// Adds the trace of a variable, which is the number itself for a scalar, to what is minimised.
    pub fn minimise_trace(&mut self, variable: MatrixVariable) {
        self.add_cost(variable, 1.0);
    }

    /// Adds a scalar to what is minimised.
    pub fn minimise(&mut self, scalar: MatrixVariable) {
        self.add_cost(scalar, 1.0);
    }

    /// Subtracts a scalar from what is minimised.
    pub fn maximise(&mut self, scalar: MatrixVariable) {
        self.add_cost(scalar, -1.0);
    }

    fn add_cost(&mut self, variable: MatrixVariable, weight: f64) {
        for unknown in variable.diagonal() {
            if let Some(cost) = self.cost.get_mut(unknown) {
                *cost += weight;
            }
        }
    }

    /// Demands that an affine, symmetric function of the variables is positive semidefinite.
    pub fn require(&mut self, name: &str, matrix: impl Fn(&Point<'_>) -> DMatrix<f64> + 'a) {
        self.constrain(name, Demand::Semidefinite, matrix);
    }

    /// Demands that an affine function of the variables is zero.
    pub fn equal(&mut self, name: &str, matrix: impl Fn(&Point<'_>) -> DMatrix<f64> + 'a) {
        self.constrain(name, Demand::Zero, matrix);
    }

    /// Demands ‖Y‖_F <= t of a scalar and a matrix variable.
    pub fn at_most_norm(&mut self, t: MatrixVariable, y: MatrixVariable) {
        self.constrain("norm", Demand::NormCone, move |at| {
            let entries = at.matrix(y);
            DMatrix::from_iterator(
                1 + entries.len(),
                1,
                std::iter::once(at.number(t)).chain(entries.iter().copied()),
            )
        });
    }

    fn constrain(&mut self, name: &str, demand: Demand, matrix: impl Fn(&Point<'_>) -> DMatrix<f64> + 'a) {
        self.constraints.push(Constraint {
            name: name.to_owned(),
            demand,
            matrix: Box::new(matrix),
        });
    }

    /// Solves the program.
    ///
    /// The solution is the last point of the solver, also where it stopped short of the accuracy asked for
    /// ([`SemidefiniteSolution::almost`]): the user verifies what he needs of it.
    ///
    /// # Errors
    /// [`SemidefiniteError`]: infeasible, unbounded or failed; a constraint that is not finite or not symmetric.
    pub fn solve(&self) -> Result<SemidefiniteSolution, SemidefiniteError> {
        let mut rows = Rows::default();
        let mut cones: Vec<SupportedConeT<f64>> = Vec::with_capacity(self.constraints.len());
        for constraint in &self.constraints {
            let (added, cone) = constraint.assemble(self.cost.len())?;
            rows.append(added);
            cones.push(cone);
        }
        let program = ConicProgram {
            problem: &self.problem,
            cost: &self.cost,
            rows,
            cones: &cones,
            tolerance: TOLERANCE,
        };
        let solution = program.solve()?;
        let margins = self
            .constraints
            .iter()
            .map(|constraint| (constraint.name.clone(), constraint.margin(&solution.values)))
            .collect();
        Ok(SemidefiniteSolution::new(solution, margins))
    }
}
