//! What white measurement noise adds to the thresholds (method sheet 3.7).

use super::constants::ErrorFilter;
use nalgebra::{DMatrix, DVector};

/// Standard deviations of the bounds: peak and window energy.
const PEAK_DEVIATIONS: f64 = 6.0;
const ENERGY_DEVIATIONS: f64 = 5.0;

/// What white measurement noise adds.
#[derive(Clone, Debug, PartialEq)]
pub struct NoiseBound {
    /// ρ_n = 6 √diag(c₀), of every row.
    pub peak: DVector<f64>,
    /// J_n, of the tested rows.
    pub energy: f64,
}

impl NoiseBound {
    /// The bound for standard deviations `noise` (q) in a window of `window` samples; `None` if the filter is not
    /// stable.
    pub fn new(
        filter: ErrorFilter<'_>,
        noise: &DVector<f64>,
        window: usize,
        tested: usize,
        sample_time_s: f64,
    ) -> Option<Self> {
        let (a, l) = (filter.closed, filter.gain);
        let covariance = DMatrix::from_diagonal(&noise.component_mul(noise));
        let state = crate::lyapunov::discrete(a, &(l * &covariance * l.transpose()))?;
        let output = filter.v * filter.c;
        let present = &output * &state * output.transpose() + filter.v * &covariance * filter.v.transpose();
        let peak = present
            .diagonal()
            .map(|value| PEAK_DEVIATIONS * value.max(0.0).sqrt());
        let select = |matrix: &DMatrix<f64>| matrix.view((0, 0), (tested, tested)).into_owned();
        let present = select(&present);
        let mut carried = (a * &state * filter.c.transpose() - l * &covariance) * filter.v.transpose();
        let mut sum = window as f64 * present.norm_squared();
        for k in 1..window {
            let correlation = select(&(&output * &carried));
            sum += 2.0 * (window - k) as f64 * correlation.norm_squared();
            carried = a * carried;
        }
        let mean = sample_time_s * window as f64 * present.trace();
        let variance = 2.0 * sample_time_s * sample_time_s * sum;
        Some(Self {
            peak,
            energy: (mean + ENERGY_DEVIATIONS * variance.sqrt()).sqrt(),
        })
    }
}
