//! Rows in blocks of [`LANES`] columns, the last one overlapping the one before it where the columns do not come
//! out even.

use super::vectors::{LANES, Lanes, absolute, lanes_of, load};
use pulp::Simd;

/// A row, stored or computed, in blocks.
pub(crate) trait Blocks<S: Simd> {
    /// Number q of columns.
    fn columns(&self) -> usize;

    /// Columns 8 j to 8 j + 7.
    fn full(&self, simd: S, j: usize) -> S::f64s;

    /// The last eight columns; of a shorter row all, behind zeros.
    fn last(&self, simd: S) -> S::f64s;
}

/// A stored row.
#[derive(Clone, Copy)]
pub(crate) struct RowBlocks<'a> {
    columns: usize,
    full: &'a [Lanes],
    last: &'a Lanes,
}

/// The blocks of a stored row of `columns` columns; `room` takes those of one that is shorter than a block.
#[inline(always)]
pub(crate) fn blocks_of<'a>(row: &'a [f64], columns: usize, room: &'a mut Lanes) -> RowBlocks<'a> {
    let last = match row.last_chunk() {
        Some(last) => last,
        None => {
            room[LANES - row.len()..].copy_from_slice(row);
            room
        }
    };
    RowBlocks {
        columns,
        // Rows of one length: one check suffices for all of them.
        full: &row.as_chunks().0[..columns / LANES],
        last,
    }
}

impl<S: Simd> Blocks<S> for RowBlocks<'_> {
    #[inline(always)]
    fn columns(&self) -> usize {
        self.columns
    }

    #[inline(always)]
    fn full(&self, _simd: S, j: usize) -> S::f64s {
        load::<S>(&self.full[j])
    }

    #[inline(always)]
    fn last(&self, _simd: S) -> S::f64s {
        load::<S>(self.last)
    }
}

/// `minuend` - `subtrahend`.
pub(crate) struct Difference<'a, M, B> {
    pub minuend: M,
    pub subtrahend: &'a B,
}

impl<S: Simd, M: Blocks<S>, B: Blocks<S>> Blocks<S> for Difference<'_, M, B> {
    #[inline(always)]
    fn columns(&self) -> usize {
        self.subtrahend.columns()
    }

    #[inline(always)]
    fn full(&self, simd: S, j: usize) -> S::f64s {
        simd.sub_f64s(self.minuend.full(simd, j), self.subtrahend.full(simd, j))
    }

    #[inline(always)]
    fn last(&self, simd: S) -> S::f64s {
        simd.sub_f64s(self.minuend.last(simd), self.subtrahend.last(simd))
    }
}

/// Writes a row; `out` has its length.
#[inline(always)]
pub(crate) fn store<S: Simd>(simd: S, values: &impl Blocks<S>, out: &mut [f64]) {
    let columns = values.columns();
    for (j, target) in out.as_chunks_mut().0[..columns / LANES].iter_mut().enumerate() {
        *target = lanes_of::<S>(values.full(simd, j));
    }
    if columns.is_multiple_of(LANES) {
        return;
    }
    let last = lanes_of::<S>(values.last(simd));
    match out.last_chunk_mut() {
        Some(target) => *target = last,
        None => out.copy_from_slice(&last[LANES - columns..]),
    }
}

/// Sum of the absolute values of a row, in the order of [`super::absolute_sum`].
#[inline(always)]
pub(crate) fn absolute_sum_of<S: Simd>(simd: S, values: &impl Blocks<S>) -> f64 {
    let columns = values.columns();
    let mut partial = simd.splat_f64s(0.0);
    for j in 0..columns / LANES {
        partial = simd.add_f64s(partial, absolute(simd, values.full(simd, j)));
    }
    let sum = joined(lanes_of::<S>(partial));
    if columns.is_multiple_of(LANES) {
        return sum;
    }
    let last = lanes_of::<S>(absolute(simd, values.last(simd)));
    sum + last[LANES - columns % LANES..].iter().sum::<f64>()
}

/// Inner product of two rows, in the order of [`super::dot`].
#[inline(always)]
pub(crate) fn dot_of<S: Simd>(simd: S, x: &[f64], y: &[f64]) -> f64 {
    sum_of(
        simd,
        (x, y),
        #[inline(always)]
        |x, y| simd.mul_f64s(x, y),
        |x, y| x * y,
    )
}

/// Sum of |x_i| y_i, in the order of [`super::absolute_dot`].
#[inline(always)]
pub(crate) fn absolute_dot_of<S: Simd>(simd: S, x: &[f64], y: &[f64]) -> f64 {
    sum_of(
        simd,
        (x, y),
        #[inline(always)]
        |x, y| simd.mul_f64s(absolute(simd, x), y),
        |x, y| x.abs() * y,
    )
}

#[inline(always)]
fn sum_of<S: Simd>(
    simd: S,
    (x, y): (&[f64], &[f64]),
    term: impl Fn(S::f64s, S::f64s) -> S::f64s,
    last_term: impl Fn(f64, f64) -> f64,
) -> f64 {
    let ((x, x_rest), (y, y_rest)) = (x.as_chunks(), y.as_chunks());
    let mut partial = simd.splat_f64s(0.0);
    for (x, y) in x.iter().zip(y) {
        partial = simd.add_f64s(partial, term(load::<S>(x), load::<S>(y)));
    }
    let tail: f64 = x_rest.iter().zip(y_rest).map(|(x, y)| last_term(*x, *y)).sum();
    joined(lanes_of::<S>(partial)) + tail
}

/// The sum of independent partial sums.
#[inline(always)]
pub(crate) fn joined([a, b, c, d, e, f, g, h]: Lanes) -> f64 {
    ((a + e) + (b + f)) + ((c + g) + (d + h))
}
