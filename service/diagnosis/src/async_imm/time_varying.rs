//! Plants given as a function of time: Runge-Kutta integration of Φ, Υu, Ξ and Ω (method sheet 3, step 4).
//!
//! | quantity | rate |
//! |---|---|
//! | Φ | AΦ |
//! | \[Υu, Ξ\] | A\[Υu, Ξ\] + \[Bu, F\] |
//! | Ω | AΩ + ΩA' + GQG' |
//!
//! For a mode with a random walk of its amplitude, Ā = \[A, FD; 0, 0\] and S̄ = diag(GQG', diag(q_φ)) take the
//! places of A and GQG', and there is no Ξ.

use super::{
    interval::{Interval, symmetrise},
    plant::{PlantFunction, PlantRates},
};
use crate::matrix::{Matrix, multiply};

/// ‖A‖₂h of one substep.
const SUBSTEP: f64 = 0.008;
/// Bound of the work of one interval.
const MOST_SUBSTEPS: f64 = 1e5;

/// Direction D (n_f x p) and random-walk densities q_φ (p) of a mode.
#[derive(Clone, Debug)]
pub(super) struct RandomWalk {
    pub direction: Matrix,
    pub density: Vec<f64>,
}

/// Integrates a plant that is a function of time.
#[derive(Clone)]
pub(super) struct RungeKutta {
    function: PlantFunction,
    walk: Option<RandomWalk>,
    /// The plant at the beginning, the middle and the end of a substep.
    rates: [PlantRates; 3],
    plain: PlantRates,
    stage: Interval,
    slope: Interval,
    sum: Interval,
    square: Matrix,
    directed: Matrix,
}

impl RungeKutta {
    pub fn new(function: PlantFunction, states: usize, channels: usize, walk: Option<RandomWalk>) -> Self {
        let p = walk.as_ref().map_or(0, |walk| walk.direction.columns());
        let (n, own_channels) = if walk.is_some() {
            (states + p, 0)
        } else {
            (states, channels)
        };
        let interval = Interval::empty(n, 1 + own_channels);
        let rates = PlantRates::new(n, own_channels);
        Self {
            function,
            rates: [rates.clone(), rates.clone(), rates],
            plain: PlantRates::new(states, channels),
            stage: interval.clone(),
            slope: interval.clone(),
            sum: interval,
            square: Matrix::zeros(n, n),
            directed: Matrix::zeros(states, p),
            walk,
        }
    }

    /// Continues `interval` from `begin` to `end` (seconds) under a constant command.
    pub fn continue_over(&mut self, begin: f64, end: f64, command: &[f64], interval: &mut Interval) {
        let length = end - begin;
        self.evaluate(0, begin, command);
        self.evaluate(1, begin + 0.5 * length, command);
        self.evaluate(2, end, command);
        let norm = self
            .rates
            .iter()
            .map(|rates| norm_bound(&rates.a))
            .fold(0.0, f64::max);
        let wanted = (norm * length / SUBSTEP).ceil();
        // A plant that is not finite gives nothing finite, whatever the number of substeps.
        let substeps = if wanted.is_finite() {
            wanted.clamp(1.0, MOST_SUBSTEPS)
        } else {
            1.0
        };
        let h = length / substeps;
        for substep in 0..substeps as u64 {
            let from = begin + substep as f64 * h;
            self.evaluate(0, from, command);
            self.evaluate(1, from + 0.5 * h, command);
            self.evaluate(2, from + h, command);
            self.substep(h, interval);
        }
        symmetrise(&mut interval.omega);
    }

    /// Classical fourth-order step.
    fn substep(&mut self, h: f64, interval: &mut Interval) {
        self.stage.copy_from(interval);
        self.sum.copy_from(interval);
        for (node, weight, next) in [
            (0, 1.0 / 6.0, 0.5),
            (1, 1.0 / 3.0, 0.5),
            (1, 1.0 / 3.0, 1.0),
            (2, 1.0 / 6.0, 0.0),
        ] {
            slope(&self.rates[node], &self.stage, &mut self.slope, &mut self.square);
            add_scaled_interval(&mut self.sum, weight * h, &self.slope);
            self.stage.copy_from(interval);
            add_scaled_interval(&mut self.stage, next * h, &self.slope);
        }
        interval.copy_from(&self.sum);
    }

    /// Fills `rates[node]` with the plant at `time`.
    fn evaluate(&mut self, node: usize, time: f64, command: &[f64]) {
        let rates = &mut self.rates[node];
        let Some(walk) = &self.walk else {
            (self.function)(time, command, rates);
            return;
        };
        (self.function)(time, command, &mut self.plain);
        let nx = self.plain.a.rows();
        multiply(&self.plain.f, &walk.direction, &mut self.directed);
        for i in 0..nx {
            rates.a.row_mut(i)[..nx].copy_from_slice(self.plain.a.row(i));
            rates.a.row_mut(i)[nx..].copy_from_slice(self.directed.row(i));
            rates.noise.row_mut(i)[..nx].copy_from_slice(self.plain.noise.row(i));
        }
        rates.input[..nx].copy_from_slice(&self.plain.input);
        for (j, density) in walk.density.iter().enumerate() {
            rates.noise[(nx + j, nx + j)] = *density;
        }
    }
}

/// The rates of change of the four quantities.
fn slope(rates: &PlantRates, at: &Interval, out: &mut Interval, square: &mut Matrix) {
    multiply(&rates.a, &at.phi, &mut out.phi);
    multiply(&rates.a, &at.gain, &mut out.gain);
    for i in 0..out.gain.rows() {
        let row = out.gain.row_mut(i);
        row[0] += rates.input[i];
        for (value, f) in row[1..].iter_mut().zip(rates.f.row(i)) {
            *value += f;
        }
    }
    multiply(&rates.a, &at.omega, square);
    for i in 0..square.rows() {
        for j in 0..square.rows() {
            out.omega[(i, j)] = square[(i, j)] + square[(j, i)] + rates.noise[(i, j)];
        }
    }
}

fn add_scaled_interval(out: &mut Interval, factor: f64, term: &Interval) {
    for (out, term) in [
        (&mut out.phi, &term.phi),
        (&mut out.gain, &term.gain),
        (&mut out.omega, &term.omega),
    ] {
        for i in 0..out.rows() {
            for (value, rate) in out.row_mut(i).iter_mut().zip(term.row(i)) {
                *value += factor * rate;
            }
        }
    }
}

/// sqrt(‖A‖₁‖A‖∞) >= ‖A‖₂.
fn norm_bound(a: &Matrix) -> f64 {
    let rows = a
        .iter_rows()
        .map(|row| row.iter().map(|value| value.abs()).sum::<f64>())
        .fold(0.0, f64::max);
    let columns = (0..a.columns())
        .map(|j| (0..a.rows()).map(|i| a[(i, j)].abs()).sum::<f64>())
        .fold(0.0, f64::max);
    (rows * columns).sqrt()
}
