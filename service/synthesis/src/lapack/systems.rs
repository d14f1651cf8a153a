//! Systems of linear equations: `dpotrf_`, `dpotrs_`, `dgesv_`.

use super::arguments::{Triangle, load, size, store, triangle};
use nalgebra::DMatrix;
use std::ffi::{c_char, c_int};

/// The lower factor L, L L' = A, from the lower triangle of A; otherwise the order of the first leading minor that is
/// not positive definite.
fn cholesky(mut a: DMatrix<f64>) -> Result<DMatrix<f64>, usize> {
    let n = a.nrows();
    for j in 0..n {
        let known = a.view((j, 0), (1, j)).norm_squared();
        let pivot = a[(j, j)] - known;
        if !(pivot > 0.0 && pivot.is_finite()) {
            return Err(j + 1);
        }
        let root = pivot.sqrt();
        a[(j, j)] = root;
        for i in j + 1..n {
            let known = a.view((i, 0), (1, j)).dot(&a.view((j, 0), (1, j)));
            a[(i, j)] = (a[(i, j)] - known) / root;
        }
    }
    Ok(a)
}

/// Gaussian elimination with row exchanges, in place: unit lower L and upper U. `Ok` holds the row that each row was
/// exchanged with; `Err` the first zero pivot.
fn eliminate(a: &mut DMatrix<f64>) -> Result<Vec<usize>, usize> {
    let n = a.nrows();
    let mut exchanged = Vec::with_capacity(n);
    for j in 0..n {
        let pivot = j + a.view((j, j), (n - j, 1)).iamax_full().0;
        exchanged.push(pivot);
        if a[(pivot, j)] == 0.0 {
            return Err(j);
        }
        a.swap_rows(j, pivot);
        for i in j + 1..n {
            let factor = a[(i, j)] / a[(j, j)];
            a[(i, j)] = factor;
            for k in j + 1..n {
                a[(i, k)] -= factor * a[(j, k)];
            }
        }
    }
    Ok(exchanged)
}

/// Overwrites the stored triangle of A (n x n) by its Cholesky factor; `info` > 0: not positive definite.
///
/// # Safety
/// All pointers are valid as the LAPACK routine of this name demands.
#[unsafe(no_mangle)]
pub(super) unsafe extern "C" fn dpotrf_(
    uplo: *const c_char,
    n: *const c_int,
    a: *mut f64,
    leading: *const c_int,
    info: *mut c_int,
) {
    // SAFETY: promised by the caller.
    unsafe {
        let (n, leading, triangle) = (size(n), size(leading), triangle(uplo));
        let stored = load(a, n, n, leading);
        let lower = match triangle {
            Triangle::Lower => stored,
            Triangle::Upper => stored.transpose(),
        };
        *info = match cholesky(lower) {
            Ok(factor) => {
                let factor = match triangle {
                    Triangle::Lower => factor,
                    Triangle::Upper => factor.transpose(),
                };
                store(a, leading, &factor, |i, j| triangle.holds(i, j));
                0
            }
            Err(order) => order as c_int,
        };
    }
}

/// Overwrites B by the solution of A X = B, A given by the factor of [`dpotrf_`].
///
/// # Safety
/// All pointers are valid as the LAPACK routine of this name demands.
#[unsafe(no_mangle)]
pub(super) unsafe extern "C" fn dpotrs_(
    uplo: *const c_char,
    n: *const c_int,
    columns: *const c_int,
    a: *const f64,
    leading_a: *const c_int,
    b: *mut f64,
    leading_b: *const c_int,
    info: *mut c_int,
) {
    // SAFETY: promised by the caller.
    unsafe {
        let (n, leading) = (size(n), size(leading_b));
        let stored = load(a, n, n, size(leading_a));
        let factor = match triangle(uplo) {
            Triangle::Lower => stored,
            Triangle::Upper => stored.transpose(),
        };
        let mut x = load(b, n, size(columns), leading);
        let solved =
            factor.solve_lower_triangular_mut(&mut x) && factor.tr_solve_lower_triangular_mut(&mut x);
        *info = if solved { 0 } else { 1 };
        store(b, leading, &x, |_, _| true);
    }
}

/// Overwrites A (n x n) by its factors L and U, and B by the solution of A X = B; `info` > 0: A is singular.
///
/// # Safety
/// All pointers are valid as the LAPACK routine of this name demands.
#[unsafe(no_mangle)]
pub(super) unsafe extern "C" fn dgesv_(
    n: *const c_int,
    columns: *const c_int,
    a: *mut f64,
    leading_a: *const c_int,
    pivots: *mut c_int,
    b: *mut f64,
    leading_b: *const c_int,
    info: *mut c_int,
) {
    // SAFETY: promised by the caller.
    unsafe {
        let (n, leading) = (size(n), size(leading_b));
        let mut factors = load(a, n, n, size(leading_a));
        let eliminated = eliminate(&mut factors);
        store(a, size(leading_a), &factors, |_, _| true);
        *info = match eliminated {
            Ok(exchanged) => {
                let mut x = load(b, n, size(columns), leading);
                for (row, &other) in exchanged.iter().enumerate() {
                    pivots.add(row).write(other as c_int + 1);
                    x.swap_rows(row, other);
                }
                factors.solve_lower_triangular_with_diag_mut(&mut x, 1.0);
                factors.solve_upper_triangular_mut(&mut x);
                store(b, leading, &x, |_, _| true);
                0
            }
            Err(pivot) => pivot as c_int + 1,
        };
    }
}

#[cfg(test)]
#[path = "systems_tests.rs"]
mod tests;
