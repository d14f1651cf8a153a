//! The H∞ norm by level sets.

use super::{
    Norm,
    frequency::{between, candidates, crossings, dense_grid, refined},
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
    let first = candidates(&poles);
    let mut best = largest(&first);
    for _ in 0..ROUNDS {
        if best == 0.0 || best.is_infinite() {
            return Norm::proven(best, best, best);
        }
        let level = best * (1.0 + STEP);
        let Some(crossings) = crossings(system, level) else {
            let value = best.max(largest(&dense_grid(&poles)));
            return Norm::unconfirmed(value, value, f64::INFINITY);
        };
        let seen = [first.as_slice(), &between(&crossings)].concat();
        let above = largest(&seen).max(-refined(|omega| -gain(omega), &seen));
        if !(above > level) {
            return Norm::proven(best, best, level);
        }
        best = above;
    }
    Norm::unconfirmed(best, best, f64::INFINITY)
}

/// ‖G‖∞ over the unit circle of a discrete-time system; infinite if it is not stable.
pub fn h_infinity_discrete(system: &System) -> Norm {
    match system.bilinear() {
        Some(continuous) => h_infinity_continuous(&continuous),
        None => Norm::infinite(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;

    /// σ_max on a grid of the unit circle.
    fn on_grid(system: &System) -> f64 {
        (0..20_000).fold(0.0, |most, i| {
            let point = nalgebra::Complex::from_polar(1.0, f64::from(i) / 20_000.0 * std::f64::consts::PI);
            system.gains_at(point).map_or(most, |gains| gains.1.max(most))
        })
    }

    /// Discrete systems whose largest gain is so flat that rounding drives the crossings off the axis.
    #[test]
    fn a_flat_peak_is_not_missed() {
        let flat = [
            System::new(
                &DMatrix::from_column_slice(
                    2,
                    2,
                    &[
                        0.6443144779523694,
                        -0.20688778951953618,
                        0.12286849276177302,
                        1.0266513283361578,
                    ],
                ),
                &DMatrix::from_column_slice(
                    2,
                    2,
                    &[
                        0.0664577024029786,
                        0.008015879598244477,
                        0.07415601662827961,
                        0.09356542889832035,
                    ],
                ),
                &DMatrix::from_column_slice(
                    2,
                    2,
                    &[
                        -0.8810637297647173,
                        0.0580475603375592,
                        -0.4259552064075973,
                        -0.35775434215832824,
                    ],
                ),
                &DMatrix::from_column_slice(
                    2,
                    2,
                    &[
                        -0.11969725426267641,
                        -0.07399361229715518,
                        0.4620518777638123,
                        0.29340306756333967,
                    ],
                ),
            ),
            System::new(
                &DMatrix::from_column_slice(
                    4,
                    4,
                    &[
                        0.8054172251822033,
                        0.06754463586086365,
                        -0.10638603256586757,
                        0.20950335815358298,
                        0.036527104393207034,
                        0.7866166541587378,
                        -0.2350225042665563,
                        0.19208175752585893,
                        0.045407258591966315,
                        0.08289514238445896,
                        1.07219279848313,
                        0.23733408761389993,
                        -0.07031234341555362,
                        -0.03953522029911635,
                        -0.11618020656496064,
                        0.7863445183241617,
                    ],
                ),
                &DMatrix::from_column_slice(
                    4,
                    2,
                    &[
                        0.057435625131424584,
                        -0.02744528589472381,
                        -0.0408404836969821,
                        0.04507543069616672,
                        -0.05380925017543167,
                        0.019557659819816685,
                        -0.03522018226566473,
                        -0.07100311793690675,
                    ],
                ),
                &DMatrix::from_column_slice(
                    3,
                    4,
                    &[
                        0.7219525195805119,
                        -0.5430513029761155,
                        -0.7667793687084252,
                        0.9786524769162313,
                        -0.22674578489263242,
                        -0.9143957030427048,
                        -0.34944375369792136,
                        -0.9762537257777955,
                        0.9035462534149068,
                        -0.9293349691673054,
                        0.8607788063813948,
                        -0.6204337781491267,
                    ],
                ),
                &DMatrix::from_column_slice(
                    3,
                    2,
                    &[
                        -0.3017622982326731,
                        -0.4333748881573425,
                        0.28662898658116687,
                        -0.4680321092218347,
                        -0.21213199512270453,
                        0.3899463764229265,
                    ],
                ),
            ),
        ];
        for system in &flat {
            let (norm, grid) = (h_infinity_discrete(system), on_grid(system));
            assert!(
                norm.confirmed && norm.value >= grid * (1.0 - 1e-12),
                "{norm:?} {grid}"
            );
            assert!(norm.value <= grid * (1.0 + 1e-5), "{norm:?} {grid}");
        }
    }
}
