//! State propagators: the difference to the filter and its covariance (method sheet 4, step 6).

use super::{filter::Correction, finite::all_finite};
use crate::matrix::{Matrix, apply, multiply, triangularise};
use serde::{Deserialize, Serialize};

/// A model-only propagator, known by what it differs from the filter: β = x_s - x̂ with covariance T = L_T L_T'.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Propagator {
    /// β, length n.
    pub difference: Vec<f64>,
    /// L_T, n x n.
    pub factor: Matrix,
}

/// Room for one step of a propagator.
#[derive(Clone, Debug)]
pub(super) struct PropagatorWork {
    vector: Vec<f64>,
    array: Matrix,
}

impl PropagatorWork {
    pub fn new(states: usize, measurements: usize) -> Self {
        Self {
            vector: vec![0.0; states],
            array: Matrix::with_capacity(states, states + measurements),
        }
    }
}

impl Propagator {
    /// A propagator just started from the filter's estimate.
    pub fn new(states: usize) -> Self {
        Self {
            difference: vec![0.0; states],
            factor: Matrix::zeros(states, states),
        }
    }

    /// Starts again from the filter's estimate.
    pub fn clear(&mut self) {
        self.difference.fill(0.0);
        self.factor.fill(0.0);
    }

    /// β ← Φ β - γ, L_T ← tri\[Φ L_T, K̄\].
    pub fn step(&mut self, transition: &Matrix, update: &Correction, work: &mut PropagatorWork) {
        apply(transition, &self.difference, &mut work.vector);
        for ((difference, moved), correction) in self
            .difference
            .iter_mut()
            .zip(&work.vector)
            .zip(&update.correction)
        {
            *difference = moved - correction;
        }
        multiply(transition, &self.factor, &mut work.array);
        work.array.append(&update.gain);
        triangularise(&mut work.array);
        self.factor.copy_from(&work.array);
    }

    pub fn is_finite(&self) -> bool {
        all_finite(&self.difference) && self.factor.iter_rows().all(all_finite)
    }

    pub fn fits(&self, other: &Self) -> bool {
        self.difference.len() == other.difference.len() && self.factor.shape() == other.factor.shape()
    }
}

/// Two propagators that are restarted in alternation, so that the one in use is never young.
///
/// With the reset interval L the statistic of instant k uses the propagator started at r(k) = L max(0, ⌈k/L⌉ - 2).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct PropagatorPair {
    propagators: [Propagator; 2],
    second_in_use: bool,
    steps: u64,
}

impl PropagatorPair {
    pub fn new(states: usize) -> Self {
        Self {
            propagators: [Propagator::new(states), Propagator::new(states)],
            second_in_use: false,
            steps: 0,
        }
    }

    pub fn clear(&mut self) {
        self.propagators.iter_mut().for_each(Propagator::clear);
        self.second_in_use = false;
        self.steps = 0;
    }

    /// Moves both; the one in use then speaks for this instant ([`Self::in_use`]).
    pub fn step(&mut self, transition: &Matrix, update: &Correction, work: &mut PropagatorWork) {
        self.steps = self.steps.saturating_add(1);
        for propagator in &mut self.propagators {
            propagator.step(transition, update, work);
        }
    }

    /// Restarts after the steps L, 2L, ...: at first the second one, from then on the one in use. To be called before the
    /// next step, so that the one in use speaks until then.
    pub fn restart_when_due(&mut self, reset_steps: u64) {
        if !self.steps.is_multiple_of(reset_steps) || self.steps == 0 {
            return;
        }
        let [first, second] = &mut self.propagators;
        if self.steps == reset_steps {
            second.clear();
        } else {
            if self.second_in_use { second } else { first }.clear();
            self.second_in_use = !self.second_in_use;
        }
    }

    pub fn in_use(&self) -> &Propagator {
        let [first, second] = &self.propagators;
        if self.second_in_use { second } else { first }
    }

    pub fn is_finite(&self) -> bool {
        self.propagators.iter().all(Propagator::is_finite)
    }

    pub fn fits(&self, other: &Self) -> bool {
        let [first, second] = &self.propagators;
        let [other_first, other_second] = &other.propagators;
        first.fits(other_first) && second.fits(other_second)
    }
}
