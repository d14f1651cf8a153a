//! Products of a small matrix with rows of many columns, and the row sums of their absolute values.
//!
//! | symbol | here | shape |
//! |---|---|---|
//! | L | `left` | m x k, small |
//! | R | `right` | k x q, long rows |
//! | M | `minuend` | m x q |

use super::Matrix;
use super::blocks::{Blocks, Difference, RowBlocks, absolute_sum_of, blocks_of, store};
use super::vectors::{LANES, Work, load, vectorised};
use pulp::Simd;
use std::array;

/// `out` = L R; `out` takes the shape of the product.
pub fn multiply(left: &Matrix, right: &Matrix, out: &mut Matrix) {
    out.reshape(left.rows(), right.columns());
    let sink = Store { out };
    vectorised(Product { left, right, sink });
}

/// `out` = M - L R; `out` takes the shape of the difference.
pub fn subtract_product(minuend: &Matrix, left: &Matrix, right: &Matrix, out: &mut Matrix) {
    out.reshape(left.rows(), right.columns());
    let sink = StoreDifference { minuend, out };
    vectorised(Product { left, right, sink });
}

/// `out` = R(L R), the row sums of |L R|, without the product itself.
pub fn product_row_sums(left: &Matrix, right: &Matrix, out: &mut [f64]) {
    let sink = Sums { out };
    vectorised(Product { left, right, sink });
}

/// `out` = R(M - L R), the row sums of |M - L R|, without the difference itself.
pub fn difference_row_sums(minuend: &Matrix, left: &Matrix, right: &Matrix, out: &mut [f64]) {
    let sink = DifferenceSums { minuend, out };
    vectorised(Product { left, right, sink });
}

/// `out` = the row sums of |`matrix`|: the radius of a generator matrix.
pub fn row_sums(matrix: &Matrix, out: &mut [f64]) {
    vectorised(RowSums { matrix, out });
}

struct RowSums<'a> {
    matrix: &'a Matrix,
    out: &'a mut [f64],
}

impl Work for RowSums<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        for (target, row) in self.out.iter_mut().zip(self.matrix.iter_rows()) {
            *target = absolute_sum_of(simd, &blocks_of(row, row.len(), &mut [0.0; LANES]));
        }
    }
}

/// L R and what becomes of its rows.
struct Product<'a, K> {
    left: &'a Matrix,
    right: &'a Matrix,
    sink: K,
}

/// What becomes of the rows of a product.
trait Sink {
    fn take<S: Simd>(&mut self, simd: S, row: usize, values: &impl Blocks<S>);
}

struct Store<'a> {
    out: &'a mut Matrix,
}

impl Sink for Store<'_> {
    #[inline(always)]
    fn take<S: Simd>(&mut self, simd: S, row: usize, values: &impl Blocks<S>) {
        store(simd, values, self.out.row_mut(row));
    }
}

struct StoreDifference<'a> {
    minuend: &'a Matrix,
    out: &'a mut Matrix,
}

impl Sink for StoreDifference<'_> {
    #[inline(always)]
    fn take<S: Simd>(&mut self, simd: S, row: usize, subtrahend: &impl Blocks<S>) {
        let mut room = [0.0; LANES];
        let minuend = blocks_of(self.minuend.row(row), subtrahend.columns(), &mut room);
        store(simd, &Difference { minuend, subtrahend }, self.out.row_mut(row));
    }
}

struct Sums<'a> {
    out: &'a mut [f64],
}

impl Sink for Sums<'_> {
    #[inline(always)]
    fn take<S: Simd>(&mut self, simd: S, row: usize, values: &impl Blocks<S>) {
        self.out[row] = absolute_sum_of(simd, values);
    }
}

struct DifferenceSums<'a> {
    minuend: &'a Matrix,
    out: &'a mut [f64],
}

impl Sink for DifferenceSums<'_> {
    #[inline(always)]
    fn take<S: Simd>(&mut self, simd: S, row: usize, subtrahend: &impl Blocks<S>) {
        let mut room = [0.0; LANES];
        let minuend = blocks_of(self.minuend.row(row), subtrahend.columns(), &mut room);
        self.out[row] = absolute_sum_of(simd, &Difference { minuend, subtrahend });
    }
}

impl<K: Sink> Work for Product<'_, K> {
    type Output = ();

    /// With k known to the compiler the coefficients of a row stay in registers.
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        match self.left.columns() {
            1 => self.run_with::<S, 1>(simd),
            2 => self.run_with::<S, 2>(simd),
            3 => self.run_with::<S, 3>(simd),
            4 => self.run_with::<S, 4>(simd),
            5 => self.run_with::<S, 5>(simd),
            6 => self.run_with::<S, 6>(simd),
            7 => self.run_with::<S, 7>(simd),
            8 => self.run_with::<S, 8>(simd),
            _ => self.run_with_any(simd),
        }
    }
}

