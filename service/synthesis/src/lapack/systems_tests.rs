use super::*;

const ORDER: usize = 6;
const LEADING: usize = 8;

fn flag(letter: u8) -> c_char {
    letter as c_char
}

/// Storage with two rows more than the matrix has; they hold 7.
fn stored(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    matrix.clone().resize(LEADING, matrix.ncols(), 7.0)
}

fn general(order: usize) -> DMatrix<f64> {
    DMatrix::from_fn(order, order, |i, j| (1.3 * i as f64 + 0.7 * (j * j) as f64).sin())
}

fn right_hand_side() -> DMatrix<f64> {
    DMatrix::from_fn(ORDER, 2, |i, j| i as f64 - 3.0 * j as f64)
}

#[test]
fn dpotrf_factors_the_stored_triangle_and_dpotrs_solves_with_it() {
    let definite = general(ORDER) * general(ORDER).transpose() + DMatrix::identity(ORDER, ORDER);
    let lower = definite.clone().cholesky().unwrap().l();
    for (letter, triangle) in [(b'U', Triangle::Upper), (b'L', Triangle::Lower)] {
        let mut a = stored(&definite);
        let mut b = stored(&right_hand_side());
        let (order, leading) = (ORDER as c_int, LEADING as c_int);
        let mut info = -1;
        // SAFETY: the storage has the stated dimensions.
        unsafe { dpotrf_(&flag(letter), &order, a.as_mut_ptr(), &leading, &mut info) };
        assert_eq!(info, 0);
        let factor = if letter == b'L' {
            lower.clone()
        } else {
            lower.transpose()
        };
        for j in 0..ORDER {
            for i in 0..LEADING {
                let expected = match i < ORDER {
                    true if triangle.holds(i, j) => factor[(i, j)],
                    true => definite[(i, j)],
                    false => 7.0,
                };
                assert!((a[(i, j)] - expected).abs() < 1e-13, "{letter} ({i}, {j})");
            }
        }
        // SAFETY: the storage has the stated dimensions.
        unsafe {
            dpotrs_(
                &flag(letter),
                &order,
                &2,
                a.as_ptr(),
                &leading,
                b.as_mut_ptr(),
                &leading,
                &mut info,
            );
        }
        assert_eq!(info, 0);
        let x = b.rows(0, ORDER).into_owned();
        assert!((&definite * x - right_hand_side()).amax() < 1e-12);
        assert!(b.rows(ORDER, 2).iter().all(|&entry| entry == 7.0));
    }
}

#[test]
fn dpotrf_names_the_first_minor_that_is_not_positive() {
    for (entry, expected) in [(-1.0, 3), (f64::NAN, 3), (f64::INFINITY, 3), (0.0, 3)] {
        let mut a = DMatrix::<f64>::identity(4, 4);
        a[(2, 2)] = entry;
        let mut info = 0;
        // SAFETY: the storage has the stated dimensions.
        unsafe { dpotrf_(&flag(b'L'), &4, a.as_mut_ptr(), &4, &mut info) };
        assert_eq!(info, expected, "{entry}");
    }
}

#[test]
fn dgesv_solves_general_systems_and_returns_its_factors() {
    let mut matrix = general(ORDER) + DMatrix::identity(ORDER, ORDER);
    matrix[(0, 0)] = 0.0; // demands an exchange of rows
    let (mut a, mut b) = (stored(&matrix), stored(&right_hand_side()));
    let mut pivots = [0; ORDER];
    let mut info = -1;
    // SAFETY: the storage has the stated dimensions.
    unsafe {
        dgesv_(
            &(ORDER as c_int),
            &2,
            a.as_mut_ptr(),
            &(LEADING as c_int),
            pivots.as_mut_ptr(),
            b.as_mut_ptr(),
            &(LEADING as c_int),
            &mut info,
        );
    }
    assert_eq!(info, 0);
    let x = b.rows(0, ORDER).into_owned();
    assert!((&matrix * x - right_hand_side()).amax() < 1e-11);
    let factors = a.rows(0, ORDER).into_owned();
    let unit_lower = factors.lower_triangle() - DMatrix::from_diagonal(&factors.diagonal())
        + DMatrix::identity(ORDER, ORDER);
    let mut permuted = matrix;
    for (row, &other) in pivots.iter().enumerate() {
        permuted.swap_rows(row, other as usize - 1);
    }
    assert!((unit_lower * factors.upper_triangle() - permuted).amax() < 1e-13);
}

#[test]
fn dgesv_names_the_zero_pivot_of_a_singular_matrix() {
    let mut a = DMatrix::from_row_slice(2, 2, &[1.0, 2.0, 2.0, 4.0]);
    let (mut b, mut pivots, mut info) = ([1.0, 1.0], [0; 2], 0);
    // SAFETY: the storage has the stated dimensions.
    unsafe {
        dgesv_(
            &2,
            &1,
            a.as_mut_ptr(),
            &2,
            pivots.as_mut_ptr(),
            b.as_mut_ptr(),
            &2,
            &mut info,
        );
    }
    assert_eq!(info, 2);
}
