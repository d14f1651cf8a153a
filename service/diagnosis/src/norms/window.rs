//! How much energy of earlier windows a window of N samples can still see.

use crate::decomposition::SingularDecomposition;
use nalgebra::DMatrix;

/// The series of κ_j ends below this part of κ₀.
const NEGLIGIBLE: f64 = 1e-14;
/// A series that is longer is given up: the system hardly decays within a window.
const LONGEST: usize = 1_000_000;

/// The constants of a window of N samples (method sheet 3.7 of `hinf_filter`).
///
/// Wo = Σ_{k<N} A'ᵏ C'C Aᵏ, Wc = Σ_{k<N} Aᵏ EE' A'ᵏ, κ_j = σ_max(Wo^{1/2} A^{jN} Wc^{1/2}), μ = Σ_j κ_j. If every
/// window of N samples of the input has energy root <= M, that of the output is <= (γ + μ) M.
#[derive(Clone, Debug, PartialEq)]
pub struct WindowConstants {
    /// Wo, n x n.
    pub observability: DMatrix<f64>,
    /// Wc, n x n.
    pub reachability: DMatrix<f64>,
    /// κ_j until they are negligible.
    pub kappa: Vec<f64>,
    /// μ.
    pub memory: f64,
}

impl WindowConstants {
    /// The constants of (A, E, C) for `window` samples; `None` unless A is stable.
    pub fn new(a: &DMatrix<f64>, e: &DMatrix<f64>, c: &DMatrix<f64>, window: usize) -> Option<Self> {
        let (observability, reachability) = (
            gramian(&a.transpose(), &c.transpose(), window),
            gramian(a, e, window),
        );
        let (left, right) = (root(&observability), root(&reachability).transpose());
        let over_window = power(a, window);
        let mut carried = right;
        let (mut kappa, mut memory) = (Vec::new(), 0.0);
        for _ in 0..LONGEST {
            let value = SingularDecomposition::new(&(&left * &carried)).largest();
            if !value.is_finite() {
                return None;
            }
            memory += value;
            kappa.push(value);
            if value <= NEGLIGIBLE * kappa[0] {
                return Some(Self {
                    observability,
                    reachability,
                    kappa,
                    memory,
                });
            }
            carried = &over_window * carried;
        }
        None
    }
}

/// Σ_{k<N} Aᵏ BB' A'ᵏ by its terms: stays finite where a difference of two infinite Gramians would overflow.
fn gramian(a: &DMatrix<f64>, b: &DMatrix<f64>, terms: usize) -> DMatrix<f64> {
    let n = a.nrows();
    let mut sum = DMatrix::zeros(n, n);
    let mut factor = b.clone();
    let mut next = b.clone();
    for _ in 0..terms {
        sum += &factor * factor.transpose();
        a.mul_to(&factor, &mut next);
        std::mem::swap(&mut factor, &mut next);
    }
    sum
}

/// F with F'F = W for a symmetric positive semidefinite W.
fn root(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    let decomposition = SingularDecomposition::new(matrix);
    DMatrix::from_diagonal(&decomposition.sigma.map(f64::sqrt)) * decomposition.v.transpose()
}

/// Aᵏ by repeated squaring.
fn power(a: &DMatrix<f64>, mut exponent: usize) -> DMatrix<f64> {
    let n = a.nrows();
    let (mut result, mut square) = (DMatrix::identity(n, n), a.clone());
    while exponent > 0 {
        if exponent % 2 == 1 {
            result = &square * result;
        }
        exponent /= 2;
        if exponent > 0 {
            square = &square * &square;
        }
    }
    result
}
