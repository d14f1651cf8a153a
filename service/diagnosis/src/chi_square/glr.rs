//! Generalised likelihood ratio on the whitened innovations (method sheet 4, step 9).
//!
//! Every onset θ of the last M steps, s apart, has a slot with q columns, one per fault mode. With the amplitude
//! matrix J (sensor faults) and the entry matrix N (process faults) of the modes at this instant:
//! Δ = Φ F - N, g = L_S⁻¹ (J - H Δ), F = Δ + K̄ g, A += g'e, E += ‖g‖², ℓ = max A²/E.

use super::{
    filter::Correction,
    finite::all_finite,
    glr_modes::FaultMode,
    glr_table::{Amplitudes, SteadyTable},
};
use crate::matrix::{Matrix, add_combination, add_scaled, combination, multiply};
use serde::{Deserialize, Serialize};

/// Energy below which a mode leaves no trace in the innovations.
pub(super) const NO_TRACE: f64 = 1e-12;
/// Slots whose largest ratios are sought side by side.
pub(super) const LANES: usize = 8;

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
    pub(super) fn process_fault(&self, mode: &FaultMode) -> Option<usize> {
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
    amplitudes: Amplitudes,
    /// Only for a new onset at every instant: otherwise there are as many tables as instants between two onsets.
    table: Option<SteadyTable>,
    /// A²/E of every column.
    pub(super) ratio: Vec<f64>,
    /// The largest of them over every eighth slot, mode by mode.
    pub(super) largest: Vec<f64>,
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
            amplitudes: Amplitudes::new(states, design),
            table: (design.stride == 1).then(|| SteadyTable::new(states, design.measurements, columns)),
            ratio: vec![0.0; columns],
            largest: vec![0.0; LANES * design.modes.len()],
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
        if !self.look_up(design, update, work) {
            self.move_slots(design, transition, measurement, update, work);
        }
        for (signature, e) in work.signature.iter_rows().zip(&update.whitened) {
            add_scaled(&mut self.score, *e, signature);
        }
        self.find_best(design, work);
    }

    /// F, E and g from the table, once the gains have been the same since the oldest onset.
    fn look_up(&mut self, design: &GlrDesign, update: &Correction, work: &mut GlrWork) -> bool {
        let Some(mut table) = work.table.take() else {
            return false;
        };
        let window = design.window_steps;
        let steady = update.steady_steps as u64 >= window && self.steps > window;
        let oldest = (self.newest_slot(design) + 1) * design.modes.len();
        let found = steady && table.give(oldest, self, work);
        if !found {
            table.clear();
        }
        work.table = Some(table);
        found
    }

    /// F, E and g of this instant.
    fn move_slots(
        &mut self,
        design: &GlrDesign,
        transition: &Matrix,
        measurement: &Matrix,
        update: &Correction,
        work: &mut GlrWork,
    ) {
        work.amplitudes.update(design, self);
        self.delta(transition, work);
        signature(measurement, update, work);
        for i in 0..self.sensitivity.rows() {
            let row = self.sensitivity.row_mut(i);
            row.copy_from_slice(work.delta.row(i));
            add_combination(row, update.gain.row(i), &work.signature);
        }
        for signature in work.signature.iter_rows() {
            for (energy, g) in self.energy.iter_mut().zip(signature) {
                *energy += g * g;
            }
        }
        let window = design.window_steps;
        if update.steady_steps as u64 >= window
            && self.steps >= window
            && let Some(table) = &mut work.table
        {
            let oldest = (self.newest_slot(design) + 1) * design.modes.len();
            table.take(oldest, self, &work.signature);
        }
    }

    /// Of all slots only the newest can open, and only the oldest can have left the window.
    fn open_and_drop(&mut self, design: &GlrDesign) {
        let k = self.steps;
        let newest = self.newest_slot(design);
        let oldest = (newest + 1) % self.onsets.len();
        if self.onsets[oldest] > 0 && k - self.onsets[oldest] >= design.window_steps {
            self.empty(oldest, design);
        }
        if (k - 1).is_multiple_of(design.stride) {
            self.empty(newest, design);
            self.onsets[newest] = k;
        }
    }

    fn empty(&mut self, slot: usize, design: &GlrDesign) {
        self.onsets[slot] = 0;
        let columns = slot * design.modes.len()..(slot + 1) * design.modes.len();
        self.score[columns.clone()].fill(0.0);
        self.energy[columns.clone()].fill(0.0);
        for i in 0..self.sensitivity.rows() {
            self.sensitivity.row_mut(i)[columns.clone()].fill(0.0);
        }
    }

    /// Δ = Φ F - N: the shift of x̂ against x, of which a process fault moves x.
    fn delta(&self, transition: &Matrix, work: &mut GlrWork) {
        multiply(transition, &self.sensitivity, &mut work.delta);
        let Amplitudes { entry, present, .. } = &work.amplitudes;
        if entry.columns() > 0 {
            for i in 0..work.delta.rows() {
                let terms = entry.row(i).iter().zip(present);
                for (delta, (entry, amplitude)) in work.delta.row_mut(i).iter_mut().zip(terms) {
                    *delta -= entry * amplitude;
                }
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

/// g = L_S⁻¹ (J - H Δ), rows a.
fn signature(measurement: &Matrix, update: &Correction, work: &mut GlrWork) {
    let GlrWork {
        delta,
        amplitudes,
        signature,
        ..
    } = work;
    signature.reshape(update.rows.len(), delta.columns());
    let factor = &update.innovation_factor;
    for (i, row) in update.rows.iter().enumerate() {
        let g = signature.row_mut(i);
        combination(g, measurement.row(*row), delta);
        let terms = amplitudes.feedthrough.row(*row).iter().zip(&amplitudes.present);
        for (g, (direction, amplitude)) in g.iter_mut().zip(terms) {
            *g = direction * amplitude - *g;
        }
        for j in 0..i {
            let (known, row) = signature.two_rows(j, i);
            add_scaled(row, -factor[(i, j)], known);
        }
        let pivot = factor[(i, i)];
        signature.row_mut(i).iter_mut().for_each(|g| *g /= pivot);
    }
}
