//! The update of one mode by Theorem 1.

use super::{batch::BatchUpdate, interval::symmetrise, joseph::log_density, state::ModeState};
use crate::{
    factor::{cholesky, cholesky_solve},
    matrix::{
        Matrix, add_scaled, all_finite, apply, dot, forward_substitution, multiply, multiply_transposed,
    },
};

impl BatchUpdate {
    /// Updates a mode that was predicted to t_k: log N(e; 0, 𝒞), or `None`, with `state` unchanged, if 𝒞 has no
    /// factor.
    pub fn update(&mut self, direction: &Matrix, state: &mut ModeState) -> Option<f64> {
        let (n, rows) = (state.mean.len(), self.rows);
        self.project(direction, n);
        self.innovate(&state.mean);
        // 𝒮 = H̄P_pH̄' + H̄Ψ̄ + (H̄Ψ̄)' + R̄.
        multiply_transposed(&state.spread, &self.h_bar, &mut self.gain);
        multiply(&self.h_bar, &self.gain, &mut self.c);
        multiply(&self.h_bar, &self.psi, &mut self.cross);
        for i in 0..rows {
            for j in 0..rows {
                self.c[(i, j)] += self.cross[(i, j)] + self.cross[(j, i)] + self.r_bar[(i, j)];
            }
        }
        symmetrise(&mut self.c);
        self.observe_through_losses();
        self.factor.copy_from(&self.c);
        if !all_finite(&self.e[..rows]) || !cholesky(&mut self.factor) {
            return None;
        }
        // 𝒢 = (P_pH̄' + Ψ̄) B.
        for i in 0..n {
            add_scaled(self.gain.row_mut(i), 1.0, self.psi.row(i));
        }
        for slot in &self.slots[..self.used] {
            for i in 0..n {
                let own = slot.first_row..slot.first_row + slot.rows;
                self.gain.row_mut(i)[own]
                    .iter_mut()
                    .for_each(|value| *value *= slot.arrival);
            }
        }
        // x̂ = x_p + 𝒢𝒞⁻¹e, P = P_p - 𝒢𝒞⁻¹𝒢'.
        let solved = &mut self.solved[..rows];
        solved.copy_from_slice(&self.e[..rows]);
        forward_substitution(&self.factor, solved);
        let log_likelihood = log_density(&self.factor, solved);
        solved.copy_from_slice(&self.e[..rows]);
        cholesky_solve(&self.factor, solved);
        for (i, mean) in state.mean.iter_mut().enumerate() {
            *mean += dot(self.gain.row(i), solved);
        }
        for i in 0..n {
            let solved = &mut self.solved[..rows];
            solved.copy_from_slice(self.gain.row(i));
            cholesky_solve(&self.factor, solved);
            for (j, value) in state.spread.row_mut(i).iter_mut().enumerate() {
                *value -= dot(self.gain.row(j), solved);
            }
        }
        symmetrise(&mut state.spread);
        Some(log_likelihood)
    }

    /// H̄ = Π\[I, -ΞD\].
    fn project(&mut self, direction: &Matrix, n: usize) {
        let states = self.pi.columns();
        self.h_bar.reshape(self.rows, n);
        for i in 0..self.rows {
            let (plant, amplitude) = self.h_bar.row_mut(i).split_at_mut(states);
            plant.copy_from_slice(self.pi.row(i));
            for (j, out) in amplitude.iter_mut().enumerate() {
                let terms = self.pi_xi.row(i).iter().enumerate();
                *out = -terms.map(|(c, value)| value * direction[(c, j)]).sum::<f64>();
            }
        }
    }

    /// ẑ = H̄x_p + ū, a = ẑ - y⁻, e = y - Bẑ - (I - B) y⁻.
    fn innovate(&mut self, mean: &[f64]) {
        let rows = self.rows;
        apply(&self.h_bar, mean, &mut self.a[..rows]);
        for slot in &self.slots[..self.used] {
            for i in slot.first_row..slot.first_row + slot.rows {
                let predicted = self.a[i] + self.u_bar[i];
                self.a[i] = predicted - self.y_before[i];
                self.e[i] = self.y[i] - slot.arrival * predicted - (1.0 - slot.arrival) * self.y_before[i];
            }
        }
    }

    /// 𝒞 = B𝒮B + (B - B²) blockdiag(𝒮_ii + a_i a_i').
    fn observe_through_losses(&mut self) {
        for left in &self.slots[..self.used] {
            for right in &self.slots[..self.used] {
                let own = left.first_row == right.first_row;
                let spread = if own {
                    left.arrival * (1.0 - left.arrival)
                } else {
                    0.0
                };
                for i in left.first_row..left.first_row + left.rows {
                    for j in right.first_row..right.first_row + right.rows {
                        let s = self.c[(i, j)];
                        self.c[(i, j)] =
                            left.arrival * right.arrival * s + spread * (s + self.a[i] * self.a[j]);
                    }
                }
            }
        }
    }
}
