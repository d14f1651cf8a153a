use super::*;
use crate::lapack::arguments::Triangle;

/// A matrix without structure.
fn sample(rows: usize, columns: usize, seed: f64) -> DMatrix<f64> {
    DMatrix::from_fn(rows, columns, |i, j| {
        (seed + 1.7 * i as f64 + 0.9 * (j * j) as f64).sin()
    })
}

/// Storage with `leading` rows, more than the matrix has; the rest is not a number, so that using it shows.
fn stored(matrix: &DMatrix<f64>, leading: usize) -> Vec<f64> {
    let mut storage = vec![f64::NAN; leading * matrix.ncols()];
    for j in 0..matrix.ncols() {
        for i in 0..matrix.nrows() {
            storage[i + j * leading] = matrix[(i, j)];
        }
    }
    storage
}

fn assert_stored(storage: &[f64], leading: usize, expected: &DMatrix<f64>) {
    for (place, value) in storage.iter().enumerate() {
        let (i, j) = (place % leading, place / leading);
        match i < expected.nrows() {
            true => assert!((value - expected[(i, j)]).abs() < 1e-13, "({i}, {j})"),
            false => assert!(value.is_nan(), "({i}, {j}) is beyond the matrix"),
        }
    }
}

/// One triangle, the other one not a number.
fn half(matrix: &DMatrix<f64>, triangle: Triangle) -> DMatrix<f64> {
    DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |i, j| {
        match triangle.holds(i, j) {
            true => matrix[(i, j)],
            false => f64::NAN,
        }
    })
}

fn flag(letter: u8) -> c_char {
    letter as c_char
}

fn operand_of(matrix: &DMatrix<f64>, transpose: u8) -> DMatrix<f64> {
    if transpose == b'N' {
        matrix.clone()
    } else {
        matrix.transpose()
    }
}

#[test]
fn dgemm_multiplies_with_any_transposes_and_leading_dimensions() {
    let (m, n, k) = (7, 6, 8);
    for (transpose_a, transpose_b) in [(b'N', b'N'), (b'T', b'n'), (b'N', b'T'), (b't', b'C')] {
        let (a, b, c) = (sample(m, k, 1.0), sample(k, n, 2.0), sample(m, n, 3.0));
        let a_given = operand_of(&a, transpose_a.to_ascii_uppercase());
        let b_given = operand_of(&b, transpose_b.to_ascii_uppercase());
        let (leading_a, leading_b, leading_c) = (a_given.nrows() + 2, b_given.nrows() + 1, m + 3);
        for (alpha, beta) in [(1.0, 0.0), (-0.5, 2.0), (0.0, 1.0)] {
            // β = 0 must not look at C.
            let start = if beta == 0.0 { &c * f64::NAN } else { c.clone() };
            let mut result = stored(&start, leading_c);
            let (a_stored, b_stored) = (stored(&a_given, leading_a), stored(&b_given, leading_b));
            // SAFETY: the storage has the stated dimensions.
            unsafe {
                dgemm_(
                    &flag(transpose_a),
                    &flag(transpose_b),
                    &(m as c_int),
                    &(n as c_int),
                    &(k as c_int),
                    &alpha,
                    a_stored.as_ptr(),
                    &(leading_a as c_int),
                    b_stored.as_ptr(),
                    &(leading_b as c_int),
                    &beta,
                    result.as_mut_ptr(),
                    &(leading_c as c_int),
                );
            }
            assert_stored(&result, leading_c, &(&a * &b * alpha + &c * beta));
        }
    }
}

#[test]
fn dgemv_and_dsymv_multiply_vectors_with_any_increments() {
    let (m, n, leading) = (5_usize, 3_usize, 9_usize);
    let matrix = sample(m, n, 0.4);
    let storage = stored(&matrix, leading);
    for (transpose, expected) in [(b'N', matrix.clone()), (b'T', matrix.transpose())] {
        let x = DVector::from_fn(expected.ncols(), |i, _| i as f64 - 0.3);
        let y = DVector::from_fn(expected.nrows(), |i, _| 1.0 + i as f64);
        let spaced: Vec<f64> = x.iter().flat_map(|&value| [value, f64::NAN]).collect();
        let mut reversed: Vec<f64> = y.iter().rev().copied().collect();
        // SAFETY: the storage has the stated dimensions and increments.
        unsafe {
            dgemv_(
                &flag(transpose),
                &(m as c_int),
                &(n as c_int),
                &2.0,
                storage.as_ptr(),
                &(leading as c_int),
                spaced.as_ptr(),
                &2,
                &-1.0,
                reversed.as_mut_ptr(),
                &-1,
            );
        }
        reversed.reverse();
        let expected = expected * x * 2.0 - y;
        assert!((DVector::from_vec(reversed) - expected).amax() < 1e-13);
    }
    let full = sample(n, n, 0.7);
    let symmetric = &full + full.transpose();
    let x = DVector::from_fn(n, |i, _| i as f64 + 0.3);
    for (letter, triangle) in [(b'U', Triangle::Upper), (b'L', Triangle::Lower)] {
        let storage = stored(&half(&symmetric, triangle), leading);
        let mut y = vec![f64::NAN; n];
        // SAFETY: the storage has the stated dimensions and increments.
        unsafe {
            dsymv_(
                &flag(letter),
                &(n as c_int),
                &3.0,
                storage.as_ptr(),
                &(leading as c_int),
                x.as_ptr(),
                &1,
                &0.0,
                y.as_mut_ptr(),
                &1,
            );
        }
        assert!((DVector::from_vec(y) - &symmetric * &x * 3.0).amax() < 1e-13);
    }
}

#[test]
fn dsyrk_and_dsyr2k_write_the_triangle_asked_for_and_nothing_else() {
    let (n, k, leading) = (6, 4, 8);
    let (a, b) = (sample(n, k, 0.2), sample(n, k, 1.3));
    let old = sample(n, n, 4.0);
    let products = [&a * a.transpose(), &a * b.transpose() + &b * a.transpose()];
    for (letter, triangle) in [(b'U', Triangle::Upper), (b'L', Triangle::Lower)] {
        for transpose in [b'N', b'T'] {
            let (a_given, b_given) = (operand_of(&a, transpose), operand_of(&b, transpose));
            let leading_a = a_given.nrows() + 1;
            let (a_stored, b_stored) = (stored(&a_given, leading_a), stored(&b_given, leading_a));
            let mut results = [stored(&old, leading), stored(&old, leading)];
            // SAFETY: the storage has the stated dimensions.
            unsafe {
                dsyrk_(
                    &flag(letter),
                    &flag(transpose),
                    &(n as c_int),
                    &(k as c_int),
                    &1.5,
                    a_stored.as_ptr(),
                    &(leading_a as c_int),
                    &0.5,
                    results[0].as_mut_ptr(),
                    &(leading as c_int),
                );
                dsyr2k_(
                    &flag(letter),
                    &flag(transpose),
                    &(n as c_int),
                    &(k as c_int),
                    &1.5,
                    a_stored.as_ptr(),
                    &(leading_a as c_int),
                    b_stored.as_ptr(),
                    &(leading_a as c_int),
                    &0.5,
                    results[1].as_mut_ptr(),
                    &(leading as c_int),
                );
            }
            for (result, product) in results.iter().zip(&products) {
                let expected = DMatrix::from_fn(n, n, |i, j| match triangle.holds(i, j) {
                    true => 1.5 * product[(i, j)] + 0.5 * old[(i, j)],
                    false => old[(i, j)],
                });
                assert_stored(result, leading, &expected);
            }
        }
    }
}
