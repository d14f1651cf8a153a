//! Checks and factors of covariance matrices, free of units: every test is made on the matrix scaled to a unit
//! diagonal.

use nalgebra::{DMatrix, SymmetricEigen};

/// Largest asymmetry |a_ij - a_ji| / sqrt(a_ii a_jj) that counts as rounding.
const SYMMETRY_TOLERANCE: f64 = 1e-12;
/// Smallest pivot, or most negative eigenvalue relative to the largest, of the scaled matrix.
const DEFINITENESS_TOLERANCE: f64 = 1e-12;
/// Iterations of the eigenvalue routine; it converges in a handful.
const ITERATIONS: usize = 10_000;

/// Which property a matrix lacks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CovarianceError {
    /// It is not square.
    NotSquare,
    /// Entry (row, column) differs from its mirror.
    NotSymmetric(usize, usize),
    /// It is not positive definite.
    NotPositiveDefinite,
    /// It has a negative eigenvalue.
    NotPositiveSemidefinite,
}

/// The matrix with its rounding errors of symmetry removed.
///
/// # Errors
/// [`CovarianceError::NotSquare`], [`CovarianceError::NotSymmetric`].
pub fn symmetric(matrix: &DMatrix<f64>) -> Result<DMatrix<f64>, CovarianceError> {
    let n = matrix.nrows();
    if matrix.ncols() != n {
        return Err(CovarianceError::NotSquare);
    }
    for i in 0..n {
        for j in 0..i {
            let limit = SYMMETRY_TOLERANCE * (matrix[(i, i)].abs() * matrix[(j, j)].abs()).sqrt();
            if (matrix[(i, j)] - matrix[(j, i)]).abs() > limit {
                return Err(CovarianceError::NotSymmetric(i, j));
            }
        }
    }
    Ok((matrix + matrix.transpose()) / 2.0)
}

/// The lower factor L, L L' = R, of a positive definite matrix.
///
/// # Errors
/// [`CovarianceError`]: the property that is missing.
pub fn positive_definite_factor(matrix: &DMatrix<f64>) -> Result<DMatrix<f64>, CovarianceError> {
    let matrix = symmetric(matrix)?;
    let n = matrix.nrows();
    if (0..n).any(|i| !(matrix[(i, i)] > 0.0)) {
        return Err(CovarianceError::NotPositiveDefinite);
    }
    let scale: Vec<f64> = (0..n).map(|i| matrix[(i, i)].sqrt()).collect();
    let mut lower = DMatrix::zeros(n, n);
    for j in 0..n {
        for i in j..n {
            let product: f64 = (0..j).map(|k| lower[(i, k)] * lower[(j, k)]).sum();
            let rest = matrix[(i, j)] / scale[i] / scale[j] - product;
            if i > j {
                lower[(i, j)] = rest / lower[(j, j)];
            } else if rest > DEFINITENESS_TOLERANCE {
                lower[(j, j)] = rest.sqrt();
            } else {
                return Err(CovarianceError::NotPositiveDefinite);
            }
        }
    }
    Ok(DMatrix::from_fn(n, n, |i, j| scale[i] * lower[(i, j)]))
}

/// A factor G (n x n), G G' = Q, of a positive semidefinite matrix; negative eigenvalues within rounding count as 0.
///
/// # Errors
/// [`CovarianceError`]: the property that is missing.
pub fn semidefinite_factor(matrix: &DMatrix<f64>) -> Result<DMatrix<f64>, CovarianceError> {
    let matrix = symmetric(matrix)?;
    let n = matrix.nrows();
    if n == 0 {
        return Ok(matrix);
    }
    if (0..n).any(|i| matrix[(i, i)] < 0.0) {
        return Err(CovarianceError::NotPositiveSemidefinite);
    }
    let scale: Vec<f64> = (0..n)
        .map(|i| {
            if matrix[(i, i)] > 0.0 {
                matrix[(i, i)].sqrt()
            } else {
                1.0
            }
        })
        .collect();
    let scaled = DMatrix::from_fn(n, n, |i, j| matrix[(i, j)] / scale[i] / scale[j]);
    let decomposition = SymmetricEigen::try_new(scaled, f64::EPSILON, ITERATIONS)
        .ok_or(CovarianceError::NotPositiveSemidefinite)?;
    let largest = decomposition.eigenvalues.amax();
    if decomposition
        .eigenvalues
        .iter()
        .any(|value| *value < -DEFINITENESS_TOLERANCE * largest)
    {
        return Err(CovarianceError::NotPositiveSemidefinite);
    }
    let roots = decomposition.eigenvalues.map(|value| value.max(0.0).sqrt());
    Ok(DMatrix::from_fn(n, n, |i, j| {
        scale[i] * decomposition.eigenvectors[(i, j)] * roots[j]
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn factors_give_the_matrix_back_in_any_units() {
        let matrix = DMatrix::from_row_slice(2, 2, &[4e12, 1.0, 1.0, 1e-12]);
        let lower = positive_definite_factor(&matrix).unwrap();
        let back = &lower * lower.transpose();
        assert!((0..4).all(|i| (back[i] / matrix[i] - 1.0).abs() < 1e-12));
        let singular = DMatrix::from_row_slice(2, 2, &[1.0, 2.0, 2.0, 4.0]);
        let factor = semidefinite_factor(&singular).unwrap();
        assert!((&factor * factor.transpose() - &singular).amax() < 1e-14);
        assert_eq!(
            positive_definite_factor(&singular),
            Err(CovarianceError::NotPositiveDefinite)
        );
    }

    #[test]
    fn each_missing_property_is_named() {
        let matrix = |entries: &[f64]| DMatrix::from_row_slice(2, 2, entries);
        assert_eq!(
            symmetric(&matrix(&[1.0, 0.5, 0.4, 1.0])),
            Err(CovarianceError::NotSymmetric(1, 0))
        );
        assert_eq!(symmetric(&DMatrix::zeros(1, 2)), Err(CovarianceError::NotSquare));
        for negative in [[1.0, 2.0, 2.0, 1.0], [-1.0, 0.0, 0.0, 1.0]] {
            assert_eq!(
                semidefinite_factor(&matrix(&negative)),
                Err(CovarianceError::NotPositiveSemidefinite)
            );
        }
        assert!(semidefinite_factor(&DMatrix::zeros(2, 2)).is_ok());
    }
}
