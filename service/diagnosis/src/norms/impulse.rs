//! The ℓ1 norm: what a bounded input can do at most, output by output.

use super::system::System;
use nalgebra::DMatrix;

/// The input matrix counts as decayed below this part of its start.
const DECAYED: f64 = 1e-17;
/// A response that has not decayed after so many samples is given up.
const LONGEST: usize = 4_000_000;

/// |G|_ij = Σ_t |g_ij(t)| of a discrete-time system, q x m; `None` if the impulse response does not decay.
///
/// With |w_j(t)| <= w̄_j at all times, |z_i| <= Σ_j |G|_ij w̄_j, and some w reaches the bound.
pub fn l1_norm(system: &System) -> Option<DMatrix<f64>> {
    let mut sum = system.d.abs();
    let mut propagated = system.b.clone();
    let start = propagated.amax();
    let mut next = propagated.clone();
    for _ in 0..LONGEST {
        if propagated.amax() <= DECAYED * start {
            return Some(sum);
        }
        sum += (&system.c * &propagated).abs();
        system.a.mul_to(&propagated, &mut next);
        std::mem::swap(&mut propagated, &mut next);
        if !propagated.amax().is_finite() {
            return None;
        }
    }
    None
}
