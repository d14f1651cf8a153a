//! Arguments of Fortran routines: everything is a pointer, matrices are stored column by column with a leading
//! dimension that is at least their number of rows.

use nalgebra::{DMatrix, DVector};
use std::ffi::{c_char, c_int};

/// Which triangle of a symmetric matrix is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Triangle {
    Upper,
    Lower,
}

impl Triangle {
    /// Whether entry (i, j) belongs to it.
    pub(super) fn holds(self, i: usize, j: usize) -> bool {
        match self {
            Self::Upper => i <= j,
            Self::Lower => i >= j,
        }
    }

    /// The symmetric matrix whose triangle is stored in `matrix`.
    pub(super) fn completed(self, matrix: &DMatrix<f64>) -> DMatrix<f64> {
        DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |i, j| match self.holds(i, j) {
            true => matrix[(i, j)],
            false => matrix[(j, i)],
        })
    }
}

/// The option letter, in upper case.
///
/// # Safety
/// `pointer` is valid for reading one character.
pub(super) unsafe fn letter(pointer: *const c_char) -> u8 {
    // SAFETY: promised by the caller.
    (unsafe { pointer.read() } as u8).to_ascii_uppercase()
}

/// The triangle that the letter U or L stands for.
///
/// # Safety
/// `pointer` is valid for reading one character.
pub(super) unsafe fn triangle(pointer: *const c_char) -> Triangle {
    // SAFETY: promised by the caller.
    match unsafe { letter(pointer) } {
        b'U' => Triangle::Upper,
        _ => Triangle::Lower,
    }
}

/// A dimension; negative ones count as 0.
///
/// # Safety
/// `pointer` is valid for reading one integer.
pub(super) unsafe fn size(pointer: *const c_int) -> usize {
    // SAFETY: promised by the caller.
    usize::try_from(unsafe { pointer.read() }).unwrap_or(0)
}

/// Copies a matrix in.
///
/// # Safety
/// `pointer` is valid for reading `rows` entries at the start of each of `columns` columns, `leading` apart.
pub(super) unsafe fn load(pointer: *const f64, rows: usize, columns: usize, leading: usize) -> DMatrix<f64> {
    // SAFETY: promised by the caller.
    DMatrix::from_fn(rows, columns, |i, j| unsafe {
        pointer.add(i + j * leading).read()
    })
}

/// Copies the entries out that `written` selects.
///
/// # Safety
/// `pointer` is valid for writing the selected entries, columns being `leading` apart.
pub(super) unsafe fn store(
    pointer: *mut f64,
    leading: usize,
    matrix: &DMatrix<f64>,
    written: impl Fn(usize, usize) -> bool,
) {
    for j in 0..matrix.ncols() {
        for i in (0..matrix.nrows()).filter(|&i| written(i, j)) {
            // SAFETY: promised by the caller.
            unsafe { pointer.add(i + j * leading).write(matrix[(i, j)]) };
        }
    }
}

/// Where entry `i` of a vector lies: a negative increment counts from its end.
fn place(i: usize, length: usize, increment: isize) -> isize {
    match increment < 0 {
        true => (i as isize + 1 - length as isize) * increment,
        false => i as isize * increment,
    }
}

/// Copies a vector in.
///
/// # Safety
/// `increment` is valid for reading, and `pointer` for reading `length` entries that are that far apart.
pub(super) unsafe fn load_vector(
    pointer: *const f64,
    length: usize,
    increment: *const c_int,
) -> DVector<f64> {
    // SAFETY: promised by the caller.
    let increment = unsafe { increment.read() } as isize;
    // SAFETY: promised by the caller.
    DVector::from_fn(length, |i, _| unsafe {
        pointer.offset(place(i, length, increment)).read()
    })
}

/// Copies a vector out.
///
/// # Safety
/// As [`load_vector`], for writing.
pub(super) unsafe fn store_vector(pointer: *mut f64, vector: &DVector<f64>, increment: *const c_int) {
    // SAFETY: promised by the caller.
    let increment = unsafe { increment.read() } as isize;
    for (i, value) in vector.iter().enumerate() {
        // SAFETY: promised by the caller.
        unsafe { pointer.offset(place(i, vector.len(), increment)).write(*value) };
    }
}
