//! Generalised likelihood ratio on the whitened innovations (method sheet 4, step 9).
//!
//! Every onset θ of the last M steps, s apart, has a slot with q columns, one per fault mode. With the amplitude
//! matrix J (sensor faults) and the entry matrix N (process faults) of the modes at this instant:
//! Δ = Φ F - N, g = L_S⁻¹ (J - H Δ), F = Δ + K̄ g, A += g'e, E += ‖g‖², ℓ = max A²/E.

use super::{filter::Correction, glr_modes::FaultMode};
use crate::matrix::{Matrix, add_combination, add_scaled, all_finite, combination, multiply};
use serde::{Deserialize, Serialize};

/// Energy below which a mode leaves no trace in the innovations.
const NO_TRACE: f64 = 1e-12;

/// What does not change: the modes and the window.
#[derive(Clone, Debug)]
pub(super) struct GlrDesign {
    pub modes: Vec<FaultMode>,
    pub measurements: usize,
    /// How the process faults enter the state, n x faults.
    pub entry: Matrix,
    /// How they enter the measurement, m x faults.
    pub feedthrough: Matrix,
    /// M.
    pub window_steps: u64,
    /// s.
    pub stride: u64,
}

impl GlrDesign {
    /// Number of slots, ⌈M/s⌉.
    pub fn slots(&self) -> usize {
        self.window_steps.div_ceil(self.stride.max(1)) as usize
    }

    /// Number of components: sensors and process faults.
    pub fn components(&self) -> usize {
        self.measurements + self.entry.columns()
    }

    /// Position of a process fault among the columns of `entry`; `None` for a sensor.
    fn process_fault(&self, mode: &FaultMode) -> Option<usize> {
        mode.component.checked_sub(self.measurements)
    }
}

/// The slots; columns are slot by slot, mode by mode.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Glr {
    /// Steps since the start.
    pub steps: u64,
    /// Onset θ of each slot; 0: not in use.
    pub onsets: Vec<u64>,
    /// F, n x (slots q).
    pub sensitivity: Matrix,
    /// A.
    pub score: Vec<f64>,
    /// E.
    pub energy: Vec<f64>,
}

/// The likeliest fault of a set of modes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LikelihoodRatio {
    /// ℓ = A²/E.
    pub value: f64,
    /// Position of the mode in the order of modes.
    pub mode: usize,
    /// k - θ, steps.
    pub age: u64,
    /// f̂ = A/E, in the unit of the component, per step for a ramp.
    pub size: f64,
    /// Its standard deviation 1/sqrt(E).
    pub standard_deviation: f64,
    pub(super) column: usize,
}

/// Room for one step, and what it found.
#[derive(Clone, Debug)]
pub(super) struct GlrWork {
    delta: Matrix,
    /// g, m_k x (slots q).
    pub signature: Matrix,
    /// The likeliest fault of each component.
    pub best_of_component: Vec<Option<LikelihoodRatio>>,
    /// The likeliest fault of all.
    pub best: Option<LikelihoodRatio>,
}

impl GlrWork {
    pub fn new(states: usize, design: &GlrDesign) -> Self {
        let columns = design.slots() * design.modes.len();
        Self {
            delta: Matrix::zeros(states, columns),
            signature: Matrix::zeros(design.measurements, columns),
            best_of_component: vec![None; design.components()],
            best: None,
        }
    }
}

impl Glr {
    pub fn new(states: usize, design: &GlrDesign) -> Self {
        let columns = design.slots() * design.modes.len();
        Self {
            steps: 0,
            onsets: vec![0; design.slots()],
            sensitivity: Matrix::zeros(states, columns),
            score: vec![0.0; columns],
            energy: vec![0.0; columns],
        }
    }

    pub fn clear(&mut self) {
        self.steps = 0;
        self.onsets.fill(0);
        self.sensitivity.fill(0.0);
        self.score.fill(0.0);
        self.energy.fill(0.0);
    }

    /// The slot opened last, once there is one.
    pub fn newest_slot(&self, design: &GlrDesign) -> usize {
        (self.steps.saturating_sub(1) / design.stride.max(1)) as usize % self.onsets.len().max(1)
    }

    /// One instant: opens and drops slots, moves every slot and finds the likeliest fault.
    pub fn step(
        &mut self,
        design: &GlrDesign,
        transition: &Matrix,
        measurement: &Matrix,
        update: &Correction,
        work: &mut GlrWork,
    ) {
        self.steps = self.steps.saturating_add(1);
        self.open_and_drop(design);
        self.delta(design, transition, work);
        self.signature(design, measurement, update, work);
        for i in 0..self.sensitivity.rows() {
            let row = self.sensitivity.row_mut(i);
            row.copy_from_slice(work.delta.row(i));
            add_combination(row, update.gain.row(i), &work.signature);
        }
        for (signature, e) in work.signature.iter_rows().zip(&update.whitened) {
            add_scaled(&mut self.score, *e, signature);
            for (energy, g) in self.energy.iter_mut().zip(signature) {
                *energy += g * g;
            }
        }
        self.find_best(design, work);
    }

