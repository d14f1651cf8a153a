//! Decoupling gains with chosen eigenvalues of F, without a solver (method sheet 3.2).

use super::decoupling::Decoupling;
use crate::decomposition::SingularDecomposition;
use nalgebra::{DMatrix, DVector};

/// Rank tolerance of c, relative to the norm of A12 that it comes from.
const RANK_TOLERANCE: f64 = 1e-9;
/// Above this condition number of the observability matrix poles are not placed exactly.
const CONDITION_LIMIT: f64 = 1e12;
/// Relative change at which the Riccati iteration has converged.
const CONVERGED: f64 = 1e-13;
/// Limit of its steps.
const ITERATIONS: usize = 100_000;

/// Why there is no closed-form gain for the wanted eigenvalues.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GainError {
    /// The Riccati rule bounds all eigenvalues of F by one number, which must exceed every zero.
    #[error(
        "F cannot be given single eigenvalues here, only a bound of their modulus, and {degree} does not exceed the \
         invariant zeros (up to {zero}); ask for a larger one"
    )]
    DegreeTooSmall {
        /// ρ.
        degree: f64,
        /// Largest modulus of the zeros.
        zero: f64,
    },
    /// The Riccati iteration did not converge.
    #[error("the Riccati iteration for |eig F| < {degree} does not converge; ask for a larger bound")]
    NotConverged {
        /// ρ.
        degree: f64,
    },
}

/// Whether K can change F at all: c has a rank.
pub fn is_free(decoupling: &Decoupling) -> bool {
    rank(decoupling) > 0
}

fn rank(decoupling: &Decoupling) -> usize {
    let scale = RANK_TOLERANCE
        * decoupling
            .a_bar
            .norm()
            .max(decoupling.c.norm())
            .max(f64::MIN_POSITIVE);
    let values = SingularDecomposition::new(&decoupling.c).sigma;
    values.iter().filter(|sigma| **sigma > scale).count()
}

/// K = K0 + Y V_s' with these eigenvalues of F (nz of them), as far as the plant permits: exactly if c has rank 1 or
/// nz, by the Riccati rule with ρ = the largest of them otherwise; K0 if c = 0.
///
/// # Errors
/// [`GainError`], from the Riccati rule.
pub fn closed_form(decoupling: &Decoupling, poles: &[f64]) -> Result<DMatrix<f64>, GainError> {
    let nz = decoupling.a_bar.nrows();
    let rank = rank(decoupling);
    if rank == 0 {
        return Ok(decoupling.k0.clone());
    }
    let gain = if rank >= nz {
        let wanted =
            DMatrix::from_diagonal(&DVector::from_fn(nz, |i, _| poles.get(i).copied().unwrap_or(0.0)));
        SingularDecomposition::new(&decoupling.c)
            .left_inverse(0.0)
            .map(|inverse| (wanted - &decoupling.a_bar) * inverse)
    } else if rank == 1 {
        ackermann(decoupling, poles)
    } else {
        None
    };
    let largest = poles.iter().fold(0.0_f64, |most, pole| most.max(pole.abs()));
    let gain = match gain {
        Some(gain) => gain,
        None => riccati(decoupling, largest)?,
    };
    Ok(&decoupling.k0 + gain * decoupling.free.transpose())
}

/// Y = -φ(Ab) O⁻¹ e_nz u', φ(s) = Π (s - pole); `None` if the observability matrix O is too ill-conditioned.
fn ackermann(decoupling: &Decoupling, poles: &[f64]) -> Option<DMatrix<f64>> {
    let nz = decoupling.a_bar.nrows();
    let svd = SingularDecomposition::new(&decoupling.c);
    let left = svd.u.column(svd.sigma.imax()).into_owned();
    let mut row = left.tr_mul(&decoupling.c);
    let mut observability = DMatrix::zeros(nz, nz);
    for i in 0..nz {
        observability.row_mut(i).copy_from(&row.row(0));
        row *= &decoupling.a_bar;
    }
    let values = SingularDecomposition::new(&observability);
    if !(values.largest() <= CONDITION_LIMIT * values.smallest()) {
        return None;
    }
    let last = DVector::from_fn(nz, |i, _| f64::from(u8::from(i + 1 == nz)));
    let direction = observability.lu().solve(&last)?;
    let polynomial = poles
        .iter()
        .fold(DMatrix::<f64>::identity(nz, nz), |product, pole| {
            product * (&decoupling.a_bar - DMatrix::identity(nz, nz) * *pole)
        });
    Some(-polynomial * direction * left.transpose())
}

/// Y with |eig F| < ρ, `degree`: a = Ab/ρ, P ← aPa' - aPc'(cPc' + I)⁻¹cPa' + I, Y = -ρ aPc'(cPc' + I)⁻¹.
pub fn riccati(decoupling: &Decoupling, degree: f64) -> Result<DMatrix<f64>, GainError> {
    let zero = decoupling
        .zeros
        .iter()
        .fold(0.0_f64, |most, zero| most.max(zero.norm()));
    if !(degree > zero) {
        return Err(GainError::DegreeTooSmall { degree, zero });
    }
    let nz = decoupling.a_bar.nrows();
    let a = &decoupling.a_bar / degree;
    let c = &decoupling.c;
    let identity = DMatrix::<f64>::identity(c.nrows(), c.nrows());
    let gain = |p: &DMatrix<f64>| {
        let weight = c * p * c.transpose() + &identity;
        Some((weight.cholesky()?.solve(&(c * p * a.transpose()))).transpose())
    };
    let mut p = DMatrix::identity(nz, nz);
    for _ in 0..ITERATIONS {
        let l = gain(&p).ok_or(GainError::NotConverged { degree })?;
        let mut next = &a * &p * a.transpose() - &l * c * &p * a.transpose() + DMatrix::identity(nz, nz);
        next = (&next + next.transpose()) / 2.0;
        let change = (&next - &p).amax();
        let size = next.amax();
        p = next;
        if !size.is_finite() {
            break;
        }
        if change <= CONVERGED * size {
            let l = gain(&p).ok_or(GainError::NotConverged { degree })?;
            return Ok(l * -degree);
        }
    }
    Err(GainError::NotConverged { degree })
}
