//! The paper's Theorem 1: all sample slots of an interval at once, with losses that nobody reports (method
//! sheet 4.2, batch form; equations (54)-(58) in corrected form).
//!
//! | symbol | shape | meaning |
//! |---|---|---|
//! | N | | rows of all slots together |
//! | Φ_i, u_i, Ξ_i, Ω_i | | interval (t_i, t_k\] of slot i |
//! | Π_i = H_i Φ_i⁻¹ | d x n_x | |
//! | H̄ | N x n | rows Π_i \[I, -Ξ_i D_m\] |
//! | ū | N | -Π_i u_i |
//! | Ψ̄ | n x N | -\[Ω_1Π_1', Ω_2Π_2', …; 0\] |
//! | R̄ | N x N | blocks Π_i Ω_{max(t_i,t_j)} Π_j' + δ_ij R_i |
//! | y, y⁻ | N | received or held value; value held just before |
//! | B = diag(β) | N | arrival probabilities |

use super::{interval::Interval, sensor::SensorModel};
use crate::{
    factor::PivotedQr,
    matrix::{Matrix, add_scaled, dot},
};

#[derive(Clone, Debug)]
pub(super) struct Slot {
    time_us: i64,
    pub first_row: usize,
    pub rows: usize,
    pub arrival: f64,
    /// Ω over (t_i, t_k].
    omega: Matrix,
}

/// Collects the slots of one interval and updates predicted modes with them.
#[derive(Clone, Debug)]
pub struct BatchUpdate {
    pub(super) slots: Vec<Slot>,
    pub(super) used: usize,
    pub(super) rows: usize,
    /// Π, N x n_x.
    pub(super) pi: Matrix,
    /// Π_i Ξ_i, N x n_f.
    pub(super) pi_xi: Matrix,
    pub(super) u_bar: Vec<f64>,
    pub(super) r_bar: Matrix,
    pub(super) psi: Matrix,
    pub(super) y: Vec<f64>,
    pub(super) y_before: Vec<f64>,
    pub(super) h_bar: Matrix,
    pub(super) a: Vec<f64>,
    pub(super) e: Vec<f64>,
    pub(super) solved: Vec<f64>,
    pub(super) c: Matrix,
    pub(super) factor: Matrix,
    /// P_p H̄' + Ψ̄, then 𝒢 = (P_p H̄' + Ψ̄) B; n x N.
    pub(super) gain: Matrix,
    pub(super) cross: Matrix,
    qr: PivotedQr,
    inverse: Matrix,
}

impl BatchUpdate {
    /// Room for `slots` slots of up to `widest` rows, n_x plant states, n_f channels and n filter states.
    pub fn new(slots: usize, widest: usize, states: usize, channels: usize, n: usize) -> Self {
        let rows = slots * widest;
        let slot = Slot {
            time_us: 0,
            first_row: 0,
            rows: 0,
            arrival: 1.0,
            omega: Matrix::zeros(states, states),
        };
        let vector = vec![0.0; rows];
        Self {
            slots: vec![slot; slots],
            used: 0,
            rows: 0,
            pi: Matrix::zeros(rows, states),
            pi_xi: Matrix::zeros(rows, channels),
            u_bar: vector.clone(),
            r_bar: Matrix::zeros(rows, rows),
            psi: Matrix::zeros(n, rows),
            y: vector.clone(),
            y_before: vector.clone(),
            h_bar: Matrix::zeros(rows, n),
            a: vector.clone(),
            e: vector.clone(),
            solved: vector,
            c: Matrix::zeros(rows, rows),
            factor: Matrix::zeros(rows, rows),
            gain: Matrix::zeros(n, rows),
            cross: Matrix::zeros(rows, rows),
            qr: PivotedQr::with_capacity(states, states),
            inverse: Matrix::zeros(states, states),
        }
    }

    /// Begins an interval without slots.
    pub fn begin(&mut self) {
        (self.used, self.rows) = (0, 0);
    }

    /// Whether there is no slot.
    pub fn is_empty(&self) -> bool {
        self.used == 0
    }

