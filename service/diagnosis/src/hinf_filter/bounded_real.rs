//! The bounded-real inequality at a given Lyapunov matrix: a proof of ‖G‖∞ < γ that needs eigenvalues of one symmetric
//! matrix only (method sheet 3.3).
//!
//! | time | inequality |
//! |---|---|
//! | continuous | \[\[He(XA), XB, C'\], \[·, -γI, D'\], \[·, ·, -γI\]\] ≺ 0 |
//! | discrete | \[\[X, XA, XB, 0\], \[·, X, 0, C'\], \[·, ·, γI, D'\], \[·, ·, ·, γI\]\] ≻ 0 |
//!
//! Both are taken to the coordinates in which X is the identity (X = KK', z = K'x), where they are well scaled.

use super::{certificate::Time, conditions::scaled_margin};
use crate::norms::System;
use nalgebra::DMatrix;

/// Smallest eigenvalue of the inequality for G = `system` at X = `lyapunov` (n x n) and γ = `bound`, scaled to a unit
/// diagonal: positive only if A is stable and ‖G‖∞ < γ. Negative also if X is not positive definite.
pub fn margin(system: &System, time: Time, lyapunov: &DMatrix<f64>, bound: f64) -> f64 {
    let symmetric = (lyapunov + lyapunov.transpose()) / 2.0;
    let definite = scaled_margin(&symmetric);
    let inverse = symmetric
        .cholesky()
        .and_then(|factor| Some((factor.l(), factor.l().try_inverse()?)));
    match inverse {
        Some((factor, inverse)) if definite > 0.0 => {
            let (a, b) = (
                factor.transpose() * &system.a * inverse.transpose(),
                factor.transpose() * &system.b,
            );
            let c = &system.c * inverse.transpose();
            scaled_margin(&assembled(&System::new(&a, &b, &c, &system.d), time, bound))
        }
        _ => definite.min(-f64::MIN_POSITIVE),
    }
}

/// The inequality with X = I as a matrix that must be positive definite.
fn assembled(system: &System, time: Time, bound: f64) -> DMatrix<f64> {
    let System { a, b, c, d } = system;
    let (n, m, q) = (a.nrows(), b.ncols(), c.nrows());
    let states = match time {
        Time::Continuous => n,
        Time::Discrete => 2 * n,
    };
    let mut out = DMatrix::identity(states + m + q, states + m + q);
    out.view_mut((states, states), (m + q, m + q)).scale_mut(bound);
    let mut put = |row: usize, column: usize, block: &DMatrix<f64>| {
        out.view_mut((row, column), block.shape()).copy_from(block);
        out.view_mut((column, row), (block.ncols(), block.nrows()))
            .copy_from(&block.transpose());
    };
    put(states, states + m, &d.transpose());
    match time {
        Time::Continuous => {
            put(0, 0, &-(a + a.transpose()));
            put(0, n, &-b);
            put(0, n + m, &c.transpose());
        }
        Time::Discrete => {
            put(0, n, a);
            put(0, 2 * n, b);
            put(n, 2 * n + m, &c.transpose());
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::dmatrix;

    /// 1/(s + 2) has the norm 1/2, z⁻¹-like 1/(z - 1/2) the norm 2; X solves both inequalities just above it.
    #[test]
    fn the_inequality_holds_above_the_norm_and_for_no_matrix_below_it() {
        let one = dmatrix![1.0];
        let lag = System::new(&dmatrix![-2.0], &one, &one, &dmatrix![0.0]);
        let held = System::new(&dmatrix![0.5], &one, &one, &dmatrix![0.0]);
        for (system, time, norm) in [(lag, Time::Continuous, 0.5), (held, Time::Discrete, 2.0)] {
            let best = |bound: f64| {
                (-60..=60)
                    .map(|i| margin(&system, time, &dmatrix![2.0_f64.powf(f64::from(i) / 10.0)], bound))
                    .fold(f64::NEG_INFINITY, f64::max)
            };
            assert!(best(norm * 1.01) > 0.0, "{time:?}");
            assert!(best(norm * 0.999) < 0.0, "{time:?}");
            assert!(
                margin(&system, time, &dmatrix![-1.0], norm * 10.0) < 0.0,
                "{time:?}"
            );
            assert!(
                margin(&system, time, &dmatrix![f64::NAN], norm * 10.0) < 0.0,
                "{time:?}"
            );
        }
    }
}
