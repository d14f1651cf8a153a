//! Decoupling with the rows that were received (method sheet 4.7).
//!
//! | symbol | here |
//! |---|---|
//! | F̃ | `unknown` |
//! | C_a F̃ | `product` |
//! | U | `SetState::unbounded` |

use super::{
    decoupling::{Decoupling, Tolerances},
    plant::{Measured, Plant},
    state::SetState,
};
use crate::{
    factor::PivotedQr,
    matrix::{Matrix, absolute_sum, dot, multiply},
};

/// Relative size below which a pivot of C_a F̃ or C_a counts as zero for the gain.
const GAIN_TOLERANCE: f64 = 1e-9;
/// The same for the test rows and for bases of spans: only rounding lies below it.
const ROUNDING_TOLERANCE: f64 = 1e-14;

/// Room for decoupling with incomplete packets or unbounded sets.
#[derive(Clone, Debug)]
pub(crate) struct MissingData {
    pub decoupling: Decoupling,
    /// Whether the own faults enter the prediction as bounded inputs at this instant.
    pub bounded: bool,
    /// Whether the decoupled directions are exactly the own faults, so that these can be estimated.
    pub separated: bool,
    /// (C_a⁺ - L0) Z, valid if `strip_available`.
    pub strip_rows: Matrix,
    /// |C_a⁺| v_a.
    pub strip_half_widths: Vec<f64>,
    pub strip_available: bool,
    unknown: Matrix,
    product: Matrix,
    qr: PivotedQr,
    strip_qr: PivotedQr,
    strip_inverse: Matrix,
    strip_gain: Matrix,
    span: Matrix,
    span_qr: PivotedQr,
    shares: Vec<f64>,
    direction: Vec<f64>,
}

impl MissingData {
    /// Room for modes of up to `own` actuators.
    pub fn new(plant: &Plant, own: usize) -> Self {
        let (nx, ny) = (plant.nx(), plant.ny());
        let directions = 2 * nx + own;
        Self {
            decoupling: Decoupling::with_capacity(nx, ny),
            bounded: false,
            separated: false,
            strip_rows: Matrix::zeros(nx, ny),
            strip_half_widths: vec![0.0; nx],
            strip_available: false,
            unknown: Matrix::with_capacity(nx, directions),
            product: Matrix::with_capacity(ny, directions),
            qr: PivotedQr::with_capacity(ny, directions),
            strip_qr: PivotedQr::with_capacity(ny, nx),
            strip_inverse: Matrix::zeros(nx, ny),
            strip_gain: Matrix::zeros(nx, ny),
            span: Matrix::with_capacity(nx, directions),
            span_qr: PivotedQr::with_capacity(nx, directions),
            shares: vec![0.0; ny],
            direction: vec![0.0; nx],
        }
    }

    /// Prepares the decoupling of a step with own fault directions `own` (F). With `bounded_policy` own faults
    /// that the received rows do not separate are predicted as bounded inputs instead.
    pub fn prepare(
        &mut self,
        plant: &Plant,
        measured: &Measured,
        state: &SetState,
        own: &Matrix,
        bounded_policy: bool,
        shaping: Option<&Matrix>,
    ) {
        self.collect_unknown(plant, state, own);
        multiply(&measured.c, &self.unknown, &mut self.product);
        self.qr.factor(&self.product);
        let scale = norm(&measured.c) * norm(&self.unknown);
        let tolerances = Tolerances {
            gain: GAIN_TOLERANCE * scale,
            test: ROUNDING_TOLERANCE * scale,
        };
        self.decoupling
            .compute(&self.qr, &self.unknown, tolerances, shaping, measured);
        self.bounded = bounded_policy && !self.decoupling.complete && state.unbounded.columns() == 0;
        self.separated = self.decoupling.complete && state.unbounded.columns() == 0;
        if self.bounded {
            self.decoupling.compute_trivial(shaping, measured);
        }
        self.prepare_strip(measured);
    }

