//! Mixing of the mode filters at the beginning of an interval (paper (24)-(26), (77); method sheet 4.2, 2-4).
//!
//! | symbol | here |
//! |---|---|
//! | λ_im = log Λ_im + log μ^i | `lambda` |
//! | log c^m = logsumexp_i λ_im | `log_predicted` |
//! | w_{i\|m} = e^{λ_im - log c^m} | `weight` |
//! | x̂^{i→m}, P^{i→m} | the moments of mode i with the slots that m does not share put back to their prior |

use super::{
    design::{Form, ImmDesign, Mixing},
    probability::log_sum_exp,
    state::{ModeState, lower_factor},
};
use crate::matrix::{Matrix, triangularise};

/// Mixes the mode filters of one design.
#[derive(Clone, Debug)]
pub struct Mixer {
    modes: usize,
    plant_states: usize,
    states: usize,
    /// For each pair (i, m), at i M + m: which of the n filter states are carried from mode i to mode m.
    carried: Vec<Vec<bool>>,
    /// For each pair: factor (n x p) of the covariance of the slots that restart; square-root form only.
    restart_root: Vec<Matrix>,
    /// \[·; φ₀\], n.
    restart_mean: Vec<f64>,
    /// diag(·, P_φ0), n x n.
    restart_covariance: Matrix,
    /// w_{i|m} at m M + i.
    weight: Vec<f64>,
    deviation: Vec<f64>,
    /// n x M (n + p + 1): the factor before it is made triangular; square-root form only.
    stacked: Matrix,
    square_root: bool,
}

impl Mixer {
    /// For a (checked) design.
    pub fn new(design: &ImmDesign) -> Self {
        let (nx, p, n) = (design.plant.sizes().0, design.slots(), design.filter_states());
        let modes = design.modes.len();
        let pairs = (0..modes * modes).map(|pair| (pair / modes, pair % modes));
        let carried: Vec<Vec<bool>> = pairs.map(|(i, m)| carried_states(design, i, m)).collect();
        let mut restart_covariance = Matrix::zeros(n, n);
        let mut restart_mean = vec![0.0; n];
        for j in 0..p {
            restart_mean[nx + j] = design.prior.amplitude[j];
            for k in 0..p {
                restart_covariance[(nx + j, nx + k)] = design.prior.amplitude_covariance[(j, k)];
            }
        }
        let square_root = design.form == Form::SequentialSquareRoot;
        let restart_root = |carried: &Vec<bool>| {
            let block = nalgebra::DMatrix::from_fn(n, n, |r, c| {
                if carried[r] || carried[c] {
                    0.0
                } else {
                    restart_covariance[(r, c)]
                }
            });
            lower_factor(&block)
        };
        Self {
            modes,
            plant_states: nx,
            states: n,
            restart_root: if square_root {
                carried.iter().map(restart_root).collect()
            } else {
                Vec::new()
            },
            carried,
            restart_mean,
            restart_covariance,
            weight: vec![0.0; modes * modes],
            deviation: vec![0.0; n],
            stacked: Matrix::zeros(n, if square_root { modes * (2 * n + 1) } else { 0 }),
            square_root,
        }
    }

    /// From the posterior (`from`, log μ) and log Λ to the mixed filters and log c.
    ///
    /// A mode that no other can reach keeps its own state with probability 0.
    pub fn mix(
        &mut self,
        from: &[ModeState],
        log_probability: &[f64],
        log_lambda: &Matrix,
        to: &mut [ModeState],
        log_predicted: &mut [f64],
    ) {
        self.weigh(log_probability, log_lambda, log_predicted);
        self.mix_moments(from, to);
    }

    /// The mixed filters, with the weights found last.
    pub(super) fn mix_moments(&mut self, from: &[ModeState], to: &mut [ModeState]) {
        for (m, mixed) in to.iter_mut().enumerate() {
            self.mix_means(from, m, &mut mixed.mean);
            if self.square_root {
                self.mix_factors(from, m, mixed);
            } else {
                self.mix_covariances(from, m, mixed);
            }
        }
    }

    /// The weights w_{i|m} and log c.
    pub(super) fn weigh(&mut self, log_probability: &[f64], log_lambda: &Matrix, log_predicted: &mut [f64]) {
        let modes = self.modes;
        for (m, (weights, log_c)) in self.weight.chunks_exact_mut(modes).zip(log_predicted).enumerate() {
            for (i, (weight, log_mu)) in weights.iter_mut().zip(log_probability).enumerate() {
                *weight = log_lambda[(i, m)] + log_mu;
            }
            *log_c = log_sum_exp(weights);
            if *log_c == f64::NEG_INFINITY {
                weights.fill(0.0);
                weights[m] = 1.0;
            } else {
                weights
                    .iter_mut()
                    .for_each(|weight| *weight = (*weight - *log_c).exp());
            }
        }
    }

    /// w_{i|m}, and which of the n filter states are carried from mode i to mode m.
    pub(super) fn pair(&self, i: usize, m: usize) -> (f64, &[bool]) {
        (self.weight[m * self.modes + i], &self.carried[i * self.modes + m])
    }

