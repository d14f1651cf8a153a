//! The equalities that every certificate fulfils, and the least change that makes multipliers fulfil them
//! (method sheet 3.4).
//!
//! λ_{k-1} = A0'λ_k + C'μ_k for k = 0..=n and F'λ_k = 0 for k = 0..n, with λ_{-1} = λ_n = 0; the columns of F
//! are normalised. Ordered by k, each multiplier touches only neighbouring equalities, and in the same way in
//! every transition. With E the matrix of the equalities, E' therefore has a banded triangular factor R
//! (E' = QR), found by plane rotations; the least change is -E'(R'R)⁻¹Ez.
//!
//! | symbol | shape | meaning |
//! |---|---|---|
//! | λ, μ | nx x n, ny x (n + 1) | multipliers of the transitions and of the samples, oldest first |
//! | E, R | | equalities by multipliers; triangular factor of E' |

use nalgebra::{DMatrix, DVector};
use residual_diagnosis::model::LinearModel;
use residual_diagnosis::unknown_input_filter::modes::FaultMode;

/// An equality whose pivot is below this, relative to the largest entry of the model, depends on the others.
const DEPENDENT: f64 = 1e-12;

/// Multipliers of a window, or which of them are kept.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Multipliers {
    /// λ, nx x n.
    pub lambda: DMatrix<f64>,
    /// μ, ny x (n + 1).
    pub mu: DMatrix<f64>,
}

impl Multipliers {
    /// The largest magnitude.
    pub fn largest(&self) -> f64 {
        self.lambda.amax().max(self.mu.amax())
    }
}

/// The equalities of a window for a mode.
pub(crate) struct WindowEqualities {
    /// Equalities of one instant: nx of the dynamics, then nf of the mode's own faults.
    block: usize,
    /// Row i: what λ_k,i adds to the equalities from block k on; nx x (2 nx + nf).
    lambda_terms: DMatrix<f64>,
    /// Row j: what μ_k,j adds to the equalities from block k on; ny x nx.
    mu_terms: DMatrix<f64>,
}

impl WindowEqualities {
    /// The equalities of a model (nx states, ny outputs) and one of its modes (nf actuators).
    pub fn new(model: &LinearModel, mode: FaultMode) -> Self {
        let nx = model.state_count();
        let mut own = mode.unknown_input_matrix(model.b());
        for mut column in own.column_iter_mut() {
            let norm = column.norm();
            if norm > 0.0 {
                column /= norm;
            }
        }
        let block = nx + own.ncols();
        let mut lambda_terms = DMatrix::zeros(nx, block + nx);
        lambda_terms.columns_mut(0, nx).copy_from(&-model.a0());
        lambda_terms.columns_mut(nx, own.ncols()).copy_from(&own);
        lambda_terms.columns_mut(block, nx).fill_with_identity();
        let mu_terms = -model.c();
        Self {
            block,
            lambda_terms,
            mu_terms,
        }
    }

    /// By how much each equality is missed: Ez.
    fn residual(&self, z: &Multipliers) -> DVector<f64> {
        // The last block has no transition of its own: its equalities of own faults stay empty.
        let mut residual = DVector::zeros(self.block * z.mu.ncols());
        for (terms, values) in [(&self.lambda_terms, &z.lambda), (&self.mu_terms, &z.mu)] {
            for (k, column) in values.column_iter().enumerate() {
                let mut rows = residual.rows_mut(k * self.block, terms.ncols());
                rows.gemv_tr(1.0, terms, &column, 1.0);
            }
        }
        residual
    }

    /// The largest miss of an equality.
    pub fn violation(&self, z: &Multipliers) -> f64 {
        self.residual(z).amax()
    }

