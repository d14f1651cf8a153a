//! A Lyapunov certificate of accepted gains (method sheet 3.6, paper equations (2) and (4)).
//!
//! P = T' diag(δ S0, P2) T with M'S0 M - S0 = -I and F'P2 F - P2 = -I, T L = \[-N; -J\]; δ is lowered until
//! (A + L C)'P(A + L C) - P is negative definite. All in the coordinates x' = T_c x.

use super::{
    observer::Observer,
    plant::{Plant, beside, stack},
};
use nalgebra::{DMatrix, SymmetricEigen};

/// Steps of the doubling iteration: 2^60 terms of the series.
const DOUBLINGS: usize = 60;
/// Smallest δ tried.
const SMALLEST_DELTA: f64 = 1e-12;

/// P and L with P > 0, (A + L C)'P(A + L C) - P < 0 and D'P N_c = 0.
#[derive(Clone, Debug, PartialEq)]
pub struct Certificate {
    /// δ, the weight of the measured part.
    pub delta: f64,
    /// P, n x n.
    pub p: DMatrix<f64>,
    /// L, n x p.
    pub l: DMatrix<f64>,
    /// Largest eigenvalue of (A + L C)'P(A + L C) - P, negative.
    pub decrease: f64,
}

impl Certificate {
    /// The certificate of an observer; `None` if F or M is not Schur, or nearly so.
    pub fn new(plant: &Plant, observer: &Observer) -> Option<Self> {
        let (n, p, nz) = (plant.states(), plant.outputs(), plant.hidden());
        let upper = lyapunov(&observer.m)?;
        let lower = lyapunov(&observer.f)?;
        let t = stack(
            &DMatrix::identity(p, n),
            &beside(&observer.k, &DMatrix::identity(nz, nz)),
        );
        let noise = observer.noise_input();
        // T⁻¹ = [[I, 0], [-K, I]].
        let l = -stack(
            &noise.rows(0, p).into_owned(),
            &(noise.rows(p, nz) - &observer.k * noise.rows(0, p)),
        );
        let mut closed = plant.a.clone();
        let mut measured = closed.columns_mut(0, p);
        measured += &l;
        let mut delta = 0.1;
        while delta >= SMALLEST_DELTA {
            let weight = stack(
                &beside(&(&upper * delta), &DMatrix::zeros(p, nz)),
                &beside(&DMatrix::zeros(nz, p), &lower),
            );
            let p_matrix = t.transpose() * weight * &t;
            let difference = closed.transpose() * &p_matrix * &closed - &p_matrix;
            let decrease = largest_eigenvalue(&difference)?;
            if decrease < 0.0 {
                return Some(Self {
                    delta,
                    p: p_matrix,
                    l,
                    decrease,
                });
            }
            delta /= 10.0;
        }
        None
    }
}

/// Largest eigenvalue of the symmetric part; `None` if the iteration does not converge.
fn largest_eigenvalue(matrix: &DMatrix<f64>) -> Option<f64> {
    const ITERATIONS: usize = 10_000;
    let symmetric = (matrix + matrix.transpose()) / 2.0;
    Some(
        SymmetricEigen::try_new(symmetric, f64::EPSILON, ITERATIONS)?
            .eigenvalues
            .max(),
    )
}

/// S with X'S X - S = -I, the sum of (X')^k X^k by doubling; `None` if it does not converge.
fn lyapunov(x: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let mut sum = DMatrix::identity(x.nrows(), x.nrows());
    let mut power = x.clone();
    for _ in 0..DOUBLINGS {
        let added = power.transpose() * &sum * &power;
        let (change, size) = (added.amax(), sum.amax());
        sum += added;
        if change <= f64::EPSILON * size {
            return Some(sum);
        }
        power = &power * &power;
        if !power.iter().all(|value| value.is_finite()) {
            return None;
        }
    }
    None
}
