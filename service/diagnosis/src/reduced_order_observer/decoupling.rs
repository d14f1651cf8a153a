//! All gains that keep an unknown input out of z2 (method sheet 3.1, 3.2).
//!
//! K U1 + U2 = 0 has the solutions K = K0 + Y V_s' with K0 = -U2 U1⁺ and V_s an orthonormal basis of null(U1'),
//! and F = Ab + Y c with Ab = A22 + K0 A12, c = V_s' A12. The main observer has U = D.

use super::{
    error::ConstructionError,
    plant::{Plant, RANK_TOLERANCE},
};
use crate::{
    decomposition::{SingularDecomposition, eigenvalues},
    spectrum::observability_gap,
};
use nalgebra::{Complex, DMatrix};

/// An eigenvalue of Ab below this gap, relative to max(1, |Ab|, |c|), is an invariant zero.
const ZERO_TOLERANCE: f64 = 1e-7;
/// Zeros of this modulus and above are unstable.
const UNSTABLE: f64 = 1.0 - 1e-9;

/// The gains that decouple z2 from the columns of U.
#[derive(Clone, Debug, PartialEq)]
pub struct Decoupling {
    /// C U, p x qu, of full column rank.
    pub u1: DMatrix<f64>,
    /// N_c' U, nz x qu.
    pub u2: DMatrix<f64>,
    /// U1⁺, qu x p.
    pub u1_inverse: DMatrix<f64>,
    /// K0 = -U2 U1⁺, nz x p.
    pub k0: DMatrix<f64>,
    /// V_s, p x (p - qu).
    pub free: DMatrix<f64>,
    /// Ab = A22 + K0 A12, nz x nz.
    pub a_bar: DMatrix<f64>,
    /// c = V_s' A12, (p - qu) x nz.
    pub c: DMatrix<f64>,
    /// The invariant zeros from U to y, all inside the unit circle.
    pub zeros: Vec<Complex<f64>>,
}

impl Decoupling {
    /// Whether there is more than one decoupling gain; else it is K0.
    pub fn has_choice(&self) -> bool {
        self.k0.nrows() > 0 && self.free.ncols() > 0
    }

    /// Checks the assumptions of method sheet 3.1 for the unknown inputs `u` (n x qu, in x').
    ///
    /// # Errors
    /// [`ConstructionError`]: rank deficient, not matched, unstable zero.
    pub fn new(plant: &Plant, u: &DMatrix<f64>) -> Result<Self, ConstructionError> {
        let (p, nz, inputs) = (plant.outputs(), plant.hidden(), u.ncols());
        let original = SingularDecomposition::new(&(&plant.inverse * u));
        let (smallest, largest) = (original.smallest(), original.largest());
        if inputs > 0 && smallest <= RANK_TOLERANCE * largest {
            return Err(ConstructionError::DisturbanceMatrixRankDeficient { smallest, largest });
        }
        let (u1, u2) = (u.rows(0, p).into_owned(), u.rows(p, nz).into_owned());
        let matched = SingularDecomposition::new(&u1);
        let output_norm = SingularDecomposition::new(&plant.c.transpose()).largest();
        let limit = RANK_TOLERANCE * output_norm * largest;
        if inputs > 0 && matched.smallest() <= limit {
            return Err(ConstructionError::DisturbanceNotMatched {
                inputs,
                outputs: p,
                smallest: matched.smallest(),
                limit,
            });
        }
        let u1_inverse = matched
            .left_inverse(0.0)
            .unwrap_or_else(|| DMatrix::zeros(inputs, p));
        let free =
            SingularDecomposition::new(&u1.transpose()).null_space(matched.smallest().min(largest) / 2.0);
        let [_, a12, _, a22] = plant.blocks();
        let k0 = -&u2 * &u1_inverse;
        let mut decoupling = Self {
            a_bar: a22 + &k0 * &a12,
            c: free.tr_mul(&a12),
            u1,
            u2,
            u1_inverse,
            k0,
            free,
            zeros: Vec::new(),
        };
        decoupling.zeros = decoupling.invariant_zeros()?;
        match decoupling.zeros.iter().find(|zero| zero.norm() >= UNSTABLE) {
            Some(zero) => Err(ConstructionError::UnstableInvariantZero {
                re: zero.re,
                im: zero.im,
            }),
            None => Ok(decoupling),
        }
    }

    /// The unobservable modes of (Ab, c): λ with σ_min \[λI - Ab; c\] <= 1e-7 max(1, |Ab|, |c|).
    fn invariant_zeros(&self) -> Result<Vec<Complex<f64>>, ConstructionError> {
        let norm = |matrix: &DMatrix<f64>| SingularDecomposition::new(matrix).largest();
        let limit = ZERO_TOLERANCE * norm(&self.a_bar).max(norm(&self.c)).max(1.0);
        let modes = eigenvalues(&self.a_bar)
            .ok_or(ConstructionError::EigenvaluesNotFound { what: "A22 + K0 A12" })?;
        Ok(modes
            .into_iter()
            .filter(|&mode| observability_gap(&self.a_bar, &self.c, mode).smallest <= limit)
            .collect())
    }

    /// The gain nearest to `k` that decouples exactly: K - (K U1 + U2) U1⁺ (method sheet 3.6, 2).
    pub fn project(&self, k: &DMatrix<f64>) -> DMatrix<f64> {
        let once = k - (k * &self.u1 + &self.u2) * &self.u1_inverse;
        // Once more for a large K, whose first projection leaves rounding behind.
        &once - (&once * &self.u1 + &self.u2) * &self.u1_inverse
    }

    /// The largest entry of |K U1 + U2|.
    pub fn rest(&self, k: &DMatrix<f64>) -> f64 {
        (k * &self.u1 + &self.u2).amax()
    }

    /// 1e-12 (1 + |K||U1| + |U2|): what rounding may leave of K U1 + U2.
    pub fn allowed_rest(&self, k: &DMatrix<f64>) -> f64 {
        1e-12 * (1.0 + k.norm() * self.u1.norm() + self.u2.norm())
    }

    /// Whether K U1 + U2 vanishes up to rounding.
    pub fn is_decoupled(&self, k: &DMatrix<f64>) -> bool {
        let allowed = self.allowed_rest(k);
        allowed.is_finite() && self.rest(k) <= allowed
    }
}