    /// Changes the multipliers that are not zero, as little as possible in the least-squares sense, so that the
    /// equalities hold as far as these multipliers permit; `repetitions` times, against rounding.
    pub fn project(&self, z: &mut Multipliers, repetitions: usize) {
        let triangle = self.triangle(z);
        for _ in 0..repetitions {
            let mut weights = self.residual(z);
            triangle.solve(&mut weights);
            for (terms, values) in [(&self.lambda_terms, &mut z.lambda), (&self.mu_terms, &mut z.mu)] {
                for (k, mut column) in values.column_iter_mut().enumerate() {
                    let change = terms * weights.rows(k * self.block, terms.ncols());
                    for (value, change) in column.iter_mut().zip(&change).filter(|(value, _)| **value != 0.0)
                    {
                        *value -= change;
                    }
                }
            }
        }
    }

    /// R of the equalities, restricted to the multipliers that are not zero.
    fn triangle(&self, z: &Multipliers) -> Triangle {
        let largest = self.lambda_terms.amax().max(self.mu_terms.amax());
        let mut triangle = Triangle {
            width: self.lambda_terms.ncols(),
            smallest_pivot: DEPENDENT * largest,
            rows: vec![None; self.block * z.mu.ncols()],
        };
        for k in 0..z.mu.ncols() {
            for (terms, values) in [(&self.mu_terms, &z.mu), (&self.lambda_terms, &z.lambda)] {
                let kept = (0..terms.nrows()).filter(|&i| k < values.ncols() && values[(i, k)] != 0.0);
                for i in kept {
                    triangle.add(k * self.block, terms.row(i).iter().copied().collect());
                }
            }
        }
        triangle.drop_dependent();
        triangle
    }
}

/// A banded upper triangular matrix; row c begins at its pivot in column c, and a column that depends on the
/// earlier ones has none.
struct Triangle {
    width: usize,
    smallest_pivot: f64,
    rows: Vec<Option<Vec<f64>>>,
}

impl Triangle {
    /// Rotates a row into the triangle whose first entry belongs to column `start`.
    fn add(&mut self, start: usize, mut row: Vec<f64>) {
        row.resize(self.width, 0.0);
        for column in start..self.rows.len() {
            if row[0] != 0.0 {
                let Some(pivot_row) = &mut self.rows[column] else {
                    self.rows[column] = Some(row);
                    return;
                };
                let length = pivot_row[0].hypot(row[0]);
                let (cosine, sine) = (pivot_row[0] / length, row[0] / length);
                for (upper, lower) in pivot_row.iter_mut().zip(&mut row) {
                    (*upper, *lower) = (cosine * *upper + sine * *lower, cosine * *lower - sine * *upper);
                }
            }
            row.rotate_left(1);
            row[self.width - 1] = 0.0;
            if row.iter().all(|&entry| entry == 0.0) {
                return;
            }
        }
    }

    /// Takes the columns without a sound pivot out and hands the rest of their rows on.
    fn drop_dependent(&mut self) {
        for column in 0..self.rows.len() {
            let weak = |row: &mut Vec<f64>| row[0].abs() <= self.smallest_pivot;
            if let Some(mut row) = self.rows[column].take_if(weak) {
                row[0] = 0.0;
                self.add(column, row);
            }
        }
    }

