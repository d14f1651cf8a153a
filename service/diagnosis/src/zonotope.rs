//! Zonotopes p + H z, |z| <= 1, and the reduction of their order (method sheet 4.3, Theorem 3 of the paper).

use crate::buffer::Buffer;
use crate::matrix::blocks::{Blocks, blocks_of, store};
use crate::matrix::vectors::{LANES, Work, absolute, load, vectorised};
use crate::matrix::{Matrix, row_sums};
use pulp::Simd;
use serde::{Deserialize, Serialize};

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
    /// Score of every column as a number of its own: ascending is score descending.
    keys: Buffer<u64>,
    kept: Vec<usize>,
    boxed: Vec<usize>,
    /// 1 / R(H) of every row.
    scale: Vec<f64>,
}

impl Reducer {
    /// Room for generator matrices of `rows` rows and up to `columns` columns.
    pub fn new(reduction: Reduction, rows: usize, columns: usize) -> Self {
        Self {
            reduction,
            scores: vec![0.0; columns],
            keys: Buffer::with_capacity(columns),
            // One place more than can be filled: what does not belong is written behind and overwritten.
            kept: vec![0; columns + 1],
            boxed: vec![0; columns + 1],
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
        self.score(matrix);
        let kept_count = order - rows;
        self.select(columns, kept_count);
        for i in 0..rows {
            let row = matrix.row_mut(i);
            let radius: f64 = self.boxed[..columns - kept_count]
                .iter()
                .map(|&column| row[column].abs())
                .sum();
            for (target, &column) in self.kept[..kept_count].iter().enumerate() {
                row[target] = row[column];
            }
            row[kept_count..order].fill(0.0);
            row[kept_count + i] = radius;
        }
        matrix.reshape(rows, order);
        true
    }

    /// Splits the columns into the `count` of largest score and the others, both ascending.
    fn select(&mut self, columns: usize, count: usize) {
        // Scores are sums of magnitudes, never negative, so that their bits are ordered as their values.
        let key = |score: &f64| !score.to_bits();
        self.keys.clear();
        self.keys.extend(self.scores[..columns].iter().map(key));
        let (before, &mut limit, _) = self.keys.select_nth_unstable(count);
        // Of the columns with the limiting score the first ones are kept.
        let mut room = before.iter().filter(|key| **key == limit).count();
        let (mut kept, mut boxed) = (0, 0);
        for (column, score) in self.scores[..columns].iter().enumerate() {
            let tie = key(score) == limit && room > 0;
            let keep = key(score) < limit || tie;
            room -= usize::from(tie);
            self.kept[kept] = column;
            self.boxed[boxed] = column;
            kept += usize::from(keep);
            boxed += usize::from(!keep);
        }
    }

    fn score(&mut self, matrix: &Matrix) {
        let scores = &mut self.scores[..matrix.columns()];
        match self.reduction {
            Reduction::Euclidean => vectorised(Squares { matrix, scores }),
            Reduction::GirardScaled => {
                row_sums(matrix, &mut self.scale);
                for value in &mut self.scale {
                    *value = if *value > 0.0 { 1.0 / *value } else { 0.0 };
                }
                let scale = &self.scale;
                vectorised(Girard {
                    matrix,
                    scale,
                    scores,
                });
            }
        }
    }
}

/// Scores of [`Reduction::Euclidean`]: squares of the norms.
struct Squares<'a> {
    matrix: &'a Matrix,
    scores: &'a mut [f64],
}

impl Work for Squares<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let matrix = self.matrix;
        store(simd, &SquaresOf { matrix }, self.scores);
    }
}

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
struct Girard<'a> {
    matrix: &'a Matrix,
    scale: &'a [f64],
    scores: &'a mut [f64],
}

impl Work for Girard<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let (matrix, scale) = (self.matrix, self.scale);
        store(simd, &GirardOf { matrix, scale }, self.scores);
    }
}

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
