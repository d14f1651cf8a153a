//! What lost samples leave behind (method sheet 3.7).

use super::constants::ErrorFilter;
use crate::spectrum::spectral_radius;
use nalgebra::DMatrix;

/// The envelope is complete when nothing later can exceed it by this part.
const ENVELOPE: f64 = 1e-15;
/// Longest response that an envelope is taken over.
const LONGEST: usize = 4_000_000;

/// What a lost sample leaves in the residual: |V C Acᵗ L V⁻¹|_ij <= c_ij r_gᵗ.
#[derive(Clone, Debug, PartialEq)]
pub struct GapEnvelope {
    /// r_g, between the spectral radius of Ac and 1.
    pub rate: f64,
    /// c, rows x rows.
    pub envelope: DMatrix<f64>,
}

impl GapEnvelope {
    /// The envelope of a filter whose residual gives r back by `inverse` (q x rows); `None` if it does not decay.
    pub fn new(filter: ErrorFilter<'_>, inverse: &DMatrix<f64>) -> Option<Self> {
        let radius = spectral_radius(filter.closed)?;
        let rate = if radius < 0.25 {
            radius.sqrt().max(0.05)
        } else {
            radius + 0.25 * (1.0 - radius)
        };
        let scaled = filter.closed / rate;
        let output = filter.v * filter.c;
        let mut response = filter.gain * inverse;
        let start = row_sums(&output) * response.amax();
        let mut power = DMatrix::<f64>::identity(scaled.nrows(), scaled.ncols());
        let mut envelope = (&output * &response).abs();
        let mut largest_power = 1.0_f64;
        for _ in 0..LONGEST {
            response = &scaled * response;
            power = &scaled * power;
            let present = (&output * &response).abs();
            envelope = envelope.zip_map(&present, f64::max);
            let norm = row_sums(&power);
            largest_power = largest_power.max(norm);
            // Every later power is a product of this one and an earlier one.
            if norm * largest_power * start <= ENVELOPE * envelope.amax().max(f64::MIN_POSITIVE)
                || start == 0.0
            {
                return Some(Self { rate, envelope });
            }
            if !norm.is_finite() {
                return None;
            }
        }
        None
    }
}

/// Largest row sum of the absolute values.
fn row_sums(matrix: &DMatrix<f64>) -> f64 {
    matrix
        .row_iter()
        .map(|row| row.iter().map(|value| value.abs()).sum())
        .fold(0.0, f64::max)
}
