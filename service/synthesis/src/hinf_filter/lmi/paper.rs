//! The paper's synthesis, (13), (14), (16), and both gains that can be recovered from its solution (method sheet 3.6).
//!
//! Theorem 1 of the paper claims a bound for H = R⁻¹Z that this gain need not keep, because (13) contains two gains
//! that it does not tie together. The bound holds for the other gain, X⁻¹Y', with W_F = T_rf. Nothing here certifies a
//! gain: the user recomputes the norms.

use super::{
    ErrorPlant, LmiError, Region, Time,
    inequalities::{PaperVariables, condition_13},
    plant::check_matrix,
    stages::recovered,
};
use crate::semidefinite::SemidefiniteProgram;
use nalgebra::DMatrix;
use residual_diagnosis::{gains::SolverRun, norms::System};

/// R and X - R are at least this multiple of the identity: (14) strictly.
const STRICT: f64 = 1e-7;
/// A claimed bound below σ_max(Dd) by more than this part is a failure of the solver (method sheet 3.5).
const BELOW_DIRECT: f64 = 1e-6;

/// The blocks of the disturbance and of the fault on the diagonal of (13).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Normalisation {
    /// -I, as in the paper's (13): the bound is √γ, not the γ that the paper claims.
    Printed,
    /// -γI, as Lemma 1 demands: the bound is γ.
    Lemma1,
}

/// A solution of the paper's conditions.
#[derive(Clone, Debug, PartialEq)]
pub struct PaperSolution {
    /// γ.
    pub gamma: f64,
    /// What the conditions claim of J = ‖\[-T_rd, W_F - T_rf\]‖∞: √γ or γ.
    pub claimed_bound: f64,
    /// H = R⁻¹Z, as the paper recovers it; its J may exceed the claim.
    pub printed_gain: DMatrix<f64>,
    /// H = X⁻¹Y': with W_F = T_rf its J = ‖T_rd‖∞ keeps the claim.
    pub sound_gain: DMatrix<f64>,
    /// W_F as the paper recovers it: A_F = (R-X)⁻¹M', B_F = (R-X)⁻¹K, C_F = N', D_F = T.
    pub reference: System,
    /// All variables.
    pub variables: PaperVariables,
    /// The solver's words.
    pub runs: Vec<SolverRun>,
}

/// The paper's synthesis in continuous time; `bf` (n x l) and `df` (q x l) stand beside the plant.
///
/// # Errors
/// [`LmiError`]: a plant that is not detectable, a failure of the solver, or an impossible claim.
pub fn paper(
    plant: &ErrorPlant<'_>,
    bf: &DMatrix<f64>,
    df: &DMatrix<f64>,
    normalisation: Normalisation,
) -> Result<PaperSolution, LmiError> {
    plant.check()?;
    let (n, q, l) = (plant.a.nrows(), plant.c.nrows(), bf.ncols());
    check_matrix("Bf", bf, (n, l))?;
    check_matrix("Df", df, (q, l))?;
    let (time, region) = (Time::Continuous, Region::default());
    region.check(time, plant)?;
    if plant.is_silent() {
        return Err(match plant.disturbance_size() {
            Ok(_) => LmiError::Unbounded,
            Err(error) => error,
        });
    }
    let mut problem = SemidefiniteProgram::named("the paper's (13), (14), (16): smallest γ");
    let (r, x) = (problem.symmetric(n), problem.symmetric(n));
    let (z, y) = (problem.full(n, q), problem.full(q, n));
    let (m, k) = (problem.full(n, n), problem.full(n, l));
    let (nn, t) = (problem.full(n, q), problem.full(q, l));
    let gamma = problem.scalar();
    problem.minimise(gamma);
    let least = DMatrix::identity(n, n) * STRICT;
    let floor = least.clone();
    problem.require("(14), R", move |at| at.matrix(r) - &least);
    problem.require("(14), X - R", move |at| at.matrix(x) - at.matrix(r) - &floor);
    problem.require("(13)", move |at| {
        let variables = PaperVariables {
            r: at.matrix(r),
            x: at.matrix(x),
            z: at.matrix(z),
            y: at.matrix(y),
            m: at.matrix(m),
            k: at.matrix(k),
            n: at.matrix(nn),
            t: at.matrix(t),
        };
        let gamma = at.number(gamma);
        let inputs = match normalisation {
            Normalisation::Printed => 1.0,
            Normalisation::Lemma1 => gamma,
        };
        -condition_13(plant, (bf, df), &variables, (inputs, gamma))
    });
    let solution = problem.solve().map_err(|source| LmiError::Solver {
        problem: "the paper's (13), (14), (16)".to_owned(),
        region: region.describe(time),
        source,
    })?;
    let gamma = solution.number(gamma);
    let claimed_bound = match normalisation {
        Normalisation::Printed => gamma.max(0.0).sqrt(),
        Normalisation::Lemma1 => gamma,
    };
    let direct = plant.direct();
    if !(claimed_bound >= direct * (1.0 - BELOW_DIRECT)) {
        return Err(LmiError::ImpossibleLevel {
            problem: "the paper's (13), (14), (16)".to_owned(),
            level: claimed_bound,
            least: direct,
        });
    }
    let value = |variable| solution.value(variable);
    let variables = PaperVariables {
        r: value(r),
        x: value(x),
        z: value(z),
        y: value(y),
        m: value(m),
        k: value(k),
        n: value(nn),
        t: value(t),
    };
    let PaperVariables { r, x, .. } = &variables;
    // (R - X)⁻¹ = -(X - R)⁻¹, X - R ≻ 0.
    let difference = x - r;
    Ok(PaperSolution {
        gamma,
        claimed_bound,
        printed_gain: recovered(r, &variables.z)?,
        sound_gain: recovered(x, &variables.y.transpose())?,
        reference: System {
            a: -recovered(&difference, &variables.m.transpose())?,
            b: -recovered(&difference, &variables.k)?,
            c: variables.n.transpose(),
            d: variables.t.clone(),
        },
        runs: vec![solution.run],
        variables,
    })
}
