//! A Lyapunov certificate of accepted gains (method sheet 3.6, paper equations (2) and (4)).
//!
//! P = T' diag(δ S0, P2) T with M'S0 M - S0 = -I and F'P2 F - P2 = -I, T L = \[-N; -J\]; δ is lowered until
//! (A + L C)'P(A + L C) - P is negative definite. All in the coordinates x' = T_c x, in which N_c = \[0; I\].

use super::{
    observer::Observer,
    plant::{Plant, beside, stack},
};
use crate::{decomposition::SymmetricDecomposition, lyapunov::discrete};
use nalgebra::DMatrix;

/// Smallest δ tried.
const SMALLEST_DELTA: f64 = 1e-12;
/// Relative to |P| (and |D|): what rounding may add to an equality.
const EQUALITY: f64 = 1e-9;

/// P with P > 0, (A + L C)'P(A + L C) - P < 0 and D'P N_c = 0.
#[derive(Clone, Debug, PartialEq)]
pub struct Certificate {
    /// P, n x n.
    pub p: DMatrix<f64>,
    /// L, n x p.
    pub l: DMatrix<f64>,
    /// Smallest eigenvalue of P, positive.
    pub smallest: f64,
    /// Largest eigenvalue of (A + L C)'P(A + L C) - P, negative.
    pub decrease: f64,
}

impl Certificate {
    /// The largest δ = 0.1, 0.01, ... that gives a certificate of an observer, and that certificate; `None` if F or M
    /// is not Schur, or nearly so.
    pub fn find(plant: &Plant, observer: &Observer) -> Option<(f64, Self)> {
        let (n, p, nz) = (plant.states(), plant.outputs(), plant.hidden());
        let lyapunov = |x: &DMatrix<f64>| discrete(&x.transpose(), &DMatrix::identity(x.nrows(), x.nrows()));
        let (upper, lower) = (lyapunov(&observer.m)?, lyapunov(&observer.f)?);
        let t = stack(
            &DMatrix::identity(p, n),
            &beside(&observer.k, &DMatrix::identity(nz, nz)),
        );
        let mut delta = 0.1;
        while delta >= SMALLEST_DELTA {
            let weight = stack(
                &beside(&(&upper * delta), &DMatrix::zeros(p, nz)),
                &beside(&DMatrix::zeros(nz, p), &lower),
            );
            let found = t.transpose() * weight * &t;
            let symmetric = (&found + found.transpose()) / 2.0;
            if let Ok(certificate) = Self::verify(plant, observer, symmetric) {
                return Some((delta, certificate));
            }
            delta /= 10.0;
        }
        None
    }

    /// Whether P certifies an observer; the violated condition otherwise.
    ///
    /// # Errors
    /// The condition in words, with its value.
    pub fn verify(plant: &Plant, observer: &Observer, p: DMatrix<f64>) -> Result<Self, String> {
        let (size, outputs, nz) = (p.amax(), plant.outputs(), plant.hidden());
        let asymmetry = (&p - p.transpose()).amax();
        if !(asymmetry <= EQUALITY * size) {
            return Err(format!("P must be symmetric, P - P' reaches {asymmetry:e}"));
        }
        let smallest = SymmetricDecomposition::new(&p).smallest();
        if !(smallest > 0.0) {
            return Err(format!(
                "P must be positive definite, its smallest eigenvalue is {smallest:e}"
            ));
        }
        let coupling = plant.d.tr_mul(&p).columns(outputs, nz).amax();
        if !(coupling <= EQUALITY * size * plant.d.norm()) {
            return Err(format!("D'P N_c must vanish, it reaches {coupling:e}"));
        }
        // T⁻¹ = [[I, 0], [-K, I]].
        let noise = observer.noise_input();
        let (n, j) = (noise.rows(0, outputs).into_owned(), noise.rows(outputs, nz));
        let l = -stack(&n, &(j - &observer.k * &n));
        let mut closed = plant.a.clone();
        let mut measured = closed.columns_mut(0, outputs);
        measured += &l;
        let difference = closed.transpose() * &p * &closed - &p;
        let decrease = -SymmetricDecomposition::new(&-difference).smallest();
        if !(decrease < 0.0) {
            return Err(format!(
                "(A + L C)'P(A + L C) - P must be negative definite, its largest eigenvalue is {decrease:e}"
            ));
        }
        Ok(Self {
            p,
            l,
            smallest,
            decrease,
        })
    }
}
