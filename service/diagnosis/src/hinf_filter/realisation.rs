//! Sampled forms of the continuous filter x̂' = A x̂ + B u + H (y - ŷ), Ah = A - HC (method sheet 3.3).
//!
//! They leak the command into the residual, the hold of first order with its square of the period, that of zeroth
//! order with the period; the discrete observer does not.

use super::plant::{Plant, beside, zoh};
use crate::discretise::matrix_exponential;
use nalgebra::DMatrix;

/// x̂⁺ = Φ x̂ + Gu u_k + Gy y_k: everything held over the period.
#[derive(Clone, Debug, PartialEq)]
pub struct ZeroOrderFilter {
    /// Φ, n x n.
    pub phi: DMatrix<f64>,
    /// Gu, n x p.
    pub gu: DMatrix<f64>,
    /// Gy, n x q.
    pub gy: DMatrix<f64>,
}

/// x̂⁺ = Φ x̂ + Gu u_k + G0 y_k + G1 y_{k+1}: y linear between the samples.
#[derive(Clone, Debug, PartialEq)]
pub struct FirstOrderFilter {
    /// Φ, n x n.
    pub phi: DMatrix<f64>,
    /// Gu, n x p.
    pub gu: DMatrix<f64>,
    /// G0, n x q.
    pub g0: DMatrix<f64>,
    /// G1, n x q.
    pub g1: DMatrix<f64>,
}

/// The filter with zero-order hold, \[Φ, Gu, Gy\] = zero-order-hold images of (Ah, \[B - HD, H\]).
pub fn filter_zoh(plant: &Plant, gain: &DMatrix<f64>, sample_time_s: f64) -> ZeroOrderFilter {
    let p = plant.b.ncols();
    let closed = &plant.a - gain * &plant.c;
    let inputs = beside(&[&(&plant.b - gain * &plant.d), gain]);
    let (phi, held) = zoh(&closed, &inputs, sample_time_s);
    ZeroOrderFilter {
        phi,
        gu: held.columns(0, p).into_owned(),
        gy: held.columns(p, gain.ncols()).into_owned(),
    }
}

/// The filter with first-order hold: with F = expm(\[Ah, H, 0; 0, 0, I; 0, 0, 0\] Ts), G1 = F13/Ts and G0 = F12 - G1.
pub fn filter_foh(plant: &Plant, gain: &DMatrix<f64>, sample_time_s: f64) -> FirstOrderFilter {
    let ZeroOrderFilter { phi, gu, gy } = filter_zoh(plant, gain, sample_time_s);
    let (n, q) = gain.shape();
    let mut augmented = DMatrix::zeros(n + 2 * q, n + 2 * q);
    augmented
        .view_mut((0, 0), (n, n))
        .copy_from(&((&plant.a - gain * &plant.c) * sample_time_s));
    augmented
        .view_mut((0, n), (n, q))
        .copy_from(&(gain * sample_time_s));
    // The chain of integrators runs in periods, not in seconds: F13 is then G1 itself.
    augmented
        .view_mut((n, n + q), (q, q))
        .copy_from(&DMatrix::identity(q, q));
    let g1 = matrix_exponential(&augmented)
        .view((0, n + q), (n, q))
        .into_owned();
    FirstOrderFilter {
        phi,
        gu,
        g0: gy - &g1,
        g1,
    }
}
