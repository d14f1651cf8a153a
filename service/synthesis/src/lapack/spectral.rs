//! Eigenvalues and singular values: `dsyevr_`, `dgesdd_`, `dgesvd_`.

use super::arguments::{letter, load, size, store, store_vector, triangle};
use nalgebra::{DMatrix, DVector};
use residual_diagnosis::decomposition::{SingularDecomposition, SymmetricDecomposition};
use std::ffi::{c_char, c_int};

/// `lwork`, `liwork`: the caller only asks how much work space is needed.
const QUERY: c_int = -1;
/// Vectors are spaced by 1.
const ADJACENT: c_int = 1;

/// Whether `length` is the question how much work space is needed; if so, the answer is 1, we need none.
///
/// # Safety
/// `length` is valid for reading, `work` for writing one number.
unsafe fn answered(length: *const c_int, work: *mut f64) -> bool {
    // SAFETY: promised by the caller.
    unsafe {
        let query = *length == QUERY;
        if query {
            *work = 1.0;
        }
        query
    }
}

/// Eigenvalues w of the symmetric matrix A (n x n, one triangle stored), ascending, and with `job` V the eigenvectors
/// as columns of Z. Only `range` A, all eigenvalues, is offered; others are refused with `info` = -2.
///
/// # Safety
/// All pointers are valid as the LAPACK routine of this name demands.
#[unsafe(no_mangle)]
pub(super) unsafe extern "C" fn dsyevr_(
    job: *const c_char,
    range: *const c_char,
    uplo: *const c_char,
    n: *const c_int,
    a: *mut f64,
    leading_a: *const c_int,
    _lower: *const f64,
    _upper: *const f64,
    _first: *const c_int,
    _last: *const c_int,
    _tolerance: *const f64,
    found: *mut c_int,
    w: *mut f64,
    z: *mut f64,
    leading_z: *const c_int,
    support: *mut c_int,
    work: *mut f64,
    work_length: *const c_int,
    integer_work: *mut c_int,
    integer_work_length: *const c_int,
    info: *mut c_int,
) {
    // SAFETY: promised by the caller.
    unsafe {
        *info = 0;
        if letter(range) != b'A' {
            *info = -2;
            return;
        }
        let integer_query = *integer_work_length == QUERY;
        if answered(work_length, work) || integer_query {
            *work = 1.0;
            *integer_work = 1;
            return;
        }
        let n = size(n);
        let matrix = triangle(uplo).completed(&load(a, n, n, size(leading_a)));
        let decomposition = SymmetricDecomposition::new(&matrix);
        store_vector(w, &decomposition.eigenvalues, &ADJACENT);
        *found = n as c_int;
        if letter(job) == b'V' {
            store(z, size(leading_z), &decomposition.vectors, |_, _| true);
            for column in 0..n {
                support.add(2 * column).write(1);
                support.add(2 * column + 1).write(n as c_int);
            }
        }
    }
}

/// A = U diag(s) V' with min(m, n) singular values, descending.
struct CompactDecomposition {
    u: DMatrix<f64>,
    s: DVector<f64>,
    v: DMatrix<f64>,
}

impl CompactDecomposition {
    fn new(a: &DMatrix<f64>) -> Self {
        if a.nrows() < a.ncols() {
            let Self { u, s, v } = Self::new(&a.transpose());
            return Self { u: v, s, v: u };
        }
        let SingularDecomposition { mut u, sigma, v } = SingularDecomposition::new(a);
        let mut order: Vec<usize> = (0..sigma.len()).collect();
        order.sort_by(|&i, &j| sigma[j].total_cmp(&sigma[i]));
        for &column in order.iter().filter(|&&column| sigma[column] == 0.0) {
            complete(&mut u, column);
        }
        Self {
            u: u.select_columns(&order),
            s: DVector::from_fn(order.len(), |i, _| sigma[order[i]]),
            v: v.select_columns(&order),
        }
    }
}

