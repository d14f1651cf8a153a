//! The H∞ norm by level sets.

use super::{
    Norm,
    frequency::{between, candidates, crossings, dense_grid},
    system::System,
};
use crate::decomposition::eigenvalues;

/// How far above the best gain the level lies that nothing may cross.
const STEP: f64 = 2e-10;
/// Every round at least doubles the number of correct digits.
const ROUNDS: usize = 60;

/// ‖G‖∞ = sup over ω of σ_max G(jω) of a continuous-time system; infinite if it is not stable.
pub fn h_infinity_continuous(system: &System) -> Norm {
    let Some(poles) = eigenvalues(&system.a) else {
        return Norm::unconfirmed(f64::INFINITY, 0.0, f64::INFINITY);
    };
    if poles.iter().any(|pole| !(pole.re < 0.0)) {
        return Norm::infinite();
    }
    let gain = |omega: f64| system.gains(omega).map_or(f64::INFINITY, |gains| gains.1);
    let largest = |frequencies: &[f64]| frequencies.iter().map(|omega| gain(*omega)).fold(0.0, f64::max);
    let mut best = largest(&candidates(&poles));
    for _ in 0..ROUNDS {
        if best == 0.0 || best.is_infinite() {
            break;
        }
        let level = best * (1.0 + STEP);
        let Some(crossings) = crossings(system, level) else {
            let value = best.max(largest(&dense_grid(&poles)));
            return Norm::unconfirmed(value, value, f64::INFINITY);
        };
        let above = if crossings.len() < 2 {
            0.0
        } else {
            largest(&between(&crossings))
        };
        if !(above > level) {
            break;
        }
        best = above;
    }
    Norm::proven(best, best, best * (1.0 + STEP))
}

/// ‖G‖∞ over the unit circle of a discrete-time system; infinite if it is not stable.
pub fn h_infinity_discrete(system: &System) -> Norm {
    match system.bilinear() {
        Some(continuous) => h_infinity_continuous(&continuous),
        None => Norm::infinite(),
    }
}