    /// n_x: the amplitude slots follow.
    pub(super) fn plant_states(&self) -> usize {
        self.plant_states
    }

    /// \[·; φ₀\] and diag(·, P_φ0): what is not carried is back there.
    pub(super) fn restart(&self) -> (&[f64], &Matrix) {
        (&self.restart_mean, &self.restart_covariance)
    }

    /// x̌^m = Σ_i w_{i|m} x̂^{i→m}.
    fn mix_means(&self, from: &[ModeState], m: usize, mean: &mut [f64]) {
        mean.fill(0.0);
        for (i, source) in from.iter().enumerate() {
            let weight = self.weight[m * self.modes + i];
            if weight == 0.0 {
                continue;
            }
            for (sum, moved) in mean.iter_mut().zip(self.moved_means(source, i, m)) {
                *sum += weight * moved;
            }
        }
    }

    /// P̌^m = Σ_i w_{i|m} [P^{i→m} + (x̌^m - x̂^{i→m})(·)'].
    fn mix_covariances(&mut self, from: &[ModeState], m: usize, mixed: &mut ModeState) {
        mixed.spread.fill(0.0);
        for (i, source) in from.iter().enumerate() {
            let weight = self.weight[m * self.modes + i];
            if weight == 0.0 {
                continue;
            }
            self.deviate(source, i, m, &mixed.mean);
            let carried = &self.carried[i * self.modes + m];
            for r in 0..self.states {
                let (moved, restarted) = (source.spread.row(r), self.restart_covariance.row(r));
                let row = mixed.spread.row_mut(r);
                for c in 0..=r {
                    let entry = match (carried[r], carried[c]) {
                        (true, true) => moved[c],
                        (false, false) => restarted[c],
                        _ => 0.0,
                    };
                    row[c] += weight * (entry + self.deviation[r] * self.deviation[c]);
                }
            }
        }
        for r in 0..self.states {
            for c in 0..r {
                mixed.spread[(c, r)] = mixed.spread[(r, c)];
            }
        }
    }

    /// The same for factors: L of \[√w L^{i→m}, √w (restart root), √w (x̌^m - x̂^{i→m})\] over all i.
    fn mix_factors(&mut self, from: &[ModeState], m: usize, mixed: &mut ModeState) {
        let n = self.states;
        let mut column = 0;
        for (i, source) in from.iter().enumerate() {
            let weight = self.weight[m * self.modes + i];
            if weight == 0.0 {
                continue;
            }
            let root = weight.sqrt();
            self.deviate(source, i, m, &mixed.mean);
            let pair = i * self.modes + m;
            self.stacked.reshape(n, column + 2 * n + 1);
            for r in 0..n {
                let row = &mut self.stacked.row_mut(r)[column..];
                let (moved, rest) = row.split_at_mut(n);
                let (restarted, deviation) = rest.split_at_mut(n);
                let kept = if self.carried[pair][r] { root } else { 0.0 };
                moved
                    .iter_mut()
                    .zip(source.spread.row(r))
                    .for_each(|(out, value)| *out = kept * value);
                let prior = self.restart_root[pair].row(r);
                restarted
                    .iter_mut()
                    .zip(prior)
                    .for_each(|(out, value)| *out = root * value);
                deviation.fill(root * self.deviation[r]);
            }
            column += 2 * n + 1;
        }
        triangularise(&mut self.stacked);
        mixed.spread.copy_from(&self.stacked);
    }

    /// x̂^{i→m}.
    fn moved_means<'a>(&'a self, source: &'a ModeState, i: usize, m: usize) -> impl Iterator<Item = f64> {
        let carried = self.carried[i * self.modes + m].iter();
        let values = source.mean.iter().zip(&self.restart_mean);
        carried
            .zip(values)
            .map(|(carried, (own, restart))| if *carried { *own } else { *restart })
    }

    /// x̌^m - x̂^{i→m}.
    fn deviate(&mut self, source: &ModeState, i: usize, m: usize, mean: &[f64]) {
        let mut deviation = std::mem::take(&mut self.deviation);
        let moved = self.moved_means(source, i, m);
        for (out, (mixed, moved)) in deviation.iter_mut().zip(mean.iter().zip(moved)) {
            *out = mixed - moved;
        }
        self.deviation = deviation;
    }
}

/// The plant state is always carried; slot j only if column j of D_i equals column j of D_m and is not zero
/// (all slots with [`Mixing::All`]).
fn carried_states(design: &ImmDesign, i: usize, m: usize) -> Vec<bool> {
    let (from, to) = (&design.modes[i].direction, &design.modes[m].direction);
    let slot = |j: usize| {
        design.mixing == Mixing::All
            || (from.column(j) == to.column(j) && from.column(j).iter().any(|entry| *entry != 0.0))
    };
    let plant = std::iter::repeat_n(true, design.plant.sizes().0);
    plant.chain((0..design.slots()).map(slot)).collect()
}
