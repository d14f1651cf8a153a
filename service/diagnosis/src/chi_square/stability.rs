//! Which modes make the plain state test blind, and whether the filter converges (method sheet 3).
//!
//! The state is scaled by σ_i = sqrt((Σ_{j=0}^{n} Φ^j (G G' + P_0) Φ^j')_ii), every row of H by its norm, so that
//! the tests do not depend on units.

use crate::{
    decomposition::eigenvalues,
    spectrum::{controllability_gap, observability_gap},
};
use nalgebra::{Complex, DMatrix};

/// Relative tolerance of the rank tests.
const RANK_TOLERANCE: f64 = 1e-9;
/// How near to 1 the modulus of an eigenvalue counts as 1.
const MARGIN: f64 = 1e-6;

/// What the stability guard says of the plain state test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GuardVerdict {
    /// Every excited and observable mode decays.
    Accepted,
    /// One neither decays nor grows.
    RefusedMarginal,
    /// One grows.
    RefusedUnstable,
    /// A mode that does not decay is excited but not observable: no filter converges.
    ErrorUndetectable,
}

impl GuardVerdict {
    /// For messages and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Accepted => "accepted",
            Self::RefusedMarginal => "refused_marginal",
            Self::RefusedUnstable => "refused_unstable",
            Self::ErrorUndetectable => "error_undetectable",
        }
    }
}

/// The modes of a model.
#[derive(Clone, Debug, PartialEq)]
pub struct Stability {
    /// Of the plain state test.
    pub verdict: GuardVerdict,
    /// Largest modulus of all eigenvalues.
    pub spectral_radius: f64,
    /// ρ_eff: largest modulus over the excited and observable modes.
    pub effective_spectral_radius: f64,
    /// An excited, unobservable eigenvalue that does not decay.
    pub undetectable: Option<Complex<f64>>,
}

/// Analyses the modes of Φ (n x n), excited by the columns of `excitation` (n x c: G and the factor of P_0) and
/// observed by H (m x n); `None` if the eigenvalues cannot be computed.
pub fn stability(
    transition: &DMatrix<f64>,
    excitation: &DMatrix<f64>,
    measurement: &DMatrix<f64>,
) -> Option<Stability> {
    let scale = state_scale(transition, excitation);
    let n = scale.len();
    let phi = DMatrix::from_fn(n, n, |i, j| transition[(i, j)] * scale[j] / scale[i]);
    let noise = DMatrix::from_fn(n, excitation.ncols(), |i, j| excitation[(i, j)] / scale[i]);
    let mut h = DMatrix::from_fn(measurement.nrows(), n, |i, j| measurement[(i, j)] * scale[j]);
    for mut row in h.row_iter_mut() {
        let norm = row.norm();
        if norm > 0.0 {
            row /= norm;
        }
    }
    let mut found = Stability {
        verdict: GuardVerdict::Accepted,
        spectral_radius: 0.0,
        effective_spectral_radius: 0.0,
        undetectable: None,
    };
    for eigenvalue in eigenvalues(&phi)? {
        let modulus = eigenvalue.norm();
        found.spectral_radius = found.spectral_radius.max(modulus);
        if !controllability_gap(&phi, &noise, eigenvalue).has_full_rank(RANK_TOLERANCE) {
            continue;
        }
        if observability_gap(&phi, &h, eigenvalue).has_full_rank(RANK_TOLERANCE) {
            found.effective_spectral_radius = found.effective_spectral_radius.max(modulus);
        } else if modulus >= 1.0 - MARGIN {
            found.undetectable = Some(eigenvalue);
        }
    }
    found.verdict = match found.effective_spectral_radius {
        _ if found.undetectable.is_some() => GuardVerdict::ErrorUndetectable,
        radius if radius < 1.0 - MARGIN => GuardVerdict::Accepted,
        radius if radius <= 1.0 + MARGIN => GuardVerdict::RefusedMarginal,
        _ => GuardVerdict::RefusedUnstable,
    };
    Some(found)
}

/// σ_i, 1 where it is zero.
fn state_scale(transition: &DMatrix<f64>, excitation: &DMatrix<f64>) -> Vec<f64> {
    let n = transition.nrows();
    let mut squared = vec![0.0; n];
    let mut moved = excitation.clone();
    for _ in 0..=n {
        for (squared, row) in squared.iter_mut().zip(moved.row_iter()) {
            *squared += row.norm_squared();
        }
        moved = transition * moved;
    }
    let usable = |value: f64| {
        if value > 0.0 && value.is_finite() {
            value.sqrt()
        } else {
            1.0
        }
    };
    squared.into_iter().map(usable).collect()
}

/// The matrices side by side.
pub(super) fn beside(left: &DMatrix<f64>, right: &DMatrix<f64>) -> DMatrix<f64> {
    let columns = left.ncols();
    DMatrix::from_fn(left.nrows(), columns + right.ncols(), |i, j| {
        if j < columns {
            left[(i, j)]
        } else {
            right[(i, j - columns)]
        }
    })
}

/// One upon the other.
pub(super) fn above(upper: &DMatrix<f64>, lower: &DMatrix<f64>) -> DMatrix<f64> {
    beside(&upper.transpose(), &lower.transpose()).transpose()
}
