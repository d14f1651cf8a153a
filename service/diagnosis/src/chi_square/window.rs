//! Sliding windows: the propagator restarted from the filter's estimate of N steps ago (method sheet 4, step 7).
//!
//! From the newest to the oldest of the last N instants: β -= M_i γ_{k-i}, T += M_i K̄_{k-i} (M_i K̄_{k-i})', with
//! M_0 = I, M_{i+1} = M_i Φ_{k-i}. One pass serves every N of a bank.

use super::engine::Statistic;
use super::filter::Correction;
use super::quadratic_form::QuadraticForm;
use crate::matrix::{Matrix, add_scaled, apply, multiply, triangularise};
use serde::{Deserialize, Serialize};

/// What the windows keep of one instant.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Entry {
    transition: Matrix,
    correction: Vec<f64>,
    gain: Matrix,
}

/// The last N_max instants.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Ring {
    entries: Vec<Entry>,
    newest: usize,
    count: usize,
}

impl Ring {
    pub fn new(states: usize, measurements: usize, length: usize) -> Self {
        let entry = Entry {
            transition: Matrix::zeros(states, states),
            correction: vec![0.0; states],
            gain: Matrix::zeros(states, measurements),
        };
        Self {
            entries: vec![entry; length],
            newest: 0,
            count: 0,
        }
    }

    pub fn clear(&mut self) {
        for entry in &mut self.entries {
            let room = (entry.gain.rows(), entry.gain.column_capacity());
            entry.gain.reshape(room.0, room.1);
            entry.gain.fill(0.0);
            entry.transition.fill(0.0);
            entry.correction.fill(0.0);
        }
        self.newest = 0;
        self.count = 0;
    }

    pub fn push(&mut self, transition: &Matrix, update: &Correction) {
        self.newest = (self.newest + 1) % self.entries.len().max(1);
        self.count = (self.count + 1).min(self.entries.len());
        if let Some(entry) = self.entries.get_mut(self.newest) {
            entry.transition.copy_from(transition);
            entry.correction.copy_from_slice(&update.correction);
            entry.gain.copy_from(&update.gain);
        }
    }

    /// The entry of `age` instants ago; `None` before the start.
    fn entry(&self, age: usize) -> Option<&Entry> {
        let length = self.entries.len();
        (age < self.count)
            .then(|| (self.newest + length - age) % length)
            .and_then(|index| self.entries.get(index))
    }

    pub fn fits(&self, other: &Self) -> bool {
        let entries = self.entries.iter().zip(&other.entries);
        self.entries.len() == other.entries.len()
            && self.count <= self.entries.len()
            && self.newest < self.entries.len()
            && entries.into_iter().all(|(entry, other)| {
                entry.transition.shape() == other.transition.shape()
                    && entry.correction.len() == other.correction.len()
                    && entry.gain.has_room_of(&other.gain)
                    && entry.gain.rows() == other.gain.rows()
            })
    }

    /// M_i K̄_{k-i} for i = 0, 1, ... (allocates; for the calibration).
    pub fn gains(&self) -> Vec<Matrix> {
        let Some(first) = self.entry(0) else {
            return Vec::new();
        };
        let n = first.correction.len();
        let mut power = identity(n);
        let mut next = Matrix::zeros(n, n);
        let mut gains = Vec::new();
        for entry in (0..self.count).filter_map(|age| self.entry(age)) {
            let mut gain = Matrix::zeros(n, entry.gain.columns());
            multiply(&power, &entry.gain, &mut gain);
            gains.push(gain);
            multiply(&power, &entry.transition, &mut next);
            power.copy_from(&next);
        }
        gains
    }
}

fn identity(order: usize) -> Matrix {
    let mut matrix = Matrix::with_capacity(order, order);
    matrix.append_diagonal(&vec![1.0; order]);
    matrix
}

/// One window at one instant.
#[derive(Clone, Debug)]
pub(super) struct WindowOutcome {
    /// N.
    pub steps: usize,
    pub statistic: Statistic,
    /// β_N, length n.
    pub difference: Vec<f64>,
    /// Factor of T_N, n x n.
    pub factor: Matrix,
    form: QuadraticForm,
}

/// The windows of a bank, and the room to evaluate them.
///
/// M_i, T_N and its factor depend on the gains only: once these have been the same over the longest window, all that
/// is left of an instant is β_N and its quadratic form.
#[derive(Clone, Debug)]
pub(super) struct WindowBank {
    /// In ascending order of N.
    pub outcomes: Vec<WindowOutcome>,
    difference: Vec<f64>,
    moved: Vec<f64>,
    /// M_i.
    powers: Vec<Matrix>,
    moved_gain: Matrix,
    columns: Matrix,
    /// Whether `powers` and the factors are those of the gains that have been the same over the longest window.
    tabulated: bool,
}

impl WindowBank {
    /// Windows of these lengths, in ascending order; `tolerance` is that of the rank of T.
    pub fn new(states: usize, measurements: usize, lengths: &[usize], tolerance: f64) -> Self {
        let longest = lengths.iter().max().copied().unwrap_or(0);
        let outcome = |steps: &usize| WindowOutcome {
            steps: *steps,
            statistic: Statistic::default(),
            difference: vec![0.0; states],
            factor: Matrix::zeros(states, states),
            form: QuadraticForm::new(states, tolerance),
        };
        Self {
            outcomes: lengths.iter().map(outcome).collect(),
            difference: vec![0.0; states],
            moved: vec![0.0; states],
            powers: vec![identity(states); longest + 1],
            moved_gain: Matrix::zeros(states, measurements),
            columns: Matrix::with_capacity(states, states + longest * measurements),
            tabulated: false,
        }
    }

    /// Evaluates every window at the newest instant of the ring; the gains have been the same for `steady_steps`.
    pub fn evaluate(&mut self, ring: &Ring, steady_steps: usize) {
        let longest = self.powers.len() - 1;
        let steady = steady_steps >= longest && ring.count >= longest;
        if !(steady && self.tabulated) {
            self.factor(ring);
            self.tabulated = steady;
        }
        self.difference.fill(0.0);
        let mut age = 0;
        for outcome in &mut self.outcomes {
            while age < outcome.steps {
                let Some(entry) = ring.entry(age) else { break };
                apply(&self.powers[age], &entry.correction, &mut self.moved);
                add_scaled(&mut self.difference, -1.0, &self.moved);
                age += 1;
            }
            outcome.difference.copy_from_slice(&self.difference);
            outcome.statistic = Statistic {
                value: outcome.form.evaluate(&outcome.difference),
                degrees: outcome.form.degrees(),
            };
        }
    }

    /// M_i and the factors of every T_N.
    fn factor(&mut self, ring: &Ring) {
        self.columns.reshape(self.difference.len(), 0);
        let mut age = 0;
        for outcome in &mut self.outcomes {
            while age < outcome.steps {
                let Some(entry) = ring.entry(age) else { break };
                let (known, next) = self.powers.split_at_mut(age + 1);
                multiply(&known[age], &entry.gain, &mut self.moved_gain);
                self.columns.append(&self.moved_gain);
                multiply(&known[age], &entry.transition, &mut next[0]);
                age += 1;
            }
            triangularise(&mut self.columns);
            outcome.factor.copy_from(&self.columns);
            outcome.form.factor(&outcome.factor);
        }
    }
}
