//! What a posterior says: probabilities, fused moments, amplitudes (method sheet 4.2, step 8, and 4.3).

use super::{
    design::{Form, ImmDesign, Mixing},
    state::Posterior,
};
use crate::matrix::{Matrix, dot};

/// Estimate of one fault channel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AmplitudeEstimate {
    /// f̂_c = (D φ̂)_c.
    pub value: f64,
    /// σ_c, its standard deviation.
    pub standard_deviation: f64,
    /// The mode it is taken from.
    pub mode: usize,
}

/// Reads posteriors of one design; room for what it finds.
#[derive(Clone, Debug)]
pub struct Fusion {
    states: usize,
    square_root: bool,
    directions: Vec<Matrix>,
    /// For every mode: which of the n filter states count; an inactive slot enters as exactly 0.
    counts: Vec<Vec<bool>>,
    /// For every mode and channel: whether row c of D is not zero.
    active: Vec<Vec<bool>>,
    probability: Vec<f64>,
    mean: Vec<f64>,
    covariance: Matrix,
    amplitudes: Vec<AmplitudeEstimate>,
}

impl Fusion {
    /// For a (checked) design.
    pub fn new(design: &ImmDesign) -> Self {
        let (nx, _, channels) = design.plant.sizes();
        let n = design.filter_states();
        let counts = design.modes.iter().map(|mode| {
            let all = design.mixing == Mixing::All;
            let slots = mode.direction.column_iter();
            let slots = slots.map(|column| all || column.iter().any(|entry| *entry != 0.0));
            std::iter::repeat_n(true, nx).chain(slots).collect()
        });
        let active = design.modes.iter().map(|mode| {
            let rows = mode.direction.row_iter();
            rows.map(|row| row.iter().any(|entry| *entry != 0.0)).collect()
        });
        Self {
            states: nx,
            square_root: design.form == Form::SequentialSquareRoot,
            directions: design
                .modes
                .iter()
                .map(|mode| Matrix::from(&mode.direction))
                .collect(),
            counts: counts.collect(),
            active: active.collect(),
            probability: vec![0.0; design.modes.len()],
            mean: vec![0.0; n],
            covariance: Matrix::zeros(n, n),
            amplitudes: vec![AmplitudeEstimate::default(); channels],
        }
    }

    /// Takes μ from a posterior.
    pub fn read_probability(&mut self, posterior: &Posterior) -> &[f64] {
        for (mu, log_mu) in self.probability.iter_mut().zip(&posterior.log_probability) {
            *mu = log_mu.exp();
        }
        &self.probability
    }

    /// μ as read last.
    pub fn probability(&self) -> &[f64] {
        &self.probability
    }

    /// Mean (n) and covariance (n x n) of the mixture (79)-(80).
    pub fn fuse(&mut self, posterior: &Posterior) -> (&[f64], &Matrix) {
        self.read_probability(posterior);
        self.mean.fill(0.0);
        self.covariance.fill(0.0);
        let value = |counts: &[bool], mean: &[f64], i: usize| if counts[i] { mean[i] } else { 0.0 };
        for ((mode, counts), mu) in posterior.modes.iter().zip(&self.counts).zip(&self.probability) {
            for (i, fused) in self.mean.iter_mut().enumerate() {
                *fused += mu * value(counts, &mode.mean, i);
            }
        }
        for ((mode, counts), mu) in posterior.modes.iter().zip(&self.counts).zip(&self.probability) {
            for i in 0..self.mean.len() {
                let deviation = value(counts, &mode.mean, i) - self.mean[i];
                for j in 0..self.mean.len() {
                    let own = if counts[i] && counts[j] {
                        covariance_entry(&mode.spread, self.square_root, i, j)
                    } else {
                        0.0
                    };
                    let other = value(counts, &mode.mean, j) - self.mean[j];
                    self.covariance[(i, j)] += mu * (own + deviation * other);
                }
            }
        }
        (&self.mean, &self.covariance)
    }

    /// Covariance of one mode, n x n; for inspection, it allocates.
    pub fn mode_covariance(&self, posterior: &Posterior, mode: usize) -> Option<Matrix> {
        let spread = &posterior.modes.get(mode)?.spread;
        let mut covariance = Matrix::zeros(spread.rows(), spread.rows());
        for i in 0..spread.rows() {
            for j in 0..spread.rows() {
                covariance[(i, j)] = covariance_entry(spread, self.square_root, i, j);
            }
        }
        Some(covariance)
    }

    /// Estimates of all channels: from the declared mode if the channel is active in it, else from the most
    /// probable mode in which it is (lowest index on ties).
    pub fn read_amplitudes(&mut self, posterior: &Posterior, declared_mode: usize) -> &[AmplitudeEstimate] {
        self.read_probability(posterior);
        for channel in 0..self.amplitudes.len() {
            let mode = self.mode_of(channel, declared_mode);
            let direction = self.directions[mode].row(channel);
            let state = &posterior.modes[mode];
            let mut variance = 0.0;
            for (j, left) in direction.iter().enumerate() {
                for (k, right) in direction.iter().enumerate() {
                    let (i, l) = (self.states + j, self.states + k);
                    variance += left * right * covariance_entry(&state.spread, self.square_root, i, l);
                }
            }
            self.amplitudes[channel] = AmplitudeEstimate {
                value: dot(direction, &state.mean[self.states..]),
                standard_deviation: variance.max(0.0).sqrt(),
                mode,
            };
        }
        &self.amplitudes
    }

    /// Estimates as read last.
    pub fn amplitudes(&self) -> &[AmplitudeEstimate] {
        &self.amplitudes
    }

    /// Bit c: channel c is active in this mode.
    pub fn channels_of(&self, mode: usize) -> u64 {
        let active = self.active.get(mode).into_iter().flatten().enumerate();
        active.fold(0, |bits, (channel, active)| {
            bits | u64::from(*active) << (channel & 63)
        })
    }

    fn mode_of(&self, channel: usize, declared_mode: usize) -> usize {
        let active = |mode: usize| self.active.get(mode).and_then(|of| of.get(channel)) == Some(&true);
        if active(declared_mode) {
            return declared_mode;
        }
        let mut best = None;
        for (mode, mu) in self.probability.iter().enumerate() {
            if active(mode) && best.is_none_or(|(_, most)| *mu > most) {
                best = Some((mode, *mu));
            }
        }
        best.map_or(0, |(mode, _)| mode)
    }
}

/// P_ij, or (L L')_ij.
fn covariance_entry(spread: &Matrix, square_root: bool, i: usize, j: usize) -> f64 {
    if square_root {
        dot(spread.row(i), spread.row(j))
    } else {
        spread[(i, j)]
    }
}
