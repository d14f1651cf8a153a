//! Products: `dgemm_`, `dgemv_`, `dsymv_`, `dsyrk_`, `dsyr2k_`.

use super::arguments::{letter, load, load_vector, size, store, store_vector, triangle};
use nalgebra::{DMatrix, DVector};
use std::ffi::{c_char, c_int};

/// op(M), M stored as rows x columns of the result unless the letter asks for the transpose.
///
/// # Safety
/// The pointers are valid for reading, `matrix` for a matrix of that size with the leading dimension.
unsafe fn operand(
    transpose: *const c_char,
    matrix: *const f64,
    (rows, columns): (usize, usize),
    leading: *const c_int,
) -> DMatrix<f64> {
    // SAFETY: promised by the caller.
    unsafe {
        let leading = size(leading);
        match letter(transpose) {
            b'N' => load(matrix, rows, columns, leading),
            _ => load(matrix, columns, rows, leading).transpose(),
        }
    }
}

/// α · product + β · what `old` gives; β = 0 does not look at it.
fn combined(
    alpha: f64,
    product: DMatrix<f64>,
    beta: f64,
    old: impl FnOnce() -> DMatrix<f64>,
) -> DMatrix<f64> {
    match beta == 0.0 {
        true => product * alpha,
        false => product * alpha + old() * beta,
    }
}

/// C = α op(A) op(B) + β C with op(A) m x k, op(B) k x n.
///
/// # Safety
/// All pointers are valid as the BLAS routine of this name demands.
#[unsafe(no_mangle)]
pub(super) unsafe extern "C" fn dgemm_(
    transpose_a: *const c_char,
    transpose_b: *const c_char,
    m: *const c_int,
    n: *const c_int,
    k: *const c_int,
    alpha: *const f64,
    a: *const f64,
    leading_a: *const c_int,
    b: *const f64,
    leading_b: *const c_int,
    beta: *const f64,
    c: *mut f64,
    leading_c: *const c_int,
) {
    // SAFETY: promised by the caller.
    unsafe {
        let (m, n, k) = (size(m), size(n), size(k));
        let product = operand(transpose_a, a, (m, k), leading_a) * operand(transpose_b, b, (k, n), leading_b);
        let leading = size(leading_c);
        let result = combined(*alpha, product, *beta, || load(c, m, n, leading));
        store(c, leading, &result, |_, _| true);
    }
}

/// y = α op(A) x + β y, A m x n.
///
/// # Safety
/// All pointers are valid as the BLAS routine of this name demands.
#[unsafe(no_mangle)]
pub(super) unsafe extern "C" fn dgemv_(
    transpose: *const c_char,
    m: *const c_int,
    n: *const c_int,
    alpha: *const f64,
    a: *const f64,
    leading: *const c_int,
    x: *const f64,
    increment_x: *const c_int,
    beta: *const f64,
    y: *mut f64,
    increment_y: *const c_int,
) {
    // SAFETY: promised by the caller.
    unsafe {
        let matrix = load(a, size(m), size(n), size(leading));
        let matrix = match letter(transpose) {
            b'N' => matrix,
            _ => matrix.transpose(),
        };
        let x = load_vector(x, matrix.ncols(), increment_x);
        accumulate(&matrix, &x, *alpha, *beta, y, increment_y);
    }
}

/// y = α A x + β y with a symmetric A (n x n) of which one triangle is stored.
///
/// # Safety
/// All pointers are valid as the BLAS routine of this name demands.
#[unsafe(no_mangle)]
pub(super) unsafe extern "C" fn dsymv_(
    uplo: *const c_char,
    n: *const c_int,
    alpha: *const f64,
    a: *const f64,
    leading: *const c_int,
    x: *const f64,
    increment_x: *const c_int,
    beta: *const f64,
    y: *mut f64,
    increment_y: *const c_int,
) {
    // SAFETY: promised by the caller.
    unsafe {
        let n = size(n);
        let matrix = triangle(uplo).completed(&load(a, n, n, size(leading)));
        let x = load_vector(x, n, increment_x);
        accumulate(&matrix, &x, *alpha, *beta, y, increment_y);
    }
}

/// y = α A x + β y.
///
/// # Safety
/// `increment` is valid for reading, `y` for a vector with as many entries as A has rows.
unsafe fn accumulate(
    matrix: &DMatrix<f64>,
    x: &DVector<f64>,
    alpha: f64,
    beta: f64,
    y: *mut f64,
    increment: *const c_int,
) {
    let mut result = matrix * x * alpha;
    // SAFETY: promised by the caller.
    unsafe {
        if beta != 0.0 {
            result += load_vector(y, result.len(), increment) * beta;
        }
        store_vector(y, &result, increment);
    }
}

/// One triangle of C = α op(A) op(A)' + β C, op(A) n x k.
///
/// # Safety
/// All pointers are valid as the BLAS routine of this name demands.
#[unsafe(no_mangle)]
pub(super) unsafe extern "C" fn dsyrk_(
    uplo: *const c_char,
    transpose: *const c_char,
    n: *const c_int,
    k: *const c_int,
    alpha: *const f64,
    a: *const f64,
    leading_a: *const c_int,
    beta: *const f64,
    c: *mut f64,
    leading_c: *const c_int,
) {
    // SAFETY: promised by the caller.
    unsafe {
        let (n, leading, triangle) = (size(n), size(leading_c), triangle(uplo));
        let a = operand(transpose, a, (n, size(k)), leading_a);
        let result = combined(*alpha, &a * a.transpose(), *beta, || load(c, n, n, leading));
        store(c, leading, &result, |i, j| triangle.holds(i, j));
    }
}

/// One triangle of C = α (op(A) op(B)' + op(B) op(A)') + β C, op(A) and op(B) n x k.
///
/// # Safety
/// All pointers are valid as the BLAS routine of this name demands.
#[unsafe(no_mangle)]
pub(super) unsafe extern "C" fn dsyr2k_(
    uplo: *const c_char,
    transpose: *const c_char,
    n: *const c_int,
    k: *const c_int,
    alpha: *const f64,
    a: *const f64,
    leading_a: *const c_int,
    b: *const f64,
    leading_b: *const c_int,
    beta: *const f64,
    c: *mut f64,
    leading_c: *const c_int,
) {
    // SAFETY: promised by the caller.
    unsafe {
        let (n, k, leading, triangle) = (size(n), size(k), size(leading_c), triangle(uplo));
        let product =
            operand(transpose, a, (n, k), leading_a) * operand(transpose, b, (n, k), leading_b).transpose();
        let sum = &product + product.transpose();
        let result = combined(*alpha, sum, *beta, || load(c, n, n, leading));
        store(c, leading, &result, |i, j| triangle.holds(i, j));
    }
}

#[cfg(test)]
#[path = "products_tests.rs"]
mod tests;