    /// F̃ = F, or orth\[A0U, e_i where (A⁺|U|)_i > 0, F\] for an unbounded set.
    fn collect_unknown(&mut self, plant: &Plant, state: &SetState, own: &Matrix) {
        if state.unbounded.columns() == 0 {
            self.unknown.copy_from(own);
            return;
        }
        multiply(&plant.a0, &state.unbounded, &mut self.span);
        let nx = plant.nx();
        for i in 0..nx {
            let reached =
                (0..nx).any(|k| plant.a_plus[(i, k)] > 0.0 && absolute_sum(state.unbounded.row(k)) > 0.0);
            if reached {
                let column = self.span.columns();
                self.span.reshape(nx, column + 1);
                (0..nx).for_each(|k| self.span[(k, column)] = f64::from(u8::from(i == k)));
            }
        }
        self.span.append(own);
        self.orthonormalise_span(0.0);
        self.unknown.copy_from(&self.span);
    }

    /// Replaces the columns of `span` by an orthonormal basis of what they span; columns no longer than
    /// `negligible` are rounding errors of zero.
    fn orthonormalise_span(&mut self, negligible: f64) {
        let (nx, columns) = self.span.shape();
        for c in 0..columns {
            let length = (0..nx).map(|i| self.span[(i, c)].powi(2)).sum::<f64>().sqrt();
            let scale = if length > negligible { 1.0 / length } else { 0.0 };
            (0..nx).for_each(|i| self.span[(i, c)] *= scale);
        }
        self.span_qr.factor(&self.span);
        let rank = self.span_qr.rank(ROUNDING_TOLERANCE);
        self.span.reshape(nx, rank);
        for i in 0..nx {
            self.span
                .row_mut(i)
                .copy_from_slice(&self.span_qr.q.row(i)[..rank]);
        }
    }

    fn prepare_strip(&mut self, measured: &Measured) {
        let (m, nx) = measured.c.shape();
        self.strip_available = false;
        if m < nx {
            return;
        }
        self.strip_qr.factor(&measured.c);
        if self.strip_qr.rank(GAIN_TOLERANCE * norm(&measured.c)) < nx {
            return;
        }
        self.strip_available = true;
        self.strip_qr.leading_inverse(nx, &mut self.strip_inverse);
        self.strip_gain.reshape(nx, m);
        for k in 0..nx {
            let i = self.strip_qr.pivot[k];
            let gain = self.strip_inverse.row(k);
            self.strip_half_widths[i] = gain.iter().zip(&measured.noise).map(|(g, v)| g.abs() * v).sum();
            self.strip_gain.row_mut(i).copy_from_slice(gain);
        }
        gain_coordinates(&self.strip_gain, &self.decoupling, &mut self.strip_rows);
    }

    /// U after a step with incomplete decoupling: orth((I - LC_a) F̃ N), N = Π\[-R̂11⁻¹R̂12; I\].
    pub fn update_unbounded(&mut self, measured: &Measured, gain: &Matrix, state: &mut SetState) {
        let (nx, n) = self.unknown.shape();
        let rank = self.decoupling.rank();
        self.span.reshape(nx, n - rank);
        for column in rank..n {
            let target = column - rank;
            self.qr.solve_leading(rank, column, &mut self.shares);
            for i in 0..nx {
                let seen = (0..rank).map(|k| self.shares[k] * self.unknown[(i, self.qr.pivot[k])]);
                self.direction[i] = self.unknown[(i, self.qr.pivot[column])] - seen.sum::<f64>();
            }
            for i in 0..nx {
                let corrected = gain.row(i).iter().zip(measured.c.iter_rows());
                let correction: f64 = corrected
                    .map(|(weight, row)| weight * dot(row, &self.direction))
                    .sum();
                self.span[(i, target)] = self.direction[i] - correction;
            }
        }
        self.orthonormalise_span(ROUNDING_TOLERANCE * norm(&self.unknown));
        state.unbounded.copy_from(&self.span);
    }
}

/// `out` = (`gain` - L0) Z, the row coordinates S' of a gain.
pub(crate) fn gain_coordinates(gain: &Matrix, decoupling: &Decoupling, out: &mut Matrix) {
    let (nx, z) = (gain.rows(), decoupling.null_basis.rows());
    out.reshape(nx, z);
    for i in 0..nx {
        for k in 0..z {
            let basis = decoupling.null_basis.row(k);
            out[(i, k)] = dot(gain.row(i), basis) - dot(decoupling.gain.row(i), basis);
        }
    }
}

/// Frobenius norm.
fn norm(matrix: &Matrix) -> f64 {
    matrix.iter_rows().map(|row| dot(row, row)).sum::<f64>().sqrt()
}
