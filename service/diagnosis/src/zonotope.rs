//! Zonotopes p + H z, |z| <= 1, and the reduction of their order (method sheet 4.3, Theorem 3 of the paper).

mod selection;
mod split;

use crate::matrix::Matrix;
use crate::matrix::blocks::{Blocks, absolute_sum_of, blocks_of, store};
use crate::matrix::vectors::{LANES, Work, absolute, load, vectorised};
use pulp::Simd;
use selection::Selection;
use serde::{Deserialize, Serialize};
use split::Split;

/// One flag for each of 64 columns, the first in the lowest bit.
type Flags = u64;

/// How the columns of a generator matrix are scored when some must be boxed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Reduction {
    /// Rows divided by the radius, then 1-norm minus maximum norm: free of units; axis-aligned columns are
    /// boxed without loss.
    #[default]
    GirardScaled,
    /// Euclidean norm, as in the paper.
    Euclidean,
}

/// Room for reducing generator matrices.
#[derive(Clone, Debug)]
pub struct Reducer {
    reduction: Reduction,
    scores: Vec<f64>,
    selection: Selection,
    split: Split,
    /// 1 / R(H) of every row.
    scale: Vec<f64>,
}

impl Reducer {
    /// Room for generator matrices of `rows` rows and up to `columns` columns.
    pub fn new(reduction: Reduction, rows: usize, columns: usize) -> Self {
        Self {
            reduction,
            scores: vec![0.0; columns],
            selection: Selection::new(columns),
            split: Split::new(rows),
            scale: vec![0.0; rows],
        }
    }

    /// Encloses the zonotope with generators `matrix` by one of at most `order` columns.
    ///
    /// The `order` - n columns of largest score stay in their order (ties: the lower index), the others become
    /// a box in the last n columns. The radius (the interval hull) does not change. Returns whether anything
    /// was boxed. `order` must be at least the number of rows n.
    pub fn reduce(&mut self, matrix: &mut Matrix, order: usize) -> bool {
        let (rows, columns) = matrix.shape();
        if columns <= order {
            return false;
        }
        let count = order - rows;
        vectorised(Boxing {
            reducer: self,
            matrix,
            count,
        });
        matrix.reshape(rows, order);
        true
    }
}

/// The columns but `count` become a box behind those.
struct Boxing<'a> {
    reducer: &'a mut Reducer,
    matrix: &'a mut Matrix,
    count: usize,
}

impl Work for Boxing<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let (reducer, matrix) = (self.reducer, self.matrix);
        let scores = &mut reducer.scores[..matrix.columns()];
        match reducer.reduction {
            Reduction::Euclidean => store(simd, &SquaresOf { matrix }, scores),
            Reduction::GirardScaled => {
                let scale = &mut reducer.scale;
                for (value, row) in scale.iter_mut().zip(matrix.iter_rows()) {
                    let radius = absolute_sum_of(simd, &blocks_of(row, row.len(), &mut [0.0; LANES]));
                    *value = if radius > 0.0 { 1.0 / radius } else { 0.0 };
                }
                store(simd, &GirardOf { matrix, scale }, scores);
            }
        }
        let kept = reducer.selection.choose(simd, scores, self.count);
        reducer.split.apply(matrix, kept, self.count);
    }
}

/// Scores of [`Reduction::Euclidean`]: squares of the norms.
struct SquaresOf<'a> {
    matrix: &'a Matrix,
}

impl SquaresOf<'_> {
    #[inline(always)]
    fn sum<S: Simd>(&self, simd: S, block: impl Fn(&[f64]) -> S::f64s) -> S::f64s {
        let mut sum = simd.splat_f64s(0.0);
        for row in self.matrix.iter_rows() {
            let value = block(row);
            sum = simd.add_f64s(sum, simd.mul_f64s(value, value));
        }
        sum
    }
}

impl<S: Simd> Blocks<S> for SquaresOf<'_> {
    #[inline(always)]
    fn columns(&self) -> usize {
        self.matrix.columns()
    }

    #[inline(always)]
    fn full(&self, simd: S, j: usize) -> S::f64s {
        self.sum(
            simd,
            #[inline(always)]
            |row| load::<S>(&row.as_chunks().0[j]),
        )
    }

    #[inline(always)]
    fn last(&self, simd: S) -> S::f64s {
        self.sum(
            simd,
            #[inline(always)]
            |row| blocks_of(row, 0, &mut [0.0; LANES]).last(simd),
        )
    }
}

/// Scores of [`Reduction::GirardScaled`].
struct GirardOf<'a> {
    matrix: &'a Matrix,
    scale: &'a [f64],
}

impl GirardOf<'_> {
    #[inline(always)]
    fn score<S: Simd>(&self, simd: S, block: impl Fn(&[f64]) -> S::f64s) -> S::f64s {
        let (mut sum, mut largest) = (simd.splat_f64s(0.0), simd.splat_f64s(0.0));
        for (row, scale) in self.matrix.iter_rows().zip(self.scale) {
            let size = simd.mul_f64s(absolute(simd, block(row)), simd.splat_f64s(*scale));
            sum = simd.add_f64s(sum, size);
            largest = simd.max_f64s(size, largest);
        }
        simd.sub_f64s(sum, largest)
    }
}

impl<S: Simd> Blocks<S> for GirardOf<'_> {
    #[inline(always)]
    fn columns(&self) -> usize {
        self.matrix.columns()
    }

    #[inline(always)]
    fn full(&self, simd: S, j: usize) -> S::f64s {
        self.score(
            simd,
            #[inline(always)]
            |row| load::<S>(&row.as_chunks().0[j]),
        )
    }

    #[inline(always)]
    fn last(&self, simd: S) -> S::f64s {
        self.score(
            simd,
            #[inline(always)]
            |row| blocks_of(row, 0, &mut [0.0; LANES]).last(simd),
        )
    }
}
