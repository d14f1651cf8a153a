//! Conditions of a certificate, each with the margin by which it holds.

use crate::achieved::Inequality;
use crate::decomposition::SymmetricDecomposition;
use nalgebra::DMatrix;

/// One condition that a gain must fulfil. It holds while its margin is at least 0.
#[derive(Clone, Debug, PartialEq)]
pub struct Condition {
    /// The condition in symbols.
    pub name: String,
    /// How far it is from being violated; negative: violated.
    pub margin: f64,
    /// Whether it holds with equality where all is right: its margin is then rounding noise, which differs between
    /// machines, and it is checked but not stated.
    pub sharp: bool,
    /// The word of the label `uncertified(...)` if it is violated.
    pub code: &'static str,
    /// What is said if it is violated.
    pub violation: String,
}

impl Condition {
    /// Whether it holds; a margin that is not a number does not.
    pub fn holds(&self) -> bool {
        self.margin >= 0.0
    }

    /// As it stands among the achievements.
    pub fn inequality(&self) -> Inequality {
        Inequality {
            name: self.name.clone(),
            margin: self.margin,
        }
    }
}

/// Smallest eigenvalue of a symmetric matrix after the congruence that gives it a unit diagonal, less what rounding may
/// have added: at least 0 only if the matrix is positive semidefinite. The scaling makes the number independent of units.
pub(super) fn scaled_margin(matrix: &DMatrix<f64>) -> f64 {
    let n = matrix.nrows();
    let diagonal = matrix.diagonal();
    if diagonal.iter().any(|value| !(*value > 0.0 && value.is_finite())) {
        return diagonal
            .iter()
            .copied()
            .fold(0.0, f64::min)
            .min(-f64::MIN_POSITIVE);
    }
    let scale = diagonal.map(|value| value.sqrt().recip());
    let scaled = DMatrix::from_fn(n, n, |i, j| matrix[(i, j)] * scale[i] * scale[j]);
    let smallest = SymmetricDecomposition::new(&scaled).smallest();
    let rounding = 4.0 * (n * n) as f64 * f64::EPSILON;
    if smallest.is_nan() {
        f64::NEG_INFINITY
    } else {
        smallest - rounding
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::dmatrix;

    #[test]
    fn the_margin_does_not_depend_on_units_and_tells_the_sign() {
        let plain = dmatrix![2.0, 1.0; 1.0, 2.0];
        let units = dmatrix![2e-12, 1.0; 1.0, 2e12];
        assert!((scaled_margin(&plain) - 0.5).abs() < 1e-13);
        assert!((scaled_margin(&units) - 0.5).abs() < 1e-13);
        assert!(
            scaled_margin(&dmatrix![1.0, 1.0; 1.0, 1.0]) < 0.0,
            "singular is no margin"
        );
        assert!(scaled_margin(&dmatrix![1.0, 2.0; 2.0, 1.0]) < -0.9);
        assert!(scaled_margin(&dmatrix![1.0, 0.0; 0.0, -3.0]) < 0.0);
        assert!(scaled_margin(&dmatrix![f64::NAN]) < 0.0);
    }
}
