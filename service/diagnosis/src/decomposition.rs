//! Singular values and eigenvalues with a bounded number of iterations.
//!
//! Whatever matrix a user configures, a check must end: the singular values come from one-sided Jacobi rotations,
//! which converge quickly and keep small singular values accurate, the eigenvalues from a capped QR iteration.

use nalgebra::{Complex, DMatrix, DVector, Schur, SymmetricEigen};

/// A = U diag(σ) V' for any m x n matrix A; every column has its σ, also with more columns than rows.
#[derive(Clone, Debug)]
pub struct SingularDecomposition {
    /// m x n: orthonormal columns, zero where σ is 0.
    pub u: DMatrix<f64>,
    /// n singular values in no particular order.
    pub sigma: DVector<f64>,
    /// n x n, orthogonal.
    pub v: DMatrix<f64>,
}

impl SingularDecomposition {
    /// Decomposes a matrix of finite entries.
    pub fn new(matrix: &DMatrix<f64>) -> Self {
        const SWEEPS: usize = 60;
        let n = matrix.ncols();
        let scale = matrix
            .iter()
            .fold(0.0_f64, |largest, entry| largest.max(entry.abs()));
        let scale = if scale > 0.0 { scale } else { 1.0 };
        let (mut u, mut v) = (matrix / scale, DMatrix::identity(n, n));
        for _ in 0..SWEEPS {
            let mut rotated = false;
            for p in 0..n {
                for q in p + 1..n {
                    rotated |= orthogonalise(&mut u, &mut v, p, q);
                }
            }
            if !rotated {
                break;
            }
        }
        let mut sigma = DVector::zeros(n);
        for (mut column, sigma) in u.column_iter_mut().zip(sigma.iter_mut()) {
            let norm = column.norm();
            if norm > 0.0 {
                column /= norm;
            }
            *sigma = norm * scale;
        }
        Self { u, sigma, v }
    }

    /// The largest singular value; 0 without columns.
    pub fn largest(&self) -> f64 {
        self.sigma.iter().copied().fold(0.0, f64::max)
    }

    /// The smallest singular value over the columns: 0 with more columns than rows, infinite without columns.
    pub fn smallest(&self) -> f64 {
        self.sigma.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// Orthonormal basis of the range: the left vectors with σ > `limit`.
    pub fn range(&self, limit: f64) -> DMatrix<f64> {
        self.u.select_columns(&self.indices(|sigma| sigma > limit))
    }

    /// Orthonormal basis of what is mapped to zero: the right vectors with σ <= `limit`.
    pub fn null_space(&self, limit: f64) -> DMatrix<f64> {
        self.v.select_columns(&self.indices(|sigma| sigma <= limit))
    }

    /// The left inverse (A'A)⁻¹A', n x m, if σ_min > `tolerance` σ_max.
    pub fn left_inverse(&self, tolerance: f64) -> Option<DMatrix<f64>> {
        if self.smallest() <= tolerance * self.largest() {
            return None;
        }
        let scaled = &self.v * DMatrix::from_diagonal(&self.sigma.map(|sigma| 1.0 / sigma));
        Some(scaled * self.u.transpose())
    }

    fn indices(&self, keep: impl Fn(f64) -> bool) -> Vec<usize> {
        (0..self.sigma.len()).filter(|&i| keep(self.sigma[i])).collect()
    }
}

/// Makes columns `p` and `q` of `u` orthogonal by a rotation that `v` follows; false if they are already.
fn orthogonalise(u: &mut DMatrix<f64>, v: &mut DMatrix<f64>, p: usize, q: usize) -> bool {
    let (alpha, beta) = (u.column(p).norm_squared(), u.column(q).norm_squared());
    let gamma = u.column(p).dot(&u.column(q));
    if gamma.abs() <= 1e-15 * (alpha * beta).sqrt() {
        return false;
    }
    let zeta = (beta - alpha) / (2.0 * gamma);
    let tangent = zeta.signum() / (zeta.abs() + zeta.hypot(1.0));
    let cosine = 1.0 / tangent.hypot(1.0);
    let sine = cosine * tangent;
    for matrix in [u, v] {
        for i in 0..matrix.nrows() {
            let (left, right) = (matrix[(i, p)], matrix[(i, q)]);
            matrix[(i, p)] = cosine * left - sine * right;
            matrix[(i, q)] = sine * left + cosine * right;
        }
    }
    true
}

/// A = V diag(λ) V' for a symmetric n x n matrix A.
#[derive(Clone, Debug)]
pub struct SymmetricDecomposition {
    /// λ, ascending.
    pub eigenvalues: DVector<f64>,
    /// n x n, orthogonal.
    pub vectors: DMatrix<f64>,
}

impl SymmetricDecomposition {
    /// Decomposes the symmetric part of a matrix. The values of a matrix with infinite entries are not numbers.
    pub fn new(matrix: &DMatrix<f64>) -> Self {
        const ITERATIONS: usize = 10_000;
        let n = matrix.nrows();
        if !matrix.iter().all(|entry| entry.is_finite()) {
            return Self {
                eigenvalues: DVector::from_element(n, f64::NAN),
                vectors: DMatrix::from_element(n, n, f64::NAN),
            };
        }
        let symmetric = (matrix + matrix.transpose()) / 2.0;
        let (values, vectors) = match SymmetricEigen::try_new(symmetric.clone(), f64::EPSILON, ITERATIONS) {
            Some(found) => (found.eigenvalues, found.eigenvectors),
            None => shifted_decomposition(&symmetric),
        };
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by(|&i, &j| values[i].total_cmp(&values[j]));
        Self {
            eigenvalues: DVector::from_fn(n, |i, _| values[order[i]]),
            vectors: vectors.select_columns(&order),
        }
    }

