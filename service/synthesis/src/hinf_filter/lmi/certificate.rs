//! What is recomputed of a recovered gain before it is returned.

use super::{LmiError, Region, Time, inequalities::bounded_real};
use crate::semidefinite::SemidefiniteProgram;
use nalgebra::DMatrix;
use residual_diagnosis::{
    decomposition::{SymmetricDecomposition, eigenvalues},
    lyapunov,
    norms::{System, h_infinity_continuous, h_infinity_discrete},
};

/// Smallest [`definiteness`] that is no rounding error.
const DEFINITE: f64 = 1e-12;
/// Halvings of what is added to a Lyapunov matrix.
const HALVINGS: i32 = 60;

/// Smallest eigenvalue of a symmetric matrix after its diagonal was scaled to 1: positive if and only if it is
/// positive definite, whatever the units of its rows. Minus infinity if the diagonal is not positive.
pub fn definiteness(matrix: &DMatrix<f64>) -> f64 {
    let diagonal = matrix.diagonal();
    if !diagonal.iter().all(|&entry| entry > 0.0) {
        return f64::NEG_INFINITY;
    }
    let root = diagonal.map(f64::sqrt);
    let scaled = DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |i, j| {
        matrix[(i, j)] / (root[i] * root[j])
    });
    SymmetricDecomposition::new(&scaled).smallest()
}

/// The bounded-real inequality of a system as a matrix that must be positive definite.
fn inequality(time: Time, system: &System, x: &DMatrix<f64>, level: f64) -> DMatrix<f64> {
    let terms = (x * &system.a, x * &system.b);
    let matrix = bounded_real(time, x, terms, (&system.c, &system.d), 1.0, level);
    match time {
        Time::Continuous => -matrix,
        Time::Discrete => matrix,
    }
}

/// [`definiteness`] of the strict bounded-real inequality for X at this level; X itself must be definite, too.
pub(super) fn strictness(time: Time, system: &System, x: &DMatrix<f64>, level: f64) -> f64 {
    definiteness(&inequality(time, system, x, level)).min(definiteness(x))
}

/// A Lyapunov matrix for which the bounded-real inequality of a stable system holds strictly at `level`, made of one
/// for which it holds, up to the solver's errors, at a slightly lower level.
///
/// The added multiple of P, where A'P + PA = -I (A'PA - P = -I), makes the block of the state definite; the raised
/// level makes up for its effect on the others. The most definite of all multiples is taken. If none is definite, the
/// solver is asked once more, for X alone.
pub(super) fn strict_lyapunov(
    time: Time,
    system: &System,
    level: f64,
    start: &DMatrix<f64>,
) -> Option<DMatrix<f64>> {
    let n = system.a.nrows();
    let (transposed, identity) = (system.a.transpose(), DMatrix::identity(n, n));
    let p = match time {
        Time::Continuous => lyapunov::continuous(&transposed, &identity),
        Time::Discrete => lyapunov::discrete(&transposed, &identity),
    }?;
    let unit = start.norm() / p.norm();
    let best = (0..HALVINGS)
        .map(|halvings| start + &p * (unit * 0.5_f64.powi(halvings)))
        .map(|x| (strictness(time, system, &x, level), x))
        .max_by(|left, right| left.0.total_cmp(&right.0));
    match best {
        Some((margin, x)) if margin > DEFINITE => Some(x),
        _ => most_strict(time, system, level),
    }
}

/// The X with the largest smallest eigenvalue of the bounded-real inequality.
fn most_strict(time: Time, system: &System, level: f64) -> Option<DMatrix<f64>> {
    let n = system.a.nrows();
    let mut problem = SemidefiniteProgram::named("bounded-real certificate of a gain");
    let (x, margin) = (problem.symmetric(n), problem.scalar());
    problem.maximise(margin);
    problem.require("bounded real", move |at| {
        let matrix = inequality(time, system, &at.matrix(x), level);
        let order = matrix.nrows();
        matrix - DMatrix::identity(order, order) * at.number(margin)
    });
    problem.require("positive", move |at| {
        at.matrix(x) - DMatrix::identity(n, n) * at.number(margin)
    });
    let found = problem.solve().ok()?.value(x);
    (strictness(time, system, &found, level) > DEFINITE).then_some(found)
}

/// Fails unless all poles of a system lie in the region.
pub(super) fn check_poles(time: Time, system: &System, region: &Region) -> Result<(), LmiError> {
    let violated = |margin: f64| LmiError::Recovery {
        condition: format!("{} of all poles", region.describe(time)),
        margin,
    };
    let poles = eigenvalues(&system.a).ok_or_else(|| violated(f64::INFINITY))?;
    let least = poles
        .iter()
        .map(|&pole| region.margin(time, pole))
        .fold(f64::INFINITY, f64::min);
    match least > 0.0 {
        true => Ok(()),
        false => Err(violated(-least)),
    }
}

/// Fails unless the H∞ norm of a stable system is at most `bound`.
pub(super) fn check_norm(time: Time, system: &System, bound: f64) -> Result<(), LmiError> {
    let norm = match time {
        Time::Continuous => h_infinity_continuous(system),
        Time::Discrete => h_infinity_discrete(system),
    };
    match norm.value <= bound {
        true => Ok(()),
        false => Err(LmiError::Recovery {
            condition: format!("‖T_rd‖∞ <= {bound}"),
            margin: norm.value - bound,
        }),
    }
}