impl<K: Sink> Product<'_, K> {
    #[inline(always)]
    fn run_with<S: Simd, const N: usize>(mut self, simd: S) {
        let mut rooms = [[0.0; LANES]; N];
        let (columns, mut next) = (self.right.columns(), 0);
        let rows = rooms.each_mut().map(
            #[inline(always)]
            |room| {
                next += 1;
                blocks_of(self.right.row(next - 1), columns, room)
            },
        );
        for i in 0..self.left.rows() {
            if let Some(coefficients) = self.left.row(i).first_chunk::<N>() {
                let coefficients = array::from_fn(
                    #[inline(always)]
                    |k| simd.splat_f64s(coefficients[k]),
                );
                self.sink.take(simd, i, &Terms::<S, N> { coefficients, rows });
            }
        }
    }

    #[inline(always)]
    fn run_with_any<S: Simd>(mut self, simd: S) {
        for i in 0..self.left.rows() {
            let coefficients = self.left.row(i);
            let right = self.right;
            self.sink.take(simd, i, &ManyTerms { coefficients, right });
        }
    }
}

/// Sum of `count` terms: the first four pairwise, then the next four, the rest one by one.
#[inline(always)]
fn sum_of_terms<S: Simd>(simd: S, count: usize, term: impl Fn(usize) -> S::f64s) -> S::f64s {
    let (mut sum, mut k) = match count {
        0 => (simd.splat_f64s(0.0), 0),
        1..4 => (term(0), 1),
        _ => (four_terms(simd, &term, 0), 4),
    };
    while k + 4 <= count {
        sum = simd.add_f64s(sum, four_terms(simd, &term, k));
        k += 4;
    }
    while k < count {
        sum = simd.add_f64s(sum, term(k));
        k += 1;
    }
    sum
}

#[inline(always)]
fn four_terms<S: Simd>(simd: S, term: &impl Fn(usize) -> S::f64s, k: usize) -> S::f64s {
    simd.add_f64s(
        simd.add_f64s(term(k), term(k + 1)),
        simd.add_f64s(term(k + 2), term(k + 3)),
    )
}

/// A row of L R with few terms.
struct Terms<'a, S: Simd, const N: usize> {
    coefficients: [S::f64s; N],
    rows: [RowBlocks<'a>; N],
}

impl<S: Simd, const N: usize> Blocks<S> for Terms<'_, S, N> {
    #[inline(always)]
    fn columns(&self) -> usize {
        self.rows.first().map_or(0, Blocks::<S>::columns)
    }

    #[inline(always)]
    fn full(&self, simd: S, j: usize) -> S::f64s {
        sum_of_terms(
            simd,
            N,
            #[inline(always)]
            |k| simd.mul_f64s(self.coefficients[k], self.rows[k].full(simd, j)),
        )
    }

    #[inline(always)]
    fn last(&self, simd: S) -> S::f64s {
        sum_of_terms(
            simd,
            N,
            #[inline(always)]
            |k| simd.mul_f64s(self.coefficients[k], self.rows[k].last(simd)),
        )
    }
}

/// A row of L R with many terms.
struct ManyTerms<'a> {
    coefficients: &'a [f64],
    right: &'a Matrix,
}

impl<S: Simd> Blocks<S> for ManyTerms<'_> {
    #[inline(always)]
    fn columns(&self) -> usize {
        self.right.columns()
    }

    #[inline(always)]
    fn full(&self, simd: S, j: usize) -> S::f64s {
        sum_of_terms(
            simd,
            self.coefficients.len(),
            #[inline(always)]
            |k| {
                let row = load::<S>(&self.right.row(k).as_chunks().0[j]);
                simd.mul_f64s(simd.splat_f64s(self.coefficients[k]), row)
            },
        )
    }

    #[inline(always)]
    fn last(&self, simd: S) -> S::f64s {
        sum_of_terms(
            simd,
            self.coefficients.len(),
            #[inline(always)]
            |k| {
                let row = blocks_of(self.right.row(k), 0, &mut [0.0; LANES]).last(simd);
                simd.mul_f64s(simd.splat_f64s(self.coefficients[k]), row)
            },
        )
    }
}

#[cfg(test)]
#[path = "products_tests.rs"]
mod tests;