    /// Adds the slot sampled at `time_us`: value, value held before, and the interval from there to t_k (gain
    /// \[Υu, Ξ\]). False if there is no room or the interval cannot be inverted.
    pub(super) fn add(
        &mut self,
        time_us: i64,
        sensor: &SensorModel,
        (value, before): (&[f64], &[f64]),
        interval: &Interval,
    ) -> bool {
        let (d, first) = (sensor.rows(), self.rows);
        let Some(slot) = self.slots.get_mut(self.used) else {
            return false;
        };
        slot.omega.copy_from(&interval.omega);
        (slot.time_us, slot.first_row, slot.rows, slot.arrival) = (time_us, first, d, sensor.arrival);
        // Φ⁻¹ from Φ Pivot = Q R.
        let n = interval.phi.rows();
        self.qr.factor(&interval.phi);
        if self.qr.rank(0.0) < n {
            return false;
        }
        self.inverse.reshape(n, n);
        self.qr.leading_inverse(n, &mut self.inverse);
        self.pi.reshape(first + d, n);
        self.pi_xi.reshape(first + d, self.pi_xi.columns());
        for i in 0..d {
            let row = self.pi.row_mut(first + i);
            row.fill(0.0);
            for (k, &state) in self.qr.pivot.iter().enumerate() {
                add_scaled(row, sensor.h_plant[(i, state)], self.inverse.row(k));
            }
            let row = self.pi.row(first + i);
            self.u_bar[first + i] = -(0..n).map(|j| row[j] * interval.gain[(j, 0)]).sum::<f64>();
            for (c, out) in self.pi_xi.row_mut(first + i).iter_mut().enumerate() {
                *out = (0..n).map(|j| row[j] * interval.gain[(j, 1 + c)]).sum();
            }
            self.y[first + i] = value[i];
            self.y_before[first + i] = before[i];
        }
        self.r_bar.reshape(first + d, first + d);
        self.used += 1;
        self.rows += d;
        self.add_noise_terms(sensor);
        true
    }

    /// Blocks of Ψ̄ and R̄ that belong to the newest slot.
    fn add_noise_terms(&mut self, sensor: &SensorModel) {
        let newest = &self.slots[self.used - 1];
        let (n, states) = (self.psi.rows(), self.pi.columns());
        self.psi.reshape(n, self.rows);
        for j in newest.first_row..newest.first_row + newest.rows {
            for i in 0..n {
                self.psi[(i, j)] = if i < states {
                    -dot(newest.omega.row(i), self.pi.row(j))
                } else {
                    0.0
                };
            }
        }
        for slot in &self.slots[..self.used] {
            let omega = if slot.time_us > newest.time_us {
                &slot.omega
            } else {
                &newest.omega
            };
            for i in 0..newest.rows {
                for j in 0..slot.rows {
                    let (row, column) = (newest.first_row + i, slot.first_row + j);
                    let pi = self.pi.row(column);
                    let product: f64 = self
                        .pi
                        .row(row)
                        .iter()
                        .enumerate()
                        .map(|(k, weight)| weight * dot(omega.row(k), pi))
                        .sum();
                    let own = slot.first_row == newest.first_row;
                    let value = product + if own { sensor.r[(i, j)] } else { 0.0 };
                    self.r_bar[(row, column)] = value;
                    self.r_bar[(column, row)] = value;
                }
            }
        }
    }

    /// H̄, ū, R̄, Ψ̄, 𝒞, 𝒢 and e of the latest update, for inspection; it allocates.
    pub fn terms(&self) -> BatchTerms {
        BatchTerms {
            h_bar: self.h_bar.to_dense(),
            u_bar: self.u_bar[..self.rows].to_vec(),
            r_bar: self.r_bar.to_dense(),
            psi: self.psi.to_dense(),
            c: self.c.to_dense(),
            gain: self.gain.to_dense(),
            e: self.e[..self.rows].to_vec(),
        }
    }
}

/// What one batch update consists of.
#[derive(Clone, Debug)]
pub struct BatchTerms {
    /// H̄, N x n.
    pub h_bar: nalgebra::DMatrix<f64>,
    /// ū, N.
    pub u_bar: Vec<f64>,
    /// R̄, N x N.
    pub r_bar: nalgebra::DMatrix<f64>,
    /// Ψ̄, n x N.
    pub psi: nalgebra::DMatrix<f64>,
    /// 𝒞, N x N.
    pub c: nalgebra::DMatrix<f64>,
    /// 𝒢, n x N.
    pub gain: nalgebra::DMatrix<f64>,
    /// e, N.
    pub e: Vec<f64>,
}
