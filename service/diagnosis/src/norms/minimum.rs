//! The H₋ index: the smallest singular value over all frequencies, or over a band.

use super::{
    Norm,
    frequency::{between, candidates, crossings, dense_grid, golden_section, log_spaced, refined},
    system::System,
};
use crate::decomposition::eigenvalues;

/// How far below the smallest gain the level lies that nothing may cross.
const STEP: f64 = 2e-9;
/// The search ends in about four rounds.
const ROUNDS: usize = 60;
/// Below this part of the largest gain the index counts as 0: a zero on the imaginary axis.
const ZERO: f64 = 1e-13;
/// Grid of a finite band, and its cells that are refined.
const BAND_POINTS: usize = 400;
const REFINED: usize = 6;

/// ‖G‖₋ = inf over ω of σ_min G(jω) of a continuous-time system, or over 0 <= ω <= `band` (rad/s).
///
/// It is 0 with more inputs than outputs. Without a band the infimum includes ω = ∞, that is σ_min(D).
pub fn h_minus_continuous(system: &System, band: Option<f64>) -> Norm {
    if system.b.ncols() > system.c.nrows() {
        return Norm::proven(0.0, 0.0, 0.0);
    }
    match band {
        Some(edge) => over_band(system, edge),
        None => over_all(system),
    }
}

/// ‖G‖₋ over the unit circle, or over the angles 0 to `band` (rad per sample, below π).
pub fn h_minus_discrete(system: &System, band: Option<f64>) -> Norm {
    match system.bilinear() {
        Some(continuous) => h_minus_continuous(&continuous, band.map(|angle| (angle / 2.0).tan())),
        None => Norm::unconfirmed(0.0, 0.0, f64::INFINITY),
    }
}

fn smallest_gain(system: &System, omega: f64) -> f64 {
    system.gains(omega).map_or(f64::INFINITY, |gains| gains.0)
}

fn over_all(system: &System) -> Norm {
    let smallest = |frequencies: &[f64]| {
        frequencies
            .iter()
            .map(|omega| smallest_gain(system, *omega))
            .fold(f64::INFINITY, f64::min)
    };
    let Some(poles) = eigenvalues(&system.a) else {
        return Norm::unconfirmed(0.0, 0.0, f64::INFINITY);
    };
    let first = candidates(&poles);
    let largest = first
        .iter()
        .filter_map(|omega| system.gains(*omega))
        .map(|gains| gains.1)
        .fold(0.0, f64::max);
    let mut best = smallest(&first);
    for _ in 0..ROUNDS {
        if best <= ZERO * largest {
            return Norm::proven(0.0, 0.0, best);
        }
        let level = best * (1.0 - STEP);
        let Some(crossings) = crossings(system, level) else {
            let value = best.min(smallest(&dense_grid(&poles)));
            return Norm::unconfirmed(value, 0.0, value);
        };
        let seen = [first.as_slice(), &between(&crossings)].concat();
        let below = smallest(&seen).min(refined(|omega| smallest_gain(system, omega), &seen));
        if !(below < level) {
            return Norm::proven(best, level, best);
        }
        best = below;
    }
    Norm::unconfirmed(best, 0.0, best)
}

/// A grid with both ends, and a golden-section search in the best cells.
fn over_band(system: &System, edge: f64) -> Norm {
    let mut frequencies = vec![0.0];
    frequencies.extend(log_spaced(edge * 1e-6, edge, BAND_POINTS));
    let gains: Vec<f64> = frequencies
        .iter()
        .map(|omega| smallest_gain(system, *omega))
        .collect();
    let mut order: Vec<usize> = (0..frequencies.len()).collect();
    order.sort_by(|i, j| gains[*i].total_cmp(&gains[*j]));
    let value = order.iter().take(REFINED).fold(gains[order[0]], |best, &i| {
        let low = frequencies[i.saturating_sub(1)];
        let high = frequencies[(i + 1).min(frequencies.len() - 1)];
        best.min(golden_section(|omega| smallest_gain(system, omega), low, high))
    });
    Norm::unconfirmed(value, 0.0, value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::dmatrix;

    #[test]
    fn the_band_excludes_the_roll_off_of_a_strictly_proper_system() {
        let one = dmatrix![1.0];
        let lag = System::new(&dmatrix![-1.0], &one, &one, &dmatrix![0.0]);
        assert_eq!(h_minus_continuous(&lag, None).value, 0.0);
        let at_edge = h_minus_continuous(&lag, Some(2.0)).value;
        assert!((at_edge - 1.0 / 5.0_f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn the_band_search_finds_a_notch_between_two_grid_points() {
        // (s² + 0.02 s + 1)/(s² + 2 s + 1) is 0.01 at ω = 1.
        let notch = System::new(
            &dmatrix![0.0, 1.0; -1.0, -2.0],
            &dmatrix![0.0; 1.0],
            &dmatrix![0.0, -1.98],
            &dmatrix![1.0],
        );
        assert!((h_minus_continuous(&notch, Some(50.0)).value - 0.01).abs() < 1e-9);
        assert!((h_minus_continuous(&notch, None).value - 0.01).abs() < 1e-9);
    }

    #[test]
    fn more_inputs_than_outputs_have_the_index_zero() {
        let wide = System::new(
            &dmatrix![-1.0],
            &dmatrix![1.0, 2.0],
            &dmatrix![1.0],
            &dmatrix![1.0, 0.0],
        );
        assert_eq!(h_minus_continuous(&wide, None).value, 0.0);
    }
}
