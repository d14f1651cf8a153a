//! Triangular factors in place: L with L L' = A A', and the substitution with L.

use super::{Matrix, add_scaled, dot};

/// Replaces A (n x c) by its lower triangular factor L (n x n), L L' = A A', diagonal >= 0: `tri(A)`.
///
/// Householder reflections from the right make A = \[L 0\] Q'; no product A A' is formed, so that L keeps the
/// full accuracy of A also when A A' has none left. The columns from n on are dropped; with c < n the missing
/// columns of L are zero, for which the matrix needs room for n columns.
pub fn triangularise(matrix: &mut Matrix) {
    let (n, columns) = matrix.shape();
    for k in 0..n.min(columns) {
        reflect(matrix, k);
    }
    matrix.reshape(n, n);
    for k in 0..n {
        if k >= columns {
            for i in 0..n {
                matrix[(i, k)] = 0.0;
            }
        } else if matrix[(k, k)] < 0.0 {
            for i in k..n {
                matrix[(i, k)] = -matrix[(i, k)];
            }
        }
    }
}

/// Reflects the rows from `k` on so that row `k` is zero right of the diagonal.
fn reflect(matrix: &mut Matrix, k: usize) {
    let rows = matrix.rows();
    let scale = matrix.row(k)[k..]
        .iter()
        .fold(0.0_f64, |largest, value| largest.max(value.abs()));
    let rest = matrix.row(k)[k + 1..].iter().any(|value| *value != 0.0);
    if !rest || !scale.is_finite() {
        return;
    }
    // v = a - α e_1 over a scaled copy of row k, H = I - τ v v'.
    let norm = scale
        * matrix.row(k)[k..]
            .iter()
            .map(|value| (value / scale).powi(2))
            .sum::<f64>()
            .sqrt();
    let alpha = if matrix[(k, k)] > 0.0 { -norm } else { norm };
    let head = matrix[(k, k)] - alpha;
    // With v_1 = 1: v = (1, a_2/head, ...), τ = -head/α.
    for value in &mut matrix.row_mut(k)[k + 1..] {
        *value /= head;
    }
    let tau = -head / alpha;
    for i in k + 1..rows {
        let (v, row) = matrix.two_rows(k, i);
        let projection = tau * (row[k] + dot(&v[k + 1..], &row[k + 1..]));
        row[k] -= projection;
        add_scaled(&mut row[k + 1..], -projection, &v[k + 1..]);
    }
    matrix.row_mut(k)[k + 1..].fill(0.0);
    matrix[(k, k)] = alpha;
}

/// Solves L x = b in place for a lower triangular L with a non-zero diagonal; `x` holds b at first.
pub fn forward_substitution(lower: &Matrix, x: &mut [f64]) {
    for i in 0..x.len() {
        let (done, rest) = x.split_at_mut(i);
        rest[0] = (rest[0] - dot(&lower.row(i)[..i], done)) / lower[(i, i)];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_factor_has_the_product_of_the_matrix(
            n in 1..6_usize,
            columns in 1..9_usize,
            entries in proptest::collection::vec(prop_oneof![Just(0.0), -1.0..1.0_f64, -1e-8..1e-8_f64], 54),
            exponent in -150..150_i32,
        ) {
            let dense = DMatrix::from_fn(n, columns, |i, j| entries[9 * i + j] * 10_f64.powi(exponent));
            let mut matrix = Matrix::zeros(n, columns.max(n));
            matrix.reshape(n, columns);
            for i in 0..n {
                for j in 0..columns {
                    matrix[(i, j)] = dense[(i, j)];
                }
            }
            triangularise(&mut matrix);
            let lower = matrix.to_dense();
            prop_assert_eq!(lower.shape(), (n, n));
            prop_assert!((0..n).all(|i| lower[(i, i)] >= 0.0 && (i + 1..n).all(|j| lower[(i, j)] == 0.0)));
            let scale = dense.amax() / 10_f64.powi(exponent) + 1e-300;
            let unit = 10_f64.powi(-exponent);
            let (lower, dense) = (lower * unit, dense * unit);
            let difference = &lower * lower.transpose() - &dense * dense.transpose();
            prop_assert!(difference.amax() <= 1e-14 * scale * scale * (columns as f64 + 4.0), "{difference}");
        }
    }

    #[test]
    fn substitution_solves_the_triangular_system() {
        let lower = Matrix::from(&DMatrix::from_row_slice(
            3,
            3,
            &[2.0, 0.0, 0.0, 1.0, 4.0, 0.0, -1.0, 0.5, 0.25],
        ));
        let mut x = [2.0, 9.0, 0.25];
        forward_substitution(&lower, &mut x);
        assert_eq!(x, [1.0, 2.0, 1.0]);
    }
}
