//! Small factorisations with preallocated room: Cholesky and Householder QR with column pivoting.

use crate::buffer::Buffer;
use crate::matrix::{Matrix, dot};

/// Factors the symmetric positive definite `matrix` = M M' in place (lower triangle; the upper one is left).
///
/// Returns false, with `matrix` spoilt, when a pivot is not positive or not finite.
#[must_use]
pub fn cholesky(matrix: &mut Matrix) -> bool {
    for i in 0..matrix.rows() {
        for j in 0..=i {
            let rest = matrix[(i, j)] - dot(&matrix.row(i)[..j], &matrix.row(j)[..j]);
            if i > j {
                matrix[(i, j)] = rest / matrix[(j, j)];
            } else if rest > 0.0 && rest.is_finite() {
                matrix[(i, i)] = rest.sqrt();
            } else {
                return false;
            }
        }
    }
    true
}

/// Solves M M' x = b for the `factor` of [`cholesky`]; `x` holds b before and x afterwards.
pub fn cholesky_solve(factor: &Matrix, x: &mut [f64]) {
    let order = factor.rows();
    for i in 0..order {
        x[i] = (x[i] - dot(&factor.row(i)[..i], &x[..i])) / factor[(i, i)];
    }
    for i in (0..order).rev() {
        let known: f64 = (i + 1..order).map(|k| factor[(k, i)] * x[k]).sum();
        x[i] = (x[i] - known) / factor[(i, i)];
    }
}

/// A Π = Q R by Householder reflections with column pivoting, in room allocated once.
#[derive(Clone, Debug)]
pub struct PivotedQr {
    /// R, upper trapezoidal, in pivoted column order.
    pub r: Matrix,
    /// Q, square and orthogonal.
    pub q: Matrix,
    /// Π: column k of A Π is column `pivot[k]` of A.
    pub pivot: Buffer<usize>,
    reflector: Vec<f64>,
}

impl PivotedQr {
    /// Room for matrices of up to `rows` x `columns`.
    pub fn with_capacity(rows: usize, columns: usize) -> Self {
        Self {
            r: Matrix::zeros(rows, columns),
            q: Matrix::zeros(rows, rows),
            pivot: Buffer::with_capacity(columns),
            reflector: vec![0.0; rows],
        }
    }

    /// Factors `matrix`, which must fit into the room.
    pub fn factor(&mut self, matrix: &Matrix) {
        let (rows, columns) = matrix.shape();
        self.r.copy_from(matrix);
        self.q.reshape(rows, rows);
        self.q.fill(0.0);
        (0..rows).for_each(|i| self.q[(i, i)] = 1.0);
        self.pivot.clear();
        self.pivot.extend(0..columns);
        for k in 0..rows.min(columns) {
            self.bring_largest_column_to(k);
            if !self.reflect(k) {
                break;
            }
        }
    }

    /// Number of leading diagonal elements of R above `tolerance` in magnitude.
    pub fn rank(&self, tolerance: f64) -> usize {
        let (rows, columns) = self.r.shape();
        (0..rows.min(columns))
            .take_while(|&k| self.r[(k, k)].abs() > tolerance)
            .count()
    }

    /// Solves R11 X = Q1' for the leading `rank` columns; `inverse` becomes `rank` x rows.
    ///
    /// Row k of X belongs to column `pivot[k]` of the factored matrix.
    pub fn leading_inverse(&self, rank: usize, inverse: &mut Matrix) {
        let rows = self.q.rows();
        inverse.reshape(rank, rows);
        for k in (0..rank).rev() {
            for j in 0..rows {
                let known: f64 = (k + 1..rank).map(|i| self.r[(k, i)] * inverse[(i, j)]).sum();
                inverse[(k, j)] = (self.q[(j, k)] - known) / self.r[(k, k)];
            }
        }
    }

    /// Solves R11 x = R12(:, `column`) for the leading `rank` columns; `column` counts in pivoted order.
    pub fn solve_leading(&self, rank: usize, column: usize, x: &mut [f64]) {
        for k in (0..rank).rev() {
            let known: f64 = (k + 1..rank).map(|i| self.r[(k, i)] * x[i]).sum();
            x[k] = (self.r[(k, column)] - known) / self.r[(k, k)];
        }
    }

