//! Separation of a mode's own fault directions from what can be tested (method sheet 3.2, 4.7).
//!
//! | symbol | here | meaning |
//! |---|---|---|
//! | F̃ | argument `unknown` | directions of unbounded inputs in this step, nx x n |
//! | C_a | `measured.c` | received rows of C, m x nx |
//! | F1 | `columns` | the r columns of F̃ that the received outputs see independently |
//! | R̂11⁻¹Q1' | `inverse` | left inverse of C_a F1, r x m |
//! | L0 | `gain` | F1 R̂11⁻¹Q1', nx x m |
//! | Z' | `null_basis` | orthonormal rows with Z' C_a F1 = 0, (m - r) x m |
//! | W_P | `test_rows` | projector rows (I - CS) P, m x m |

use super::{
    modes::FaultMode,
    plant::{Measured, Plant},
};
use crate::buffer::Buffer;
use crate::{
    factor::PivotedQr,
    matrix::{Matrix, absolute_dot, combination, dot, multiply},
};

/// Rows of W_P shorter than this are blind: never tested.
const BLIND_ROW: f64 = 1e-9;

/// A decoupling of unknown inputs; either a constant of a mode or recomputed for an incomplete packet.
#[derive(Clone, Debug)]
pub(crate) struct Decoupling {
    pub columns: Matrix,
    pub inverse: Matrix,
    pub gain: Matrix,
    pub null_basis: Matrix,
    pub test_rows: Matrix,
    /// Whether a test row is blind, length m.
    pub blind: Buffer<bool>,
    /// C_a F1, m x r.
    pub seen: Matrix,
    /// |C_a| |F1|, m x r.
    pub seen_size: Matrix,
    /// F̃ column of each row of `inverse`.
    pub pivot: Buffer<usize>,
    /// Whether every column of F̃ is decoupled.
    pub complete: bool,
}

impl Decoupling {
    /// Room for `ny` outputs and `nx` states.
    pub fn with_capacity(nx: usize, ny: usize) -> Self {
        Self {
            columns: Matrix::zeros(nx, nx.max(ny)),
            inverse: Matrix::zeros(ny, ny),
            gain: Matrix::zeros(nx, ny),
            null_basis: Matrix::zeros(ny, ny),
            test_rows: Matrix::zeros(ny, ny),
            blind: Buffer::with_capacity(ny),
            seen: Matrix::zeros(ny, ny),
            seen_size: Matrix::zeros(ny, ny),
            pivot: Buffer::with_capacity(nx.max(ny)),
            complete: true,
        }
    }

    /// Decouples `unknown` (F̃) from the received outputs; `qr` has factored the product C_a F̃.
    ///
    /// Columns of F̃ count as seen when their pivot exceeds the tolerance of the gain; the test rows also stay
    /// clear of columns whose pivot exceeds only the tolerance of the tests. `shaping` is I - CS.
    pub fn compute(
        &mut self,
        qr: &PivotedQr,
        unknown: &Matrix,
        tolerances: Tolerances,
        shaping: Option<&Matrix>,
        measured: &Measured,
    ) {
        let (m, n) = qr.r.shape();
        let rank = qr.rank(tolerances.gain);
        let test_rank = qr.rank(tolerances.test).max(rank);
        self.complete = rank == n;
        self.pivot.clear();
        self.pivot.extend_from_slice(&qr.pivot[..rank]);
        self.columns.reshape(unknown.rows(), rank);
        for i in 0..unknown.rows() {
            for k in 0..rank {
                self.columns[(i, k)] = unknown[(i, qr.pivot[k])];
            }
        }
        qr.leading_inverse(rank, &mut self.inverse);
        multiply(&self.columns, &self.inverse, &mut self.gain);
        self.null_basis.reshape(m - rank, m);
        for k in rank..m {
            for j in 0..m {
                self.null_basis[(k - rank, j)] = qr.q[(j, k)];
            }
        }
        self.seen.reshape(m, rank);
        self.seen_size.reshape(m, rank);
        for j in 0..m {
            combination(self.seen.row_mut(j), measured.c.row(j), &self.columns);
            for k in 0..rank {
                let terms = measured.c.row(j).iter().enumerate();
                self.seen_size[(j, k)] = terms.map(|(i, c)| (c * self.columns[(i, k)]).abs()).sum();
            }
        }
        self.set_test_rows(qr, test_rank, shaping, &measured.received);
    }

    /// No unknown input at all: L0 = 0, Z = I, W_P = I - CS.
    pub fn compute_trivial(&mut self, shaping: Option<&Matrix>, measured: &Measured) {
        let (m, nx) = measured.c.shape();
        self.complete = true;
        self.pivot.clear();
        self.columns.reshape(nx, 0);
        self.inverse.reshape(0, m);
        self.seen.reshape(m, 0);
        self.seen_size.reshape(m, 0);
        self.gain.reshape(nx, m);
        self.gain.fill(0.0);
        self.null_basis.reshape(m, m);
        self.null_basis.fill(0.0);
        (0..m).for_each(|j| self.null_basis[(j, j)] = 1.0);
        self.test_rows.reshape(m, m);
        for i in 0..m {
            for j in 0..m {
                self.test_rows[(i, j)] = shaping_element(shaping, &measured.received, i, j);
            }
        }
        self.mark_blind_rows();
    }

