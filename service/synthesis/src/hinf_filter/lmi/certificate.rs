//! What is recomputed of a recovered gain before it is returned.

use super::{LmiError, Region, Time, inequalities::bounded_real};
use crate::semidefinite::SemidefiniteProgram;
use nalgebra::DMatrix;
use residual_diagnosis::{
    decomposition::eigenvalues,
    hinf_filter::bounded_real::margin,
    lyapunov,
    norms::{System, h_infinity_continuous, h_infinity_discrete},
};

/// Smallest [`margin`] with which a Lyapunov matrix is taken.
const DEFINITE: f64 = 1e-12;
/// Halvings of what is added to a Lyapunov matrix.
const HALVINGS: i32 = 60;

/// A Lyapunov matrix for which the bounded-real inequality of a stable system holds strictly at `level`, made of one
/// for which it holds, up to the solver's errors, at a slightly lower level.
///
/// The added multiple of P, where A'P + PA = -X (A'PA - P = -X), makes the block of the state definite; the raised
/// level makes up for its effect on the others. The most definite of all multiples is taken. If none is definite, the
/// solver is asked once more, for X alone.
pub(super) fn strict_lyapunov(
    time: Time,
    system: &System,
    level: f64,
    start: &DMatrix<f64>,
) -> Option<DMatrix<f64>> {
    let transposed = system.a.transpose();
    let p = match time {
        Time::Continuous => lyapunov::continuous(&transposed, start),
        Time::Discrete => lyapunov::discrete(&transposed, start),
    }?;
    let best = (0..HALVINGS)
        .map(|halvings| start + &p * (start.norm() / p.norm() * 0.5_f64.powi(halvings)))
        .map(|x| (margin(system, time, &x, level), x))
        .max_by(|left, right| left.0.total_cmp(&right.0));
    match best {
        Some((least, x)) if least > DEFINITE => Some(x),
        _ => most_strict(time, system, level),
    }
}

/// The X with the largest smallest eigenvalue of the bounded-real inequality.
fn most_strict(time: Time, system: &System, level: f64) -> Option<DMatrix<f64>> {
    let n = system.a.nrows();
    let mut problem = SemidefiniteProgram::named("bounded-real certificate of a gain");
    let (x, least) = (problem.symmetric(n), problem.scalar());
    problem.maximise(least);
    problem.require("bounded real", move |at| {
        let x = at.matrix(x);
        let terms = (&x * &system.a, &x * &system.b);
        let matrix = bounded_real(time, &x, terms, (&system.c, &system.d), 1.0, level);
        let sign = match time {
            Time::Continuous => -1.0,
            Time::Discrete => 1.0,
        };
        let order = matrix.nrows();
        matrix * sign - DMatrix::identity(order, order) * at.number(least)
    });
    problem.require("positive", move |at| {
        at.matrix(x) - DMatrix::identity(n, n) * at.number(least)
    });
    let found = problem.solve().ok()?.value(x);
    (margin(system, time, &found, level) > DEFINITE).then_some(found)
}

/// Fails unless all poles of a system lie in the region.
pub(super) fn check_poles(time: Time, system: &System, region: &Region) -> Result<(), LmiError> {
    let violated = |margin: f64| LmiError::OutsideRegion {
        region: region.describe(time),
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

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::dmatrix;

    /// 1/(s + 2) has the norm 1/2, 1/(z - 1/2) the norm 2.
    fn examples() -> [(Time, System, f64); 2] {
        let one = dmatrix![1.0];
        let system = |pole: f64| System::new(&dmatrix![pole], &one, &one, &dmatrix![0.0]);
        [
            (Time::Continuous, system(-2.0), 0.5),
            (Time::Discrete, system(0.5), 2.0),
        ]
    }

    #[test]
    fn a_strict_certificate_is_found_just_above_the_norm_and_none_below() {
        for (time, system, norm) in examples() {
            let poor = dmatrix![1e-3];
            for start in [poor, dmatrix![1.0], dmatrix![1e6]] {
                let x = strict_lyapunov(time, &system, 1.001 * norm, &start).unwrap();
                assert!(margin(&system, time, &x, 1.001 * norm) > DEFINITE, "{time:?}");
                assert!(
                    strict_lyapunov(time, &system, 0.999 * norm, &start).is_none(),
                    "{time:?}"
                );
            }
            assert!(margin(&system, time, &dmatrix![-1.0], 10.0 * norm) <= 0.0);
            assert!(check_norm(time, &system, norm * 1.0001).is_ok());
            assert!(check_norm(time, &system, norm * 0.9999).is_err());
            assert!(check_poles(time, &system, &Region::default()).is_ok());
            let small = Region {
                decay: None,
                radius: Some(0.4),
            };
            let error = check_poles(time, &system, &small).unwrap_err();
            assert!(error.to_string().contains("the region |λ| < 0.4;"), "{error}");
        }
    }
}