    fn bring_largest_column_to(&mut self, k: usize) {
        let (rows, columns) = self.r.shape();
        let norm = |j: usize| (k..rows).map(|i| self.r[(i, j)].powi(2)).sum::<f64>();
        let mut largest = (k, norm(k));
        for j in k + 1..columns {
            let candidate = norm(j);
            if candidate > largest.1 {
                largest = (j, candidate);
            }
        }
        if largest.0 != k {
            for i in 0..rows {
                self.r.row_mut(i).swap(k, largest.0);
            }
            self.pivot.swap(k, largest.0);
        }
    }

    /// Annihilates column `k` below the diagonal; false when nothing but zeros is left.
    fn reflect(&mut self, k: usize) -> bool {
        let (rows, columns) = self.r.shape();
        let scale = (k..rows).fold(0.0_f64, |largest, i| largest.max(self.r[(i, k)].abs()));
        if scale == 0.0 {
            return false;
        }
        for i in k..rows {
            self.reflector[i] = self.r[(i, k)] / scale;
        }
        let norm = dot(&self.reflector[k..rows], &self.reflector[k..rows]).sqrt();
        let head = self.reflector[k];
        let diagonal = if head > 0.0 { -norm } else { norm };
        self.reflector[k] = head - diagonal;
        let squared = dot(&self.reflector[k..rows], &self.reflector[k..rows]);
        for j in k..columns {
            let inner: f64 = (k..rows).map(|i| self.reflector[i] * self.r[(i, j)]).sum();
            for i in k..rows {
                self.r[(i, j)] -= 2.0 * inner / squared * self.reflector[i];
            }
        }
        self.r[(k, k)] = diagonal * scale;
        for i in k + 1..rows {
            self.r[(i, k)] = 0.0;
        }
        for i in 0..rows {
            let row = &mut self.q.row_mut(i)[k..rows];
            let inner = 2.0 * dot(row, &self.reflector[k..rows]) / squared;
            for (target, value) in row.iter_mut().zip(&self.reflector[k..rows]) {
                *target -= inner * value;
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::*;

    #[test]
    fn the_factors_multiply_to_the_pivoted_matrix_and_show_its_rank() {
        let dense = DMatrix::from_row_slice(4, 3, &[1., 2., 3., 4., 5., 9., 7., 8., 15., 2., 0., 2.]);
        let mut qr = PivotedQr::with_capacity(4, 3);
        qr.factor(&Matrix::from(&dense));
        let product = qr.q.to_dense() * qr.r.to_dense();
        let pivoted = DMatrix::from_fn(4, 3, |i, j| dense[(i, qr.pivot[j])]);
        assert!((product - pivoted).amax() < 1e-14);
        assert!((qr.q.to_dense().transpose() * qr.q.to_dense() - DMatrix::identity(4, 4)).amax() < 1e-14);
        assert_eq!(qr.rank(1e-12), 2);
    }

    #[test]
    fn the_leading_inverse_inverts_the_pivot_columns() {
        let dense = DMatrix::from_row_slice(4, 3, &[1., 2., 0., 4., 5., 9., 7., 8., 1., 2., 0., 2.]);
        let mut qr = PivotedQr::with_capacity(4, 3);
        qr.factor(&Matrix::from(&dense));
        let mut inverse = Matrix::zeros(3, 4);
        qr.leading_inverse(3, &mut inverse);
        let pivoted = DMatrix::from_fn(4, 3, |i, j| dense[(i, qr.pivot[j])]);
        assert!((inverse.to_dense() * pivoted - DMatrix::identity(3, 3)).amax() < 1e-13);
    }

    #[test]
    fn cholesky_solves_and_refuses_an_indefinite_matrix() {
        let dense = DMatrix::from_row_slice(3, 3, &[4., 1., 0., 1., 3., -1., 0., -1., 2.]);
        let mut factor = Matrix::from(&dense);
        assert!(cholesky(&mut factor));
        let mut x = vec![1.0, 2.0, 3.0];
        cholesky_solve(&factor, &mut x);
        let error = dense * nalgebra::DVector::from_vec(x) - nalgebra::DVector::from_vec(vec![1., 2., 3.]);
        assert!(error.amax() < 1e-14);
        assert!(!cholesky(&mut Matrix::from(&DMatrix::from_row_slice(
            2,
            2,
            &[1., 2., 2., 1.]
        ))));
    }
}
