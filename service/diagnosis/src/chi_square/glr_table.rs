//! What the likelihood ratio looks up instead of computing.
//!
//! Slots are reused in turn, so that the slots from the newest one on, backwards, have the ages b, b + s, b + 2s, …
//! with b = (k - 1) mod s. Tables stand in the order of age, oldest first: one rotation brings them to the slots.

use super::{
    glr::{Glr, GlrDesign, GlrWork},
    glr_modes::FaultProfile,
};
use crate::matrix::Matrix;

/// What every column adds to state and measurement, slot by slot, mode by mode.
#[derive(Clone, Debug)]
pub(super) struct Amplitudes {
    /// Amplitude at b = 0, oldest slot first.
    at_opening: Vec<f64>,
    /// What it grows by with b.
    growth: Vec<f64>,
    /// Amplitude at this instant in the order of the slots; -0 for slots that are not in use.
    pub present: Vec<f64>,
    /// Entry of each column into the state, n x columns; without process faults no columns.
    pub entry: Matrix,
    /// Entry into the measurement, m x columns.
    pub feedthrough: Matrix,
}

impl Amplitudes {
    pub fn new(states: usize, design: &GlrDesign) -> Self {
        let (slots, modes) = (design.slots(), design.modes.len());
        let columns = slots * modes;
        let process = design.entry.columns() > 0;
        let mut amplitudes = Self {
            at_opening: vec![0.0; columns],
            growth: vec![0.0; columns],
            present: vec![0.0; columns],
            entry: Matrix::zeros(states, if process { columns } else { 0 }),
            feedthrough: Matrix::zeros(design.measurements, columns),
        };
        for column in 0..columns {
            let mode = &design.modes[column % modes];
            let age = design.stride * (slots - 1 - column / modes) as u64;
            amplitudes.at_opening[column] = mode.profile.amplitude(age);
            amplitudes.growth[column] = f64::from(u8::from(mode.profile == FaultProfile::Ramp));
            match design.process_fault(mode) {
                Some(fault) => {
                    for i in 0..states {
                        amplitudes.entry[(i, column)] = design.entry[(i, fault)];
                    }
                    for i in 0..design.measurements {
                        amplitudes.feedthrough[(i, column)] = design.feedthrough[(i, fault)];
                    }
                }
                None => amplitudes.feedthrough[(mode.component, column)] = 1.0,
            }
        }
        amplitudes
    }

    /// Brings the amplitudes to this instant.
    pub fn update(&mut self, design: &GlrDesign, glr: &Glr) {
        let modes = design.modes.len();
        let oldest = (glr.newest_slot(design) + 1) * modes;
        to_slots(&self.at_opening, oldest, &mut self.present);
        let age = (glr.steps.saturating_sub(1) % design.stride) as f64;
        if age > 0.0 {
            let (new, old) = self.present.split_at_mut(oldest);
            for (amplitude, growth) in old.iter_mut().chain(new).zip(&self.growth) {
                *amplitude += age * growth;
            }
        }
        for (slot, onset) in self.present.chunks_exact_mut(modes).zip(&glr.onsets) {
            if *onset == 0 {
                slot.fill(-0.0);
            }
        }
    }
}

/// F, E and g of every age, for gains that have been the same for as long as the oldest slot is open.
#[derive(Clone, Debug)]
pub(super) struct SteadyTable {
    filled: bool,
    sensitivity: Matrix,
    energy: Vec<f64>,
    signature: Matrix,
}

impl SteadyTable {
    pub fn new(states: usize, measurements: usize, columns: usize) -> Self {
        Self {
            filled: false,
            sensitivity: Matrix::zeros(states, columns),
            energy: vec![0.0; columns],
            signature: Matrix::zeros(measurements, columns),
        }
    }

    /// Forgets what was found.
    pub fn clear(&mut self) {
        self.filled = false;
    }

    /// Takes over what an instant gave; `oldest` is the first column of the oldest slot.
    pub fn take(&mut self, oldest: usize, glr: &Glr, signature: &Matrix) {
        self.filled = true;
        for i in 0..glr.sensitivity.rows() {
            to_ages(glr.sensitivity.row(i), oldest, self.sensitivity.row_mut(i));
        }
        for i in 0..signature.rows() {
            to_ages(signature.row(i), oldest, self.signature.row_mut(i));
        }
        to_ages(&glr.energy, oldest, &mut self.energy);
    }

    /// Gives it to another instant; false if there is nothing.
    pub fn give(&self, oldest: usize, glr: &mut Glr, work: &mut GlrWork) -> bool {
        if !self.filled {
            return false;
        }
        for i in 0..glr.sensitivity.rows() {
            to_slots(self.sensitivity.row(i), oldest, glr.sensitivity.row_mut(i));
        }
        work.signature
            .reshape(self.signature.rows(), self.signature.columns());
        for i in 0..self.signature.rows() {
            to_slots(self.signature.row(i), oldest, work.signature.row_mut(i));
        }
        to_slots(&self.energy, oldest, &mut glr.energy);
        true
    }
}

/// From the order of ages to that of the slots.
fn to_slots(ages: &[f64], oldest: usize, slots: &mut [f64]) {
    let (new, old) = slots.split_at_mut(oldest);
    let (first, last) = ages.split_at(old.len());
    old.copy_from_slice(first);
    new.copy_from_slice(last);
}

/// From the order of the slots to that of ages.
fn to_ages(slots: &[f64], oldest: usize, ages: &mut [f64]) {
    let (new, old) = slots.split_at(oldest);
    let (first, last) = ages.split_at_mut(old.len());
    first.copy_from_slice(old);
    last.copy_from_slice(new);
}
