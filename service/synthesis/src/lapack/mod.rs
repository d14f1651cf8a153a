//! The eleven BLAS and LAPACK routines that Clarabel's semidefinite cones call, in Rust.
//!
//! Clarabel declares them with the calling convention of Fortran and leaves it to the program to link an
//! implementation. The usual ones are system libraries or take minutes to compile; our matrices have fewer than a
//! hundred rows, and for them nalgebra and Jacobi rotations suffice. Every routine copies its arguments in, computes
//! on owned matrices, and copies the results out, so that the pointers stay in [`arguments`].
//!
//! | routine | result |
//! |---|---|
//! | `dgemm_` | C = α op(A) op(B) + β C |
//! | `dgemv_`, `dsymv_` | y = α op(A) x + β y, also of a symmetric A given by one triangle |
//! | `dsyrk_`, `dsyr2k_` | one triangle of α op(A) op(A)' + β C, of α (A B' + B A') + β C |
//! | `dpotrf_`, `dpotrs_` | Cholesky factor of one triangle, and solutions with it |
//! | `dgesv_` | solutions of a general square system |
//! | `dsyevr_` | all eigenvalues of a symmetric matrix, ascending, with vectors on request |
//! | `dgesdd_`, `dgesvd_` | singular values, descending, with the compact U and V' on request |
//!
//! The decompositions end on every input: where a matrix has entries that are not finite, their results are not
//! numbers and `info` is 0, because Clarabel 0.11 panics on any other `info` of theirs. Its next Cholesky
//! factorisation then fails, and it stops with a numerical error.

// The routines exist for callers across a foreign function interface: pointers are their only kind of argument.
#![allow(unsafe_code)]

mod arguments;
mod products;
mod spectral;
mod systems;

use std::hint::black_box;

/// Refers to every routine. Whoever calls this has them all linked into his binary, in front of the solver.
pub(crate) fn link() {
    let routines: [*const (); 11] = [
        products::dgemm_ as *const (),
        products::dgemv_ as *const (),
        products::dsymv_ as *const (),
        products::dsyrk_ as *const (),
        products::dsyr2k_ as *const (),
        systems::dpotrf_ as *const (),
        systems::dpotrs_ as *const (),
        systems::dgesv_ as *const (),
        spectral::dsyevr_ as *const (),
        spectral::dgesdd_ as *const (),
        spectral::dgesvd_ as *const (),
    ];
    black_box(routines);
}