    /// values ← (R'R)⁻¹ values; zero in the columns without pivot.
    fn solve(&self, values: &mut DVector<f64>) {
        for (column, row) in self.rows.iter().enumerate() {
            let Some(row) = row else {
                values[column] = 0.0;
                continue;
            };
            values[column] /= row[0];
            let value = values[column];
            for (entry, later) in row.iter().zip(values.iter_mut().skip(column)).skip(1) {
                *later -= entry * value;
            }
        }
        for (column, row) in self.rows.iter().enumerate().rev() {
            if let Some(row) = row {
                let later: f64 = row
                    .iter()
                    .zip(values.iter().skip(column))
                    .skip(1)
                    .map(|(entry, value)| entry * value)
                    .sum();
                values[column] = (values[column] - later) / row[0];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use residual_diagnosis::model::ModelOptions;

    /// A double integrator beside a state of its own, two outputs; the last column of B is a fault of interest.
    fn equalities(mode: &[usize]) -> WindowEqualities {
        let options = ModelOptions {
            a: vec![vec![1.0, 0.1, 0.0], vec![0.0, 0.9, 0.0], vec![0.2, 0.0, 0.5]],
            b: vec![vec![0.02, 0.0], vec![0.1, 0.0], vec![0.0, 3.0]],
            c: vec![vec![1.0, 0.0, 0.0], vec![0.0, 0.0, 1.0]],
            measurement_noise_bound: vec![0.1, 0.1],
            ..ModelOptions::default()
        };
        let model = LinearModel::new(&options, 1.0).unwrap();
        WindowEqualities::new(&model, FaultMode::from_actuators(mode).unwrap())
    }

    fn arbitrary(transitions: usize) -> Multipliers {
        Multipliers {
            lambda: DMatrix::from_fn(3, transitions, |i, k| {
                (1.3 * i as f64 + 0.7 * k as f64 + 0.4).sin()
            }),
            mu: DMatrix::from_fn(2, transitions + 1, |i, k| {
                (2.1 * i as f64 - 0.9 * k as f64 + 0.2).cos()
            }),
        }
    }

    fn dot(a: &Multipliers, b: &Multipliers) -> f64 {
        a.lambda.dot(&b.lambda) + a.mu.dot(&b.mu)
    }

    #[test]
    fn arbitrary_multipliers_are_moved_perpendicularly_onto_the_equalities() {
        for mode in [&[] as &[usize], &[0], &[1]] {
            let equalities = equalities(mode);
            let start = arbitrary(12);
            let mut projected = start.clone();
            equalities.project(&mut projected, 3);
            assert!(equalities.violation(&start) > 0.1);
            assert!(
                equalities.violation(&projected) < 1e-14,
                "{}",
                equalities.violation(&projected)
            );
            let mut other = Multipliers {
                lambda: start.lambda.map(f64::cos),
                mu: start.mu.map(f64::exp),
            };
            equalities.project(&mut other, 3);
            let moved = Multipliers {
                lambda: &projected.lambda - &start.lambda,
                mu: &projected.mu - &start.mu,
            };
            assert!(
                dot(&moved, &other).abs() < 1e-12,
                "{mode:?}: {}",
                dot(&moved, &other)
            );
            assert!(dot(&projected, &projected) > 0.01);
        }
    }

    #[test]
    fn multipliers_that_are_zero_stay_zero() {
        let equalities = equalities(&[0]);
        let mut z = arbitrary(12);
        z.lambda.columns_mut(0, 6).fill(0.0);
        z.mu.columns_mut(0, 6).fill(0.0);
        equalities.project(&mut z, 3);
        assert!(equalities.violation(&z) < 1e-14);
        assert!(z.lambda.columns(0, 6).amax() == 0.0 && z.mu.columns(0, 6).amax() == 0.0);
    }

    #[test]
    fn dependent_equalities_do_not_stand_in_the_way() {
        // Nobody sees the second state: with the start of the window free, one equality follows from the others.
        let options = ModelOptions {
            a: vec![vec![0.9, 0.0], vec![0.0, 0.8]],
            b: vec![vec![1.0], vec![0.0]],
            c: vec![vec![1.0, 0.0], vec![2.0, 0.0]],
            measurement_noise_bound: vec![0.1, 0.1],
            ..ModelOptions::default()
        };
        let model = LinearModel::new(&options, 1.0).unwrap();
        let equalities = WindowEqualities::new(&model, FaultMode::FAULT_FREE);
        let mut z = Multipliers {
            lambda: DMatrix::from_fn(2, 20, |i, k| (i as f64 + 0.3 * k as f64).cos()),
            mu: DMatrix::from_fn(2, 21, |i, k| (2.0 * i as f64 - k as f64).sin()),
        };
        equalities.project(&mut z, 3);
        assert!(equalities.violation(&z) < 1e-14, "{}", equalities.violation(&z));
        assert!(z.lambda.row(1).amax() < 1e-14 && z.lambda.row(0).amax() > 0.1);
    }
}