    fn open_and_drop(&mut self, design: &GlrDesign) {
        let k = self.steps;
        let newest = self.newest_slot(design);
        for slot in 0..self.onsets.len() {
            let opens = slot == newest && (k - 1).is_multiple_of(design.stride);
            let drops = self.onsets[slot] > 0 && k - self.onsets[slot] >= design.window_steps;
            if opens || drops {
                self.onsets[slot] = if opens { k } else { 0 };
                let columns = slot * design.modes.len()..(slot + 1) * design.modes.len();
                self.score[columns.clone()].fill(0.0);
                self.energy[columns.clone()].fill(0.0);
                for i in 0..self.sensitivity.rows() {
                    self.sensitivity.row_mut(i)[columns.clone()].fill(0.0);
                }
            }
        }
    }

    /// Δ = Φ F - N: the shift of x̂ against x, of which a process fault moves x.
    fn delta(&self, design: &GlrDesign, transition: &Matrix, work: &mut GlrWork) {
        multiply(transition, &self.sensitivity, &mut work.delta);
        for (column, mode, age) in columns(&self.onsets, self.steps, &design.modes) {
            if let Some(fault) = design.process_fault(mode) {
                for i in 0..work.delta.rows() {
                    work.delta[(i, column)] -= design.entry[(i, fault)] * mode.profile.amplitude(age);
                }
            }
        }
    }

    /// g = L_S⁻¹ (J - H Δ), rows a.
    fn signature(&self, design: &GlrDesign, measurement: &Matrix, update: &Correction, work: &mut GlrWork) {
        let signature = &mut work.signature;
        signature.reshape(update.rows.len(), self.score.len());
        for (i, row) in update.rows.iter().enumerate() {
            combination(signature.row_mut(i), measurement.row(*row), &work.delta);
            signature.row_mut(i).iter_mut().for_each(|value| *value = -*value);
        }
        for (column, mode, age) in columns(&self.onsets, self.steps, &design.modes) {
            let amplitude = mode.profile.amplitude(age);
            for (i, row) in update.rows.iter().enumerate() {
                let direction = match design.process_fault(mode) {
                    Some(fault) => design.feedthrough[(*row, fault)],
                    None => f64::from(u8::from(*row == mode.component)),
                };
                signature[(i, column)] += direction * amplitude;
            }
        }
        let factor = &update.innovation_factor;
        for i in 0..update.rows.len() {
            for j in 0..i {
                let (known, row) = signature.two_rows(j, i);
                add_scaled(row, -factor[(i, j)], known);
            }
            let pivot = factor[(i, i)];
            signature.row_mut(i).iter_mut().for_each(|value| *value /= pivot);
        }
    }

    /// ℓ of every component and of all: the oldest slot and the lowest mode win ties.
    fn find_best(&self, design: &GlrDesign, work: &mut GlrWork) {
        work.best_of_component.fill(None);
        let (slots, modes) = (self.onsets.len(), design.modes.len());
        let newest = self.newest_slot(design);
        for slot in (1..=slots).map(|i| (newest + i) % slots) {
            let onset = self.onsets[slot];
            if onset == 0 {
                continue;
            }
            for (mode, FaultMode { component, .. }) in design.modes.iter().enumerate() {
                let column = slot * modes + mode;
                let (score, energy) = (self.score[column], self.energy[column]);
                let value = score * score / energy;
                if energy > NO_TRACE
                    && let Some(best) = work.best_of_component.get_mut(*component)
                    && best.is_none_or(|best| value > best.value)
                {
                    *best = Some(LikelihoodRatio {
                        value,
                        mode,
                        age: self.steps - onset,
                        size: score / energy,
                        standard_deviation: 1.0 / energy.sqrt(),
                        column,
                    });
                }
            }
        }
        let older = |a: &LikelihoodRatio, b: &LikelihoodRatio| (b.age, a.mode) < (a.age, b.mode);
        work.best = None;
        for found in work.best_of_component.iter().flatten() {
            let better = work.best.is_none_or(|best| {
                found.value > best.value || found.value == best.value && older(found, &best)
            });
            if better {
                work.best = Some(*found);
            }
        }
    }

    /// 1/E of a column; zero where the mode leaves no trace.
    pub fn inverse_energy(&self, column: usize) -> f64 {
        match self.energy.get(column) {
            Some(energy) if *energy > NO_TRACE => 1.0 / energy,
            _ => 0.0,
        }
    }

    pub fn is_finite(&self) -> bool {
        all_finite(&self.score) && all_finite(&self.energy) && self.sensitivity.iter_rows().all(all_finite)
    }

    pub fn fits(&self, other: &Self) -> bool {
        self.onsets.len() == other.onsets.len()
            && self.onsets.iter().all(|onset| *onset <= self.steps)
            && self.sensitivity.shape() == other.sensitivity.shape()
            && self.score.len() == other.score.len()
            && self.energy.len() == other.energy.len()
    }
}

/// The columns in use with their mode and age k - θ.
fn columns<'a>(
    onsets: &'a [u64],
    steps: u64,
    modes: &'a [FaultMode],
) -> impl Iterator<Item = (usize, &'a FaultMode, u64)> {
    let slots = onsets.iter().enumerate().filter(|(_, onset)| **onset > 0);
    slots.flat_map(move |(slot, onset)| {
        let first = slot * modes.len();
        let age = steps - onset;
        modes
            .iter()
            .enumerate()
            .map(move |(mode, shape)| (first + mode, shape, age))
    })
}
