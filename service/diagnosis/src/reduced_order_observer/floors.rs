//! Which constant faults raise an alarm whatever disturbance and noise do (method sheet 3.6).
//!
//! g_j(k) is the response of y - ẑ1 to a unit step of the fault of actuator j: g(0) = 0, ε⁺ = A_e ε + \[B1; E_z\]_j.
//! A constant f_j alarms in row w at k if |w'g_j(k)| |f_j| > 2 t_inf(w).

use super::observer::Observer;
use nalgebra::{DMatrix, DVector};

/// Samples after the onset that are looked at.
const HORIZON: usize = 200;
/// A row that sees less than this share of the largest response sees rounding.
const UNSEEN: f64 = 1e-12;

/// g_j(k) for k = 0, ..., 200.
pub fn step_response(observer: &Observer, actuator: usize) -> Vec<DVector<f64>> {
    let p = observer.m.nrows();
    let input = observer.input.column(actuator);
    let mut error = DVector::zeros(observer.a_e.nrows());
    let mut response = Vec::with_capacity(HORIZON + 1);
    for _ in 0..=HORIZON {
        response.push(error.rows(0, p).into_owned());
        error = &observer.a_e * error + input;
    }
    response
}

/// For k = 0, ..., 200 samples after the onset of a constant fault of an actuator: the size from which it is certain
/// to alarm at k, the smallest 2 `steady`(w) / |w'g_j(k)| over the rows w of `tests`; infinite if no row sees it.
pub fn certain_sizes(
    observer: &Observer,
    tests: &DMatrix<f64>,
    steady: &DVector<f64>,
    actuator: usize,
) -> Vec<f64> {
    let response = step_response(observer, actuator);
    let unseen = UNSEEN * response.iter().map(|g| g.norm()).fold(0.0, f64::max);
    let sizes = response.iter().map(|g| {
        let seen = tests * g;
        let ratios = seen.iter().zip(steady).map(|(seen, half_width)| {
            if seen.abs() <= unseen {
                f64::INFINITY
            } else {
                2.0 * half_width / seen.abs()
            }
        });
        ratios.fold(f64::INFINITY, f64::min)
    });
    sizes.collect()
}

/// For every k the size from which a fault is certain to have alarmed at `consecutive` instants in a row until k, from
/// the sizes that are certain to alarm at each instant.
pub fn confirmed_sizes(sizes: &[f64], consecutive: usize) -> Vec<f64> {
    let mut smallest = f64::INFINITY;
    let confirmed = (0..sizes.len()).map(|k| {
        let window = (k + 1)
            .checked_sub(consecutive.max(1))
            .and_then(|first| sizes.get(first..=k));
        let needed = window.map_or(f64::INFINITY, |window| window.iter().copied().fold(0.0, f64::max));
        smallest = smallest.min(needed);
        smallest
    });
    confirmed.collect()
}

/// The smallest of all certain sizes, per actuator; infinite if no row ever sees the fault.
pub fn fault_floors(observer: &Observer, tests: &DMatrix<f64>, steady: &DVector<f64>) -> DVector<f64> {
    DVector::from_fn(observer.input.ncols(), |actuator, _| {
        certain_sizes(observer, tests, steady, actuator)
            .into_iter()
            .fold(f64::INFINITY, f64::min)
    })
}
