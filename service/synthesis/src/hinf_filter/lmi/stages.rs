//! The two semidefinite programs of the bounded-real synthesis (method sheet 3.3), in the solver's units.

use super::{
    ErrorPlant, LmiError, Region, Time,
    inequalities::{bounded_real_of_gain, decay, radius},
};
use crate::{
    conic::SolverError,
    semidefinite::{MatrixVariable, SemidefiniteError, SemidefiniteProgram},
};
use nalgebra::DMatrix;
use residual_diagnosis::{decomposition::SymmetricDecomposition, gains::SolverRun};

/// Largest difference of the primal and the dual objective, relative, for which γ₁ counts as found.
const OPEN_GAP: f64 = 1e-3;

/// A point of a stage.
pub(super) struct Stage {
    /// γ₁ of stage 1, γ₂ of stage 2.
    pub(super) level: f64,
    /// X, divided by s in stage 2: the certificate.
    pub(super) x: DMatrix<f64>,
    /// X⁻¹W.
    pub(super) gain: DMatrix<f64>,
    pub(super) run: SolverRun,
}

/// What both stages share: the plant and the region.
pub(super) struct Conditions<'a> {
    pub(super) time: Time,
    pub(super) plant: ErrorPlant<'a>,
    /// The region that is asked for, and one slightly within it.
    pub(super) asked: &'a Region,
    pub(super) region: Region,
}

impl<'a> Conditions<'a> {
    /// Stage 1: the smallest level γ₁ of the bounded-real inequality with the region.
    pub(super) fn stage_one(&'a self) -> Result<Stage, LmiError> {
        let least = match self.time {
            Time::Continuous => 1e-7,
            Time::Discrete => 1e-9,
        };
        let mut problem = SemidefiniteProgram::named("two-stage bounded-real, stage 1: smallest γ");
        let (x, w) = self.variables(&mut problem, least);
        let level = problem.scalar();
        problem.minimise(level);
        problem.require("bounded real", move |at| {
            self.bounded_real(&at.matrix(x), &at.matrix(w), 1.0, at.number(level))
        });
        let solution = problem
            .solve()
            .map_err(|source| self.refused("stage 1", source))?;
        let (x, w, run) = (solution.value(x), solution.value(w), solution.run.clone());
        if !((run.objective - run.dual_objective).abs() <= OPEN_GAP * run.objective.abs()) {
            let status = format!("{}, {} above {}", run.status, run.objective, run.dual_objective);
            return Err(self.refused("stage 1", SolverError::Failed { status }.into()));
        }
        Ok(Stage {
            level: solution.number(level),
            gain: recovered(&x, &w)?,
            x,
            run,
        })
    }

    /// Stage 2: the smallest ‖W‖_F with X ⪰ I at the level γ₂.
    pub(super) fn stage_two(&'a self, level: f64) -> Result<Stage, LmiError> {
        let mut problem = SemidefiniteProgram::named("two-stage bounded-real, stage 2: smallest gain");
        let (x, w) = self.variables(&mut problem, 1.0);
        let (s, t) = (problem.scalar(), problem.scalar());
        problem.minimise(t);
        problem.at_most_norm(t, w);
        problem.require("s", move |at| at.matrix(s));
        problem.require("bounded real", move |at| {
            let s = at.number(s);
            self.bounded_real(&at.matrix(x), &at.matrix(w), s, level * s)
        });
        let solution = problem
            .solve()
            .map_err(|source| self.refused("stage 2", source))?;
        let (x, w, s) = (solution.value(x), solution.value(w), solution.number(s));
        Ok(Stage {
            level,
            gain: recovered(&x, &w)?,
            x: x / s.max(f64::MIN_POSITIVE),
            run: solution.run,
        })
    }

    /// X ⪰ `least` I and W, with the region.
    fn variables(
        &'a self,
        problem: &mut SemidefiniteProgram<'a>,
        least: f64,
    ) -> (MatrixVariable, MatrixVariable) {
        let (n, q) = (self.plant.a.nrows(), self.plant.c.nrows());
        let (x, w) = (problem.symmetric(n), problem.full(n, q));
        problem.require("positive", move |at| {
            at.matrix(x) - DMatrix::identity(n, n) * least
        });
        require_region(problem, self.time, self.plant, self.region, (x, w));
        (x, w)
    }

    /// ⪰ 0 in both time domains.
    fn bounded_real(&self, x: &DMatrix<f64>, w: &DMatrix<f64>, s: f64, level: f64) -> DMatrix<f64> {
        let matrix = bounded_real_of_gain(self.time, &self.plant, x, w, s, level);
        match self.time {
            Time::Continuous => -matrix,
            Time::Discrete => matrix,
        }
    }

    fn refused(&self, problem: &str, source: SemidefiniteError) -> LmiError {
        LmiError::Solver {
            problem: format!("two-stage bounded-real, {problem}"),
            region: self.asked.describe(self.time),
            source,
        }
    }
}

/// Adds the inequalities of the region for X and W = X L.
pub(super) fn require_region<'a>(
    problem: &mut SemidefiniteProgram<'a>,
    time: Time,
    plant: ErrorPlant<'a>,
    region: Region,
    (x, w): (MatrixVariable, MatrixVariable),
) {
    if let Some(alpha) = region.decay.filter(|_| time == Time::Continuous) {
        problem.require("decay", move |at| {
            -decay(&plant, &at.matrix(x), &at.matrix(w), alpha)
        });
    }
    if let Some(rho) = region.radius {
        problem.require("radius", move |at| {
            -radius(&plant, &at.matrix(x), &at.matrix(w), rho)
        });
    }
}

/// X⁻¹W.
pub(super) fn recovered(x: &DMatrix<f64>, w: &DMatrix<f64>) -> Result<DMatrix<f64>, LmiError> {
    let singular = || LmiError::Recovery {
        condition: "X ≻ 0".to_owned(),
        margin: -SymmetricDecomposition::new(x).smallest(),
    };
    let gain = x.clone().cholesky().ok_or_else(singular)?.solve(w);
    match gain.iter().all(|entry| entry.is_finite()) {
        true => Ok(gain),
        false => Err(singular()),
    }
}
