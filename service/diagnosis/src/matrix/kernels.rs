//! The few products and sums that the online step needs.

use super::Matrix;
use super::blocks::{dot_of, joined};
use super::vectors::{LANES, Work, vectorised};
use pulp::Simd;

/// Sum of `term(x_i, y_i)` in a fixed order with independent partial sums.
#[inline(always)]
fn sum_of(x: &[f64], y: &[f64], term: impl Fn(f64, f64) -> f64) -> f64 {
    if x.len() < LANES {
        // All partial sums are zero.
        return 0.0 + x.iter().zip(y).map(|(a, b)| term(*a, *b)).sum::<f64>();
    }
    let mut partial = [0.0; LANES];
    let (x_blocks, y_blocks) = (x.chunks_exact(LANES), y.chunks_exact(LANES));
    let tail: f64 = x_blocks
        .remainder()
        .iter()
        .zip(y_blocks.remainder())
        .map(|(a, b)| term(*a, *b))
        .sum();
    for (a, b) in x_blocks.zip(y_blocks) {
        for lane in 0..LANES {
            partial[lane] += term(a[lane], b[lane]);
        }
    }
    joined(partial) + tail
}

/// Inner product of two slices of one length.
#[inline]
pub fn dot(x: &[f64], y: &[f64]) -> f64 {
    sum_of(x, y, |a, b| a * b)
}

/// Sum of |x_i|.
#[inline]
pub fn absolute_sum(x: &[f64]) -> f64 {
    sum_of(x, x, |a, _| a.abs())
}

/// Sum of |x_i| y_i.
#[inline]
pub fn absolute_dot(x: &[f64], y: &[f64]) -> f64 {
    sum_of(x, y, |a, b| a.abs() * b)
}

/// `out` += `factor` x.
#[inline]
pub fn add_scaled(out: &mut [f64], factor: f64, x: &[f64]) {
    for (target, value) in out.iter_mut().zip(x) {
        *target += factor * value;
    }
}

/// Sum of `c[k]` times row `first + k` of `source`, combined with what is in `out` by `join`.
#[inline(always)]
fn join_four(out: &mut [f64], c: &[f64], source: &Matrix, first: usize, join: impl Fn(f64, f64) -> f64) {
    let width = out.len();
    let (r0, r1) = (&source.row(first)[..width], &source.row(first + 1)[..width]);
    let (r2, r3) = (&source.row(first + 2)[..width], &source.row(first + 3)[..width]);
    let (c0, c1, c2, c3) = (c[0], c[1], c[2], c[3]);
    for i in 0..width {
        out[i] = join(out[i], (c0 * r0[i] + c1 * r1[i]) + (c2 * r2[i] + c3 * r3[i]));
    }
}

/// `out` += sum over k of `coefficients`\[k\] times row k of `source`.
#[inline]
pub fn add_combination(out: &mut [f64], coefficients: &[f64], source: &Matrix) {
    add_from(out, coefficients, source, 0);
}

fn add_from(out: &mut [f64], coefficients: &[f64], source: &Matrix, first: usize) {
    let mut k = first;
    while k + 4 <= coefficients.len() {
        join_four(out, &coefficients[k..k + 4], source, k, |sum, term| sum + term);
        k += 4;
    }
    for (k, factor) in coefficients.iter().enumerate().skip(k) {
        add_scaled(out, *factor, source.row(k));
    }
}

/// `out` = sum over k of `coefficients`\[k\] times row k of `source`.
#[inline]
pub fn combination(out: &mut [f64], coefficients: &[f64], source: &Matrix) {
    match coefficients {
        [] => out.fill(0.0),
        [first] | [first, _] | [first, _, _] => {
            for (target, value) in out.iter_mut().zip(source.row(0)) {
                *target = first * value;
            }
            add_from(out, coefficients, source, 1);
        }
        _ => {
            join_four(out, &coefficients[..4], source, 0, |_, term| term);
            add_from(out, coefficients, source, 4);
        }
    }
}

/// `out` = `left` `right`'; `out` takes the shape of the product.
pub fn multiply_transposed(left: &Matrix, right: &Matrix, out: &mut Matrix) {
    out.reshape(left.rows(), right.rows());
    vectorised(InnerProducts { left, right, out });
}

/// The lower triangle of `out` = `matrix` `matrix`'; what lies above is left.
pub fn lower_gram(matrix: &Matrix, out: &mut Matrix) {
    out.reshape(matrix.rows(), matrix.rows());
    vectorised(Gram { matrix, out });
}

struct InnerProducts<'a> {
    left: &'a Matrix,
    right: &'a Matrix,
    out: &'a mut Matrix,
}

impl Work for InnerProducts<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        for i in 0..self.left.rows() {
            let row = self.left.row(i);
            for (j, value) in self.out.row_mut(i).iter_mut().enumerate() {
                *value = dot_of(simd, row, self.right.row(j));
            }
        }
    }
}

struct Gram<'a> {
    matrix: &'a Matrix,
    out: &'a mut Matrix,
}

impl Work for Gram<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        for i in 0..self.matrix.rows() {
            let row = self.matrix.row(i);
            for (j, value) in self.out.row_mut(i)[..=i].iter_mut().enumerate() {
                *value = dot_of(simd, row, self.matrix.row(j));
            }
        }
    }
}

/// `out` = `matrix` x.
#[inline]
pub fn apply(matrix: &Matrix, x: &[f64], out: &mut [f64]) {
    for (target, row) in out.iter_mut().zip(matrix.iter_rows()) {
        *target = dot(row, x);
    }
}

/// Whether every element is finite.
pub fn all_finite(values: &[f64]) -> bool {
    values.iter().all(|value| value.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::matrix::multiply;

    fn example(rows: usize, columns: usize, seed: f64) -> Matrix {
        let mut out = Matrix::zeros(rows, columns);
        for i in 0..rows {
            for j in 0..columns {
                out[(i, j)] = (seed * (1 + i * columns + j) as f64).sin();
            }
        }
        out
    }

    #[test]
    fn the_kernels_agree_with_the_plain_formulas() {
        for inner in 0..11 {
            let (left, right) = (example(3, inner, 0.7), example(inner, 19, 1.3));
            let mut product = Matrix::with_capacity(3, 19);
            multiply(&left, &right, &mut product);
            let expected = left.to_dense() * right.to_dense();
            assert!((product.to_dense() - &expected).amax() < 1e-14);
            let mut again = Matrix::with_capacity(3, 19);
            multiply_transposed(&left, &right.transpose(), &mut again);
            assert!((again.to_dense() - expected).amax() < 1e-14);
        }
    }

    #[test]
    fn absolute_sums_count_every_element_once() {
        for length in 0..40 {
            let values: Vec<f64> = (0..length).map(|i| if i % 2 == 0 { 1.0 } else { -1.0 }).collect();
            assert_eq!(absolute_sum(&values), length as f64);
        }
    }
}