    /// The smallest eigenvalue; infinite of an empty matrix, not a number if an entry is not finite.
    pub fn smallest(&self) -> f64 {
        self.eigenvalues.get(0).copied().unwrap_or(f64::INFINITY)
    }
}

/// Eigenvalues and vectors of a symmetric A from the singular values of A + ‖A‖I, which is positive semidefinite.
fn shifted_decomposition(symmetric: &DMatrix<f64>) -> (DVector<f64>, DMatrix<f64>) {
    let shift = symmetric.norm();
    let shifted = symmetric + DMatrix::identity(symmetric.nrows(), symmetric.nrows()) * shift;
    let decomposition = SingularDecomposition::new(&shifted);
    (decomposition.sigma.add_scalar(-shift), decomposition.v)
}

/// Eigenvalues; `None` if they overflow, or if the iteration does not converge even after a change by rounding errors,
/// which breaks the symmetries on which it can stall.
pub fn eigenvalues(matrix: &DMatrix<f64>) -> Option<Vec<Complex<f64>>> {
    const ITERATIONS: usize = 10_000;
    if matrix.is_empty() {
        return Some(Vec::new());
    }
    let schur = |matrix: DMatrix<f64>| Schur::try_new(matrix, f64::EPSILON, ITERATIONS);
    let perturbed = || {
        let size = f64::EPSILON * matrix.amax();
        matrix.map_with_location(|i, j, entry| entry + size * ((7 * i + 3 * j + 1) as f64).sin())
    };
    let schur = schur(matrix.clone()).or_else(|| schur(perturbed()))?;
    let values: Vec<Complex<f64>> = schur.complex_eigenvalues().iter().copied().collect();
    let finite = values
        .iter()
        .all(|value| value.re.is_finite() && value.im.is_finite());
    finite.then_some(values)
}

/// D⁻¹ A D with a diagonal D of powers of two that makes rows and columns of similar size: the same eigenvalues,
/// but computed more accurately where the entries of A have different units.
pub fn balanced(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    const SWEEPS: usize = 60;
    let n = matrix.nrows();
    let mut balanced = matrix.clone();
    for _ in 0..SWEEPS {
        let mut changed = false;
        for i in 0..n {
            let others = |entries: &mut dyn Iterator<Item = &f64>| {
                let sum: f64 = entries.map(|entry| entry.abs()).sum();
                sum - balanced[(i, i)].abs()
            };
            let (row, column) = (
                others(&mut balanced.row(i).iter()),
                others(&mut balanced.column(i).iter()),
            );
            if !(row > 0.0 && column > 0.0 && row.is_finite() && column.is_finite()) {
                continue;
            }
            let exponent = ((row / column).log2() / 2.0).round() as i32;
            let factor = 2.0_f64.powi(exponent);
            if exponent == 0 || !(column * factor + row / factor < 0.95 * (column + row)) {
                continue;
            }
            balanced.column_mut(i).scale_mut(factor);
            balanced.row_mut(i).unscale_mut(factor);
            changed = true;
        }
        if !changed {
            break;
        }
    }
    balanced
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_factors_give_the_matrix_back(
            rows in 1..7_usize,
            columns in 1..7_usize,
            entries in proptest::collection::vec(prop_oneof![Just(0.0), -1.0..1.0_f64, -1e-9..1e-9_f64], 36),
            exponent in -200..200_i32,
        ) {
            let matrix = DMatrix::from_fn(rows, columns, |i, j| entries[6 * i + j] * 10_f64.powi(exponent));
            let svd = SingularDecomposition::new(&matrix);
            let scale = matrix.amax();
            let rebuilt = &svd.u * DMatrix::from_diagonal(&svd.sigma) * svd.v.transpose();
            prop_assert!((rebuilt - &matrix).amax() <= 1e-13 * scale);
            prop_assert!((svd.v.tr_mul(&svd.v) - DMatrix::identity(columns, columns)).amax() < 1e-13);
            let range = svd.range(1e-12 * svd.largest());
            prop_assert!((range.tr_mul(&range) - DMatrix::identity(range.ncols(), range.ncols())).amax() < 1e-10);
            let silent = &matrix * svd.null_space(1e-12 * svd.largest());
            prop_assert!(silent.iter().all(|entry| entry.abs() <= 1e-11 * scale));
        }
    }