    fn set_test_rows(
        &mut self,
        qr: &PivotedQr,
        test_rank: usize,
        shaping: Option<&Matrix>,
        received: &[usize],
    ) {
        let m = qr.q.rows();
        let projector = |i: usize, j: usize| dot(&qr.q.row(i)[test_rank..m], &qr.q.row(j)[test_rank..m]);
        self.test_rows.reshape(m, m);
        for i in 0..m {
            for j in 0..m {
                self.test_rows[(i, j)] = match shaping {
                    None => projector(i, j),
                    Some(_) => (0..m)
                        .map(|k| shaping_element(shaping, received, i, k) * projector(k, j))
                        .sum(),
                };
            }
        }
        self.mark_blind_rows();
    }

    fn mark_blind_rows(&mut self) {
        self.blind.clear();
        for row in self.test_rows.iter_rows() {
            self.blind.push(dot(row, row).sqrt() <= BLIND_ROW);
        }
    }

    /// Number r of decoupled directions.
    pub fn rank(&self) -> usize {
        self.columns.columns()
    }

    /// f̄: bound of the own faults from the data, with `spread` = |e| + R(Γ) + v (method sheet 4.9).
    pub fn own_fault_bound(&self, spread: &[f64], out: &mut [f64]) {
        for (bound, row) in out.iter_mut().zip(self.inverse.iter_rows()) {
            *bound = absolute_dot(row, spread) * (1.0 + 1e-9);
        }
    }
}

/// What the rounding of W C F1 = 0 lets through of one unit of the decoupled faults (method sheet 4.9).
impl Decoupling {
    /// |w C F1| + 4ε |w| |C| |F1| for the test row w = `row` and the decoupled direction `k`.
    pub fn leak(&self, row: &[f64], k: usize, epsilon: f64) -> f64 {
        let (seen, size) = self.response(row, k);
        seen.abs() + 4.0 * epsilon * size
    }

    /// The same for φ = `row`, whose response to the fault `own` is one.
    pub fn estimate_leak(&self, row: &[f64], own: usize, k: usize, epsilon: f64) -> f64 {
        let (seen, size) = self.response(row, k);
        let unit = f64::from(u8::from(self.pivot[k] == own));
        (unit - seen).abs() + 4.0 * epsilon * size
    }

    /// Row i of |(I - LC)F1| + 4ε(|F1| + |L||C||F1|) with the row `gain` of L.
    pub fn state_leak(&self, i: usize, gain: &[f64], k: usize, epsilon: f64) -> f64 {
        let direction = self.columns[(i, k)];
        let (seen, size) = self.response(gain, k);
        (direction - seen).abs() + 4.0 * epsilon * (direction.abs() + size)
    }

    /// [`Self::leak`] in all decoupled directions (allocates; off-line).
    pub fn leaks(&self, row: &[f64], epsilon: f64) -> Vec<f64> {
        (0..self.rank()).map(|k| self.leak(row, k, epsilon)).collect()
    }

    /// [`Self::estimate_leak`] in all decoupled directions (allocates; off-line).
    pub fn estimate_leaks(&self, row: &[f64], own: usize, epsilon: f64) -> Vec<f64> {
        let all = (0..self.rank()).map(|k| self.estimate_leak(row, own, k, epsilon));
        all.collect()
    }

    /// [`Self::state_leak`] in all decoupled directions (allocates; off-line).
    pub fn state_leaks(&self, i: usize, gain: &[f64], epsilon: f64) -> Vec<f64> {
        let all = (0..self.rank()).map(|k| self.state_leak(i, gain, k, epsilon));
        all.collect()
    }

    /// `row` C F1 and |`row`| |C| |F1| for the decoupled direction `k`.
    fn response(&self, row: &[f64], k: usize) -> (f64, f64) {
        let mut sums = (0.0, 0.0);
        for (j, weight) in row.iter().enumerate() {
            sums.0 += weight * self.seen[(j, k)];
            sums.1 += weight.abs() * self.seen_size[(j, k)];
        }
        sums
    }
}

/// F, the columns of B in the mode.
pub(crate) fn fault_matrix(plant: &Plant, mode: FaultMode) -> Matrix {
    Matrix::from(&mode.unknown_input_matrix(&plant.b.to_dense()))
}

/// The decoupling of a complete packet; the mode must have passed the checks of method sheet 3.1.
pub(crate) fn complete_decoupling(
    plant: &Plant,
    fault_matrix: &Matrix,
    shaping: Option<&Matrix>,
) -> Decoupling {
    let (nx, ny, own) = (plant.nx(), plant.ny(), fault_matrix.columns());
    let mut measured = Measured::new(plant);
    measured.receive(plant, &vec![0.0; ny]);
    let mut product = Matrix::zeros(ny, own);
    multiply(&plant.c, fault_matrix, &mut product);
    let mut qr = PivotedQr::with_capacity(ny, own);
    qr.factor(&product);
    let mut out = Decoupling::with_capacity(nx, ny);
    out.compute(
        &qr,
        fault_matrix,
        Tolerances { gain: 0.0, test: 0.0 },
        shaping,
        &measured,
    );
    out
}

fn shaping_element(shaping: Option<&Matrix>, received: &[usize], i: usize, j: usize) -> f64 {
    match shaping {
        Some(matrix) => matrix[(received[i], received[j])],
        None => f64::from(u8::from(i == j)),
    }
}

/// Thresholds below which a pivot of C_a F̃ counts as zero.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tolerances {
    /// For the gain.
    pub gain: f64,
    /// For the test rows.
    pub test: f64,
}
