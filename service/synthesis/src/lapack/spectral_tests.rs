use super::*;
use crate::lapack::arguments::Triangle;

fn flag(letter: u8) -> c_char {
    letter as c_char
}

fn general(rows: usize, columns: usize) -> DMatrix<f64> {
    DMatrix::from_fn(rows, columns, |i, j| {
        (1.3 * i as f64 + 0.7 * (j * j) as f64).sin()
    })
}

/// What `dsyevr_` says of one triangle, stored with a row to spare: info, eigenvalues, eigenvectors, support.
fn eigen(matrix: &DMatrix<f64>, uplo: u8, range: u8) -> (c_int, DVector<f64>, DMatrix<f64>, Vec<c_int>) {
    let n = matrix.nrows();
    let triangle = if uplo == b'U' {
        Triangle::Upper
    } else {
        Triangle::Lower
    };
    let mut a = DMatrix::from_fn(n + 1, n, |i, j| match i < n && triangle.holds(i, j) {
        true => matrix[(i, j)],
        false => 1e9,
    });
    let (mut w, mut z) = (DVector::zeros(n), DMatrix::zeros(n, n));
    let mut support = vec![0; 2 * n];
    let (mut work, mut integer_work) = ([-9.0], [-9]);
    let (mut found, mut info) = (0, -9);
    for length in [QUERY, 1] {
        // SAFETY: the storage has the stated dimensions.
        unsafe {
            dsyevr_(
                &flag(b'V'),
                &flag(range),
                &flag(uplo),
                &(n as c_int),
                a.as_mut_ptr(),
                &(n as c_int + 1),
                &0.0,
                &0.0,
                &0,
                &0,
                &-1.0,
                &mut found,
                w.as_mut_ptr(),
                z.as_mut_ptr(),
                &(n as c_int),
                support.as_mut_ptr(),
                work.as_mut_ptr(),
                &length,
                integer_work.as_mut_ptr(),
                &length,
                &mut info,
            );
        }
        if range == b'A' {
            assert_eq!((work, integer_work), ([1.0], [1]), "the work space asked for");
        }
    }
    if range == b'A' {
        assert_eq!(found, n as c_int);
    }
    (info, w, z, support)
}

#[test]
fn dsyevr_gives_ascending_eigenvalues_and_their_vectors_from_either_triangle() {
    let full = general(5, 5);
    let matrix = &full + full.transpose();
    for uplo in [b'U', b'L'] {
        let (info, w, z, support) = eigen(&matrix, uplo, b'A');
        assert_eq!(info, 0);
        assert!(w.as_slice().is_sorted_by(|left, right| left <= right));
        assert!((z.transpose() * &z - DMatrix::identity(5, 5)).amax() < 1e-13);
        assert!((&matrix * &z - &z * DMatrix::from_diagonal(&w)).amax() < 1e-13);
        assert_eq!(support, [1, 5, 1, 5, 1, 5, 1, 5, 1, 5]);
    }
    assert_eq!(
        eigen(&matrix, b'U', b'I').0,
        -2,
        "part of the spectrum is not offered"
    );
}

#[test]
fn dsyevr_ends_on_entries_that_are_not_finite() {
    for entry in [f64::NAN, f64::INFINITY] {
        let mut matrix = general(4, 4);
        matrix[(1, 1)] = entry;
        let (info, w, ..) = eigen(&matrix, b'U', b'A');
        assert!(info == 0 && w.iter().all(|value| value.is_nan()));
    }
}

type Values = (c_int, DVector<f64>, DMatrix<f64>, DMatrix<f64>);

/// What the routines say of a matrix that is stored with a row to spare: info, s, U, V'.
fn singular(matrix: &DMatrix<f64>, job: u8, divide: bool) -> Values {
    let (m, n) = matrix.shape();
    let rank = m.min(n);
    let mut a = matrix.clone().resize(m + 1, n, 1e9);
    let (mut s, mut u, mut v) = (
        DVector::zeros(rank),
        DMatrix::zeros(m + 2, rank),
        DMatrix::zeros(rank + 1, n),
    );
    let (m, n) = (m as c_int, n as c_int);
    let (mut work, mut integer_work, mut info) = ([-9.0], vec![0; 8 * rank], -9);
    for length in [QUERY, 1] {
        let (leading_a, leading_u, leading_v) = (m + 1, m + 2, rank as c_int + 1);
        // SAFETY: the storage has the stated dimensions.
        unsafe {
            match divide {
                true => dgesdd_(
                    &flag(job),
                    &m,
                    &n,
                    a.as_mut_ptr(),
                    &leading_a,
                    s.as_mut_ptr(),
                    u.as_mut_ptr(),
                    &leading_u,
                    v.as_mut_ptr(),
                    &leading_v,
                    work.as_mut_ptr(),
                    &length,
                    integer_work.as_mut_ptr(),
                    &mut info,
                ),
                false => dgesvd_(
                    &flag(job),
                    &flag(job),
                    &m,
                    &n,
                    a.as_mut_ptr(),
                    &leading_a,
                    s.as_mut_ptr(),
                    u.as_mut_ptr(),
                    &leading_u,
                    v.as_mut_ptr(),
                    &leading_v,
                    work.as_mut_ptr(),
                    &length,
                    &mut info,
                ),
            }
        }
        assert_eq!(work, [1.0], "the work space asked for");
    }
    let (u, v) = (u.rows(0, m as usize).into_owned(), v.rows(0, rank).into_owned());
    (info, s, u, v)
}

#[test]
fn both_singular_value_decompositions_are_compact_and_descending() {
    let mut deficient = general(5, 4);
    deficient.set_column(2, &(deficient.column(0) * 2.0));
    let matrices = [
        general(5, 5),
        general(6, 4),
        general(4, 7),
        deficient,
        DMatrix::zeros(4, 4),
        DMatrix::from_element(4, 4, 1.0),
    ];
    for matrix in &matrices {
        for divide in [true, false] {
            let (info, s, u, v) = singular(matrix, b'S', divide);
            assert_eq!(info, 0);
            assert!(s.as_slice().is_sorted_by(|left, right| left >= right) && s.min() >= 0.0);
            let identity = DMatrix::<f64>::identity(s.len(), s.len());
            assert!((u.tr_mul(&u) - &identity).amax() < 1e-13, "{u}");
            assert!((&v * v.transpose() - &identity).amax() < 1e-13, "{v}");
            assert!((u * DMatrix::from_diagonal(&s) * v - matrix).amax() < 1e-13);
            assert!((s - singular(matrix, b'N', divide).1).amax() == 0.0);
        }
    }
}

#[test]
fn singular_values_end_on_entries_that_are_not_finite_and_refuse_full_factors() {
    let mut matrix = general(4, 4);
    assert_eq!(singular(&matrix, b'A', true).0, -1);
    matrix[(2, 1)] = f64::NAN;
    let (info, s, ..) = singular(&matrix, b'S', true);
    assert!(info == 0 && s.iter().any(|value| value.is_nan()));
}
