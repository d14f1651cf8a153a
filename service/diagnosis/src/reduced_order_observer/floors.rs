//! Which constant faults raise an alarm whatever disturbance and noise do (method sheet 3.6).
//!
//! g_j(k) is the response of y - ẑ1 to a unit step of the fault of actuator j: g(0) = 0, ε⁺ = A_e ε + \[B1; E_z\]_j.
//! A constant f_j alarms in row w at k if |w'g_j(k)| |f_j| > 2 t_inf(w).

use super::observer::Observer;
use nalgebra::{DMatrix, DVector};

/// Samples after the onset that are looked at.
const HORIZON: usize = 200;

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

/// The smallest 2 `steady`(w) / |w'g_j(k)| over the rows w of `tests` and all k: entry j; infinite if no row ever
/// sees the fault.
pub fn fault_floors(observer: &Observer, tests: &DMatrix<f64>, steady: &DVector<f64>) -> DVector<f64> {
    DVector::from_fn(observer.input.ncols(), |actuator, _| {
        step_response(observer, actuator)
            .iter()
            .flat_map(|g| (tests * g).iter().zip(steady).map(ratio).collect::<Vec<_>>())
            .fold(f64::INFINITY, f64::min)
    })
}

fn ratio((seen, half_width): (&f64, &f64)) -> f64 {
    if *seen == 0.0 {
        f64::INFINITY
    } else {
        2.0 * half_width / seen.abs()
    }
}

/// Samples from the onset of a constant fault until its alarm is certain, if it is within 200.
pub fn guaranteed_delay(
    observer: &Observer,
    tests: &DMatrix<f64>,
    steady: &DVector<f64>,
    actuator: usize,
    fault: f64,
) -> Option<usize> {
    step_response(observer, actuator).iter().position(|g| {
        let seen = tests * g;
        seen.iter()
            .zip(steady)
            .any(|(seen, half_width)| seen.abs() * fault.abs() > 2.0 * half_width)
    })
}