    #[test]
    fn a_left_inverse_exists_only_with_full_column_rank() {
        let tall = DMatrix::from_row_slice(3, 2, &[1.0, 2.0, 0.0, 1.0, 3.0, -1.0]);
        let inverse = SingularDecomposition::new(&tall).left_inverse(1e-9).unwrap();
        assert!((inverse * &tall - DMatrix::identity(2, 2)).amax() < 1e-14);
        assert!(
            SingularDecomposition::new(&tall.transpose())
                .left_inverse(1e-9)
                .is_none()
        );
        let dependent = DMatrix::from_row_slice(2, 2, &[1.0, 2.0, 2.0, 4.0]);
        assert!(
            SingularDecomposition::new(&dependent)
                .left_inverse(1e-9)
                .is_none()
        );
    }

    #[test]
    fn a_symmetric_matrix_has_ascending_eigenvalues_either_way() {
        let size = 6;
        let matrix = DMatrix::from_fn(size, size, |i, j| {
            ((i * j + 1) as f64).sin() + ((i + j) as f64).cos()
        });
        let found = SymmetricDecomposition::new(&matrix);
        let rebuilt = &found.vectors * DMatrix::from_diagonal(&found.eigenvalues) * found.vectors.transpose();
        assert!((rebuilt - &matrix).amax() < 1e-14 * 10.0);
        assert!(
            found
                .eigenvalues
                .as_slice()
                .is_sorted_by(|left, right| left <= right)
        );
        assert_eq!(found.smallest(), found.eigenvalues[0]);
        let (values, vectors) = shifted_decomposition(&matrix);
        assert!(
            (&vectors * DMatrix::from_diagonal(&values) * vectors.transpose() - &matrix).amax()
                < 1e-14 * 10.0
        );
        assert!(SymmetricDecomposition::new(&(matrix / 0.0)).smallest().is_nan());
    }

    #[test]
    fn balancing_keeps_the_eigenvalues_and_makes_them_accurate() {
        let plain = DMatrix::from_row_slice(3, 3, &[0.1, 2.0, 0.3, -2.0, 0.1, 0.4, 0.2, -0.3, 5.0]);
        let units = [1e-9, 1e3, 1.0];
        let scaled = DMatrix::from_fn(3, 3, |i, j| plain[(i, j)] * units[i] / units[j]);
        let balanced = balanced(&scaled);
        assert!(balanced.amax() < 20.0, "{balanced}");
        let sorted = |matrix: &DMatrix<f64>| {
            let mut values = eigenvalues(matrix).unwrap();
            values.sort_by(|x, y| x.re.total_cmp(&y.re).then(x.im.total_cmp(&y.im)));
            values
        };
        for (value, expected) in sorted(&balanced).iter().zip(sorted(&plain)) {
            assert!((value - expected).norm() < 1e-12);
        }
    }

    #[test]
    fn eigenvalues_of_a_cyclic_shift_lie_on_the_unit_circle() {
        let shift = DMatrix::from_fn(8, 8, |i, j| f64::from(u8::from((i + 1) % 8 == j)));
        let found = eigenvalues(&shift).unwrap();
        assert_eq!(found.len(), 8);
        assert!(found.iter().all(|value| (value.norm() - 1.0).abs() < 1e-9));
    }
}
