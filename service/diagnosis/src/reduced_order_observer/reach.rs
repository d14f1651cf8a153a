//! The set of errors that disturbance and noise reach from zero, as tables over its age (method sheet 3.7).

use super::{observer::Observer, plant::Plant};
use crate::{
    matrix::Matrix,
    zonotope::{Reducer, Reduction},
};
use nalgebra::DMatrix;

/// Largest J.
const MAX_LENGTH: usize = 4096;
/// Generators below this share of the half widths are left to the bound of the rest.
const NEGLIGIBLE: f64 = 1e-14;
/// Largest power of A_e that is looked at for a contraction.
const MAX_POWER: usize = 100_000;

/// The generators X_j = A_e^j \[D_e H_η, -\[N; J\] V\] and a bound of those that are left out.
#[derive(Clone, Debug, PartialEq)]
pub struct Reach {
    /// X_0, ..., X_{J-1}, each n x (q + p).
    pub generators: Vec<DMatrix<f64>>,
    /// Σ over i >= J of |X_i|∞, bounded: what the rest adds to the half width of any coordinate.
    pub tail: f64,
    noise: DMatrix<f64>,
}

impl Reach {
    /// Follows the generators until they are negligible; `None` if no power of A_e is a contraction.
    pub fn new(plant: &Plant, observer: &Observer) -> Option<Self> {
        let p = plant.outputs();
        let noise = DMatrix::from_diagonal(&plant.noise_bound);
        let disturbance = &observer.d_e * DMatrix::from_diagonal(&plant.disturbance.radius);
        let mut next = super::plant::beside(&disturbance, &(-observer.noise_input() * &noise));
        let mut widths = plant.noise_bound.clone();
        let mut generators = Vec::new();
        while generators.len() < MAX_LENGTH && next.amax() > NEGLIGIBLE * widths.max() {
            for i in 0..p {
                widths[i] += next.row(i).iter().map(|value| value.abs()).sum::<f64>();
            }
            let following = &observer.a_e * &next;
            generators.push(std::mem::replace(&mut next, following));
        }
        Some(Self {
            generators,
            tail: tail(&observer.a_e, next)?,
            noise,
        })
    }

    /// J: from this age on the half widths are constant.
    pub fn length(&self) -> usize {
        self.generators.len()
    }

    /// Half widths of the rows `rows` z̃ + `noise_rows` v (nr x n and nr x p), at the ages 0, ..., J: row j of the
    /// result. The last row is that of every later age.
    pub fn half_widths(&self, rows: &DMatrix<f64>, noise_rows: &DMatrix<f64>) -> DMatrix<f64> {
        let count = rows.nrows();
        let sums = |matrix: DMatrix<f64>| matrix.map(f64::abs).column_sum();
        let mut table = DMatrix::zeros(self.length() + 1, count);
        let mut widths = sums(noise_rows * &self.noise);
        for (j, generators) in self.generators.iter().enumerate() {
            table.row_mut(j).copy_from(&widths.transpose());
            widths += sums(rows * generators);
        }
        widths += sums(rows.clone()) * self.tail;
        table.row_mut(self.length()).copy_from(&widths.transpose());
        table
    }

    /// Half widths of the test rows W (nw x p) of the residual y - ẑ1, as [`Self::half_widths`].
    pub fn test_half_widths(&self, tests: &DMatrix<f64>) -> DMatrix<f64> {
        let states = self.generators.first().map_or(tests.ncols(), DMatrix::nrows);
        let rows = tests.clone().resize_horizontally(states, 0.0);
        self.half_widths(&rows, tests)
    }

    /// X_inf: a set with at most `order` generators that contains the zero-start set of every age.
    pub fn steady_generators(&self, states: usize, order: usize) -> Matrix {
        let columns = self.generators.iter().map(DMatrix::ncols).sum::<usize>() + states;
        let mut all = Matrix::with_capacity(states, columns);
        for generators in &self.generators {
            all.append(&Matrix::from(generators));
        }
        all.append_diagonal(&vec![self.tail; states]);
        Reducer::new(Reduction::Euclidean, states, columns).reduce(&mut all, order);
        all
    }
}

/// Σ_{i=J}^{J+m-1} |X_i|∞ / (1 - |A_e^m|∞) for the smallest m with |A_e^m|∞ < 1.
fn tail(a_e: &DMatrix<f64>, mut generators: DMatrix<f64>) -> Option<f64> {
    let (mut power, mut sum) = (a_e.clone(), infinity_norm(&generators));
    for _ in 0..MAX_POWER {
        let contraction = infinity_norm(&power);
        if !contraction.is_finite() {
            return None;
        }
        if contraction < 1.0 {
            let tail = sum / (1.0 - contraction);
            return tail.is_finite().then_some(tail);
        }
        generators = a_e * generators;
        sum += infinity_norm(&generators);
        power = a_e * power;
    }
    None
}

/// Largest sum of absolute values along a row.
pub(super) fn infinity_norm(matrix: &DMatrix<f64>) -> f64 {
    matrix
        .row_iter()
        .map(|row| row.iter().map(|value| value.abs()).sum())
        .fold(0.0, f64::max)
}
