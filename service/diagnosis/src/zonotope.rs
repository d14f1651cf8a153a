//! Zonotopes p + H z, |z| <= 1, and the reduction of their order (method sheet 4.3, Theorem 3 of the paper).

use crate::buffer::Buffer;
use serde::{Deserialize, Serialize};

use crate::matrix::{Matrix, row_sums};

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
    largest: Vec<f64>,
    /// Score and index of every column as one number each: ascending is score descending, index ascending.
    keys: Buffer<u128>,
    is_kept: Vec<bool>,
    kept: Vec<usize>,
    boxed: Vec<usize>,
    radius: Vec<f64>,
}

impl Reducer {
    /// Room for generator matrices of `rows` rows and up to `columns` columns.
    pub fn new(reduction: Reduction, rows: usize, columns: usize) -> Self {
        Self {
            reduction,
            scores: vec![0.0; columns],
            largest: vec![0.0; columns],
            keys: Buffer::with_capacity(columns),
            is_kept: vec![false; columns],
            kept: vec![0; columns],
            boxed: vec![0; columns],
            radius: vec![0.0; rows],
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
        self.keys.clear();
        let scores = self.scores[..columns].iter();
        // Scores are sums of magnitudes, never negative, so that their bits are ordered as their values.
        self.keys.extend(
            scores
                .enumerate()
                .map(|(column, score)| u128::from(!score.to_bits()) << 32 | column as u128),
        );
        self.keys.select_nth_unstable(count);
        self.is_kept[..columns].fill(false);
        for key in &self.keys[..count] {
            self.is_kept[(*key & u128::from(u32::MAX)) as usize] = true;
        }
        let (mut kept, mut boxed) = (0, 0);
        for (column, &keep) in self.is_kept[..columns].iter().enumerate() {
            self.kept[kept] = column;
            self.boxed[boxed] = column;
            kept += usize::from(keep);
            boxed += usize::from(!keep);
        }
    }

    fn score(&mut self, matrix: &Matrix) {
        let (rows, columns) = matrix.shape();
        let (scores, largest) = (&mut self.scores[..columns], &mut self.largest[..columns]);
        scores.fill(0.0);
        match self.reduction {
            Reduction::Euclidean => {
                for row in matrix.iter_rows() {
                    for (score, value) in scores.iter_mut().zip(row) {
                        *score += value * value;
                    }
                }
            }
            Reduction::GirardScaled => {
                largest.fill(0.0);
                row_sums(matrix, &mut self.radius);
                for i in 0..rows {
                    let scale = if self.radius[i] > 0.0 {
                        1.0 / self.radius[i]
                    } else {
                        0.0
                    };
                    for ((score, most), value) in scores.iter_mut().zip(largest.iter_mut()).zip(matrix.row(i))
                    {
                        let size = value.abs() * scale;
                        *score += size;
                        *most = if size > *most { size } else { *most };
                    }
                }
                for (score, most) in scores.iter_mut().zip(largest) {
                    *score -= *most;
                }
            }
        }
    }
}
