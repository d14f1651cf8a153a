//! A factor of a positive semidefinite matrix by Jacobi rotations, without allocation.

use crate::matrix::Matrix;

/// Sweeps over all pairs; Jacobi's method converges quadratically after two or three.
const SWEEPS: usize = 30;

/// G with G G' = Ω for a singular Ω: eigenvectors times roots of the eigenvalues, negative ones set to 0.
#[derive(Clone, Debug)]
pub(super) struct SemidefiniteRoot {
    matrix: Matrix,
    scale: Vec<f64>,
    root: Matrix,
}

impl SemidefiniteRoot {
    pub fn new(n: usize) -> Self {
        Self {
            matrix: Matrix::zeros(n, n),
            scale: vec![1.0; n],
            root: Matrix::zeros(n, n),
        }
    }

    pub fn root(&self) -> &Matrix {
        &self.root
    }

    /// Factors Ω, scaled to a unit diagonal so that states of different units keep their accuracy.
    pub fn factor(&mut self, omega: &Matrix) {
        let n = omega.rows();
        for (i, scale) in self.scale.iter_mut().enumerate() {
            let root = omega[(i, i)].sqrt();
            *scale = if root > 0.0 && root.is_finite() { root } else { 1.0 };
        }
        self.root.fill(0.0);
        for i in 0..n {
            for j in 0..n {
                self.matrix[(i, j)] = omega[(i, j)] / self.scale[i] / self.scale[j];
            }
            self.root[(i, i)] = 1.0;
        }
        for _ in 0..SWEEPS {
            let mut rotated = false;
            for p in 0..n {
                for q in p + 1..n {
                    rotated |= self.rotate(p, q);
                }
            }
            if !rotated {
                break;
            }
        }
        for j in 0..n {
            let length = self.matrix[(j, j)].max(0.0).sqrt();
            for i in 0..n {
                self.root[(i, j)] *= length * self.scale[i];
            }
        }
    }

    /// Makes entry (p, q) zero; false if it is already small beside the diagonal.
    fn rotate(&mut self, p: usize, q: usize) -> bool {
        let (a, b, c) = (self.matrix[(p, p)], self.matrix[(q, q)], self.matrix[(p, q)]);
        if !(c.abs() > 1e-17 * (a.abs() + b.abs())) || !c.is_finite() {
            return false;
        }
        let zeta = (b - a) / (2.0 * c);
        let tangent = zeta.signum() / (zeta.abs() + zeta.hypot(1.0));
        let cosine = 1.0 / tangent.hypot(1.0);
        let sine = cosine * tangent;
        for k in 0..self.matrix.rows() {
            let (left, right) = (self.matrix[(k, p)], self.matrix[(k, q)]);
            self.matrix[(k, p)] = cosine * left - sine * right;
            self.matrix[(k, q)] = sine * left + cosine * right;
            let (left, right) = (self.root[(k, p)], self.root[(k, q)]);
            self.root[(k, p)] = cosine * left - sine * right;
            self.root[(k, q)] = sine * left + cosine * right;
        }
        for k in 0..self.matrix.rows() {
            let (left, right) = (self.matrix[(p, k)], self.matrix[(q, k)]);
            self.matrix[(p, k)] = cosine * left - sine * right;
            self.matrix[(q, k)] = sine * left + cosine * right;
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_root_gives_a_singular_matrix_back_in_any_units(
            n in 1..7_usize,
            rank in 0..7_usize,
            entries in proptest::collection::vec(-1.0..1.0_f64, 36),
            exponents in proptest::collection::vec(-6..6_i32, 6),
        ) {
            let mut omega = Matrix::zeros(n, n);
            for i in 0..n {
                for j in 0..n {
                    let product: f64 = (0..rank.min(n)).map(|k| entries[6 * i + k] * entries[6 * j + k]).sum();
                    omega[(i, j)] = product * 10_f64.powi(exponents[i] + exponents[j]);
                }
            }
            let mut root = SemidefiniteRoot::new(n);
            root.factor(&omega);
            let back = root.root().to_dense() * root.root().to_dense().transpose();
            for i in 0..n {
                for j in 0..n {
                    let unit = (omega[(i, i)] * omega[(j, j)]).sqrt();
                    prop_assert!((back[(i, j)] - omega[(i, j)]).abs() <= 1e-14 * unit, "{back} {omega:?}");
                }
            }
        }
    }
}
