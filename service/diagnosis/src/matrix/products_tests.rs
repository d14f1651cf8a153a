//! The products against the plain loops over rows, bit for bit and on every instruction set of this machine.

use super::super::kernels::{absolute_dot, absolute_sum, combination, dot};
use super::*;
use crate::matrix::blocks::{absolute_dot_of, dot_of};
use crate::matrix::vectors::on_every_set;

/// Numbers of many sizes, with zeros of both signs; `special` mixes in what is not finite.
fn example(rows: usize, columns: usize, seed: usize, special: bool) -> Matrix {
    let mut out = Matrix::zeros(rows, columns + seed % 3);
    out.reshape(rows, columns);
    for i in 0..rows {
        for (j, value) in out.row_mut(i).iter_mut().enumerate() {
            let place = seed * 131 + i * 37 + j * 7;
            *value = (place as f64 * 0.731).sin() * 10.0_f64.powi((place % 9) as i32 - 4);
            match place % 41 {
                3 => *value = 0.0,
                17 => *value = -0.0,
                23 if special => *value = f64::INFINITY,
                29 if special => *value = f64::NEG_INFINITY,
                31 if special => *value = f64::NAN,
                _ => {}
            }
        }
    }
    out
}

fn assert_same(found: &[f64], expected: &[f64], case: &str) {
    assert_eq!(found.len(), expected.len(), "{case}");
    for (found, expected) in found.iter().zip(expected) {
        let same = found.to_bits() == expected.to_bits() || found.is_nan() && expected.is_nan();
        assert!(same, "{found} instead of {expected} {case}");
    }
}

struct Both<'a>(&'a [f64], &'a [f64]);

impl Work for Both<'_> {
    type Output = [f64; 2];

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> [f64; 2] {
        [
            dot_of(simd, self.0, self.1),
            absolute_dot_of(simd, self.0, self.1),
        ]
    }
}

/// All four products with one left factor against loops over rows.
fn compare(inner: usize, columns: usize, special: bool) {
    let (left, right) = (example(3, inner, 1, false), example(inner, columns, 2, special));
    let minuend = example(3, columns, 3, special);
    let case = format!("({inner} terms, {columns} columns, special {special})");
    let mut product = Matrix::zeros(3, columns);
    let mut difference = Matrix::zeros(3, columns);
    for i in 0..3 {
        combination(product.row_mut(i), left.row(i), &right);
        for (j, value) in difference.row_mut(i).iter_mut().enumerate() {
            *value = minuend[(i, j)] - product[(i, j)];
        }
    }
    let sums = |matrix: &Matrix| matrix.iter_rows().map(absolute_sum).collect::<Vec<_>>();
    let mut out = Matrix::with_capacity(3, columns);
    multiply(&left, &right, &mut out);
    (0..3).for_each(|i| assert_same(out.row(i), product.row(i), &case));
    subtract_product(&minuend, &left, &right, &mut out);
    (0..3).for_each(|i| assert_same(out.row(i), difference.row(i), &case));
    let mut found = [0.0; 3];
    difference_row_sums(&minuend, &left, &right, &mut found);
    assert_same(&found, &sums(&difference), &case);
    row_sums(&minuend, &mut found);
    assert_same(&found, &sums(&minuend), &case);
    let product_sums = sums(&product);
    let found = std::cell::RefCell::new([0.0; 3]);
    on_every_set(
        || SumsOf {
            left: &left,
            right: &right,
            out: &found,
        },
        |(), set| assert_same(&found.take(), &product_sums, &format!("{set} {case}")),
    );
}

/// [`product_row_sums`] with shared room for its results.
struct SumsOf<'a> {
    left: &'a Matrix,
    right: &'a Matrix,
    out: &'a std::cell::RefCell<[f64; 3]>,
}

impl Work for SumsOf<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let (left, right, mut out) = (self.left, self.right, self.out.borrow_mut());
        let sink = Sums { out: &mut *out };
        Product { left, right, sink }.run(simd);
    }
}

#[test]
fn products_have_the_bits_of_plain_loops() {
    for inner in 0..12 {
        for columns in 0..35 {
            compare(inner, columns, false);
            compare(inner, columns, true);
        }
    }
}

#[test]
fn inner_products_have_the_bits_of_plain_loops() {
    for columns in 0..70 {
        for special in [false, true] {
            let rows = example(2, columns, 5, special);
            let (x, y) = (rows.row(0), rows.row(1));
            let expected = [dot(x, y), absolute_dot(x, y)];
            on_every_set(
                || Both(x, y),
                |found, set| assert_same(&found, &expected, &format!("{set}, {columns} columns")),
            );
        }
    }
}