/// Replaces a zero column by a unit vector that is orthogonal to all other columns (each of length 1 or 0).
fn complete(u: &mut DMatrix<f64>, column: usize) {
    let projected = |vector: DVector<f64>| {
        let coordinates = u.tr_mul(&vector);
        vector - &*u * coordinates
    };
    let rest = (0..u.nrows())
        .map(|i| projected(DVector::from_fn(u.nrows(), |k, _| f64::from(u8::from(k == i)))))
        .max_by(|left, right| left.norm().total_cmp(&right.norm()));
    if let Some(rest) = rest.filter(|rest| rest.norm() > 0.0) {
        // Once more, because the first projection may have cancelled digits.
        let unit = projected(rest.normalize()).normalize();
        u.set_column(column, &unit);
    }
}

/// Where U and V' of a compact decomposition go.
struct Factors {
    u: *mut f64,
    leading_u: *const c_int,
    v: *mut f64,
    leading_v: *const c_int,
}

/// Writes the singular values, and U and V' if the letters are S; other letters than S and N are refused.
///
/// # Safety
/// All pointers are valid as LAPACK's singular value decompositions demand.
unsafe fn decompose(
    (job_u, job_v): (*const c_char, *const c_char),
    matrix: DMatrix<f64>,
    s: *mut f64,
    factors: Factors,
    info: *mut c_int,
) {
    // SAFETY: promised by the caller.
    unsafe {
        let (job_u, job_v) = (letter(job_u), letter(job_v));
        if let Some(refused) = [job_u, job_v].iter().position(|job| !matches!(job, b'S' | b'N')) {
            *info = -1 - refused as c_int;
            return;
        }
        let decomposition = CompactDecomposition::new(&matrix);
        store_vector(s, &decomposition.s, &ADJACENT);
        if job_u == b'S' {
            store(factors.u, size(factors.leading_u), &decomposition.u, |_, _| true);
        }
        if job_v == b'S' {
            let transposed = decomposition.v.transpose();
            store(factors.v, size(factors.leading_v), &transposed, |_, _| true);
        }
        *info = 0;
    }
}

/// Singular values s of A (m x n), and with `job` S the compact U and V'. Jobs A and O are refused.
///
/// # Safety
/// All pointers are valid as the LAPACK routine of this name demands.
#[unsafe(no_mangle)]
pub(super) unsafe extern "C" fn dgesdd_(
    job: *const c_char,
    m: *const c_int,
    n: *const c_int,
    a: *mut f64,
    leading_a: *const c_int,
    s: *mut f64,
    u: *mut f64,
    leading_u: *const c_int,
    v: *mut f64,
    leading_v: *const c_int,
    work: *mut f64,
    work_length: *const c_int,
    _integer_work: *mut c_int,
    info: *mut c_int,
) {
    // SAFETY: promised by the caller.
    unsafe {
        dgesvd_(
            job,
            job,
            m,
            n,
            a,
            leading_a,
            s,
            u,
            leading_u,
            v,
            leading_v,
            work,
            work_length,
            info,
        )
    }
}

/// Singular values s of A (m x n), and with the jobs S the compact U and V'. Jobs A and O are refused.
///
/// # Safety
/// All pointers are valid as the LAPACK routine of this name demands.
#[unsafe(no_mangle)]
pub(super) unsafe extern "C" fn dgesvd_(
    job_u: *const c_char,
    job_v: *const c_char,
    m: *const c_int,
    n: *const c_int,
    a: *mut f64,
    leading_a: *const c_int,
    s: *mut f64,
    u: *mut f64,
    leading_u: *const c_int,
    v: *mut f64,
    leading_v: *const c_int,
    work: *mut f64,
    work_length: *const c_int,
    info: *mut c_int,
) {
    // SAFETY: promised by the caller.
    unsafe {
        *info = 0;
        if answered(work_length, work) {
            return;
        }
        let matrix = load(a, size(m), size(n), size(leading_a));
        let factors = Factors {
            u,
            leading_u,
            v,
            leading_v,
        };
        decompose((job_u, job_v), matrix, s, factors, info);
    }
}

#[cfg(test)]
#[path = "spectral_tests.rs"]
mod tests;
