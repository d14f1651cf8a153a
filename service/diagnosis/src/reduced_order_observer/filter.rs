//! One pair of observers in operation: test, propagation, gaps (method sheet 4).
//!
//! The error z̃ lies in ⟨c, H⟩ plus the zero-start set of age j, whose supports are tabulated.

use super::{
    inputs::{Commands, Inputs},
    observer_design::ObserverDesign,
    observer_pair::ObserverPair,
    plant::Plant,
    reach::infinity_norm,
    start::Start,
    test_row::TestRow,
    workspace::Workspace,
};
use crate::matrix::{Matrix, absolute_sum, all_finite, apply, combination, multiply};
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// After a gap without fault bound a member is trusted again when |A_e^j|∞ is below this.
const FORGOTTEN: f64 = 1e-6;
/// Limit of that j.
const LONGEST_MEMORY: u32 = 100_000;
/// H is dropped below this share of the rounding tolerance.
const DROPPED: f64 = 1e-3;

/// What changes from instant to instant.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct FilterState {
    /// ẑ1, length p.
    pub z1: Vec<f64>,
    /// ẑ2, length nz.
    pub z2: Vec<f64>,
    /// c, length n.
    pub centre: Vec<f64>,
    /// H, n x h.
    pub generators: Matrix,
    /// j, at most J.
    pub age: u32,
    /// Instants for which a fault of the own actuator during a gap may still be felt.
    pub unguaranteed: u32,
}

impl FilterState {
    /// Takes another state of the same lengths without allocating.
    pub fn copy_from(&mut self, other: &Self) {
        self.z1.copy_from_slice(&other.z1);
        self.z2.copy_from_slice(&other.z2);
        self.centre.copy_from_slice(&other.centre);
        self.generators.copy_from(&other.generators);
        self.age = other.age;
        self.unguaranteed = other.unguaranteed;
    }

    /// Whether a saved state has the lengths and the room of this one.
    pub fn fits(&self, other: &Self) -> bool {
        self.z1.len() == other.z1.len()
            && self.z2.len() == other.z2.len()
            && self.centre.len() == other.centre.len()
            && self.generators.rows() == other.generators.rows()
            && self.generators.has_room_of(&other.generators)
    }
}

/// The constants of one pair of observers.
#[derive(Clone, Debug)]
pub(super) struct Filter {
    pub(super) observers: ObserverPair,
    pub(super) a_e: Matrix,
    /// D_e p_η.
    pub(super) shift: Vec<f64>,
    /// D_e H_η.
    pub(super) disturbance: Matrix,
    /// -\[N; J\] V.
    pub(super) noise: Matrix,
    /// W.
    pub(super) tests: Matrix,
    /// t, (J + 1) x nw.
    pub(super) thresholds: Matrix,
    /// X_inf.
    pub(super) steady: Matrix,
    /// \[B1; E_z\]_i f_bound_i of a member or estimator with a fault bound.
    pub(super) fault: Option<Matrix>,
    /// Instants after which a fault during a gap is forgotten; 0 for the main observer.
    pub(super) memory: u32,
    pub(super) rounding_tolerance: f64,
    pub(super) order: usize,
    /// The actuator whose fault z2 does not see.
    pub actuator: Option<usize>,
}

impl Filter {
    /// The constants of a design; `fault_bound` is the bound of the own actuator's fault during gaps.
    pub fn new(
        plant: &Plant,
        design: &ObserverDesign,
        order: usize,
        rounding_tolerance: f64,
        fault_bound: Option<f64>,
    ) -> Self {
        let observer = &design.observer;
        let noise = -observer.noise_input() * DMatrix::from_diagonal(&plant.noise_bound);
        let fault = design
            .actuator
            .zip(fault_bound)
            .map(|(actuator, bound)| Matrix::from(&(observer.input.columns(actuator, 1) * bound)));
        let forgets = design.actuator.is_some() && fault.is_none();
        Self {
            observers: ObserverPair::new(observer),
            a_e: Matrix::from(&observer.a_e),
            shift: (&observer.d_e * &plant.disturbance.centre).as_slice().to_vec(),
            disturbance: Matrix::from(&(&observer.d_e * DMatrix::from_diagonal(&plant.disturbance.radius))),
            noise: Matrix::from(&noise),
            tests: Matrix::from(&design.tests),
            thresholds: Matrix::from(&design.thresholds),
            steady: design.reach.steady_generators(plant.states(), order),
            fault,
            memory: if forgets { memory(&observer.a_e) } else { 0 },
            rounding_tolerance,
            order,
            actuator: design.actuator,
        }
    }

    /// A state with room for every set that occurs, before the start.
    pub fn idle_state(&self) -> FilterState {
        let (n, p) = (self.a_e.rows(), self.observers.a1.rows());
        FilterState {
            z1: vec![0.0; p],
            z2: vec![0.0; n - p],
            centre: vec![0.0; n],
            generators: Matrix::with_capacity(n, self.generator_capacity()),
            age: 0,
            unguaranteed: 0,
        }
    }

    /// Whether the age of a saved state lies in the table.
    pub fn admits(&self, state: &FilterState) -> bool {
        let generators = &state.generators;
        (state.age as usize) < self.thresholds.rows()
            && generators.columns() + self.gap_columns() <= generators.column_capacity()
    }

    /// Columns that one gap adds to H before it is reduced: the steady set and the member's own fault.
    fn gap_columns(&self) -> usize {
        self.steady.columns() + 1
    }

    /// Number of test rows.
    pub fn row_count(&self) -> usize {
        self.tests.rows()
    }

    /// Columns of H: a start or a reduced set, and what one gap adds before it is reduced.
    pub fn generator_capacity(&self) -> usize {
        let (n, p) = (self.a_e.rows(), self.observers.a1.rows());
        let start = n + p + self.disturbance.columns() + self.observers.input.columns();
        start.max(self.order) + self.gap_columns()
    }

    /// Columns of the product that a gap forms.
    pub fn product_capacity(&self) -> usize {
        self.generator_capacity()
            + self.disturbance.columns()
            + self.noise.columns()
            + self.observers.input.columns()
    }

    /// Takes the state at the first instant. From the measured output nothing is left to test there.
    pub fn start(&self, state: &mut FilterState, start: &Start, inputs: &Inputs) {
        start.observers(&inputs.y, &mut state.z1, &mut state.z2);
        state.centre.fill(0.0);
        state.generators.reshape(self.a_e.rows(), 0);
        state.age = 0;
        state.unguaranteed = 0;
        if !start.is_at_output() {
            state.generators.append(start.generators());
        }
    }

    /// From the first instant, whose output is the start, to the next one.
    pub fn leave_start(
        &self,
        state: &mut FilterState,
        start: &Start,
        inputs: &Inputs,
        work: &mut Workspace,
    ) -> bool {
        self.observers
            .advance(&mut state.z1, &mut state.z2, inputs, &mut work.observers);
        state.centre.copy_from_slice(&self.shift);
        state.generators.copy_from(start.generators());
        if inputs.commands == Commands::Bridged {
            state
                .generators
                .append_scaled(&self.observers.input, &inputs.u_radius);
        }
        is_finite(state)
    }

    /// Step 3 and 4: all test rows.
    pub fn test(&self, state: &FilterState, inputs: &Inputs, work: &mut Workspace, rows: &mut [TestRow]) {
        let thresholds = self.thresholds.row(state.age as usize);
        let image = work
            .image
            .get_mut(..state.generators.columns())
            .unwrap_or_default();
        for (row, (w, threshold)) in rows.iter_mut().zip(self.tests.iter_rows().zip(thresholds)) {
            *row = TestRow {
                evaluated: true,
                half_width: *threshold,
                centre: w.iter().zip(&state.centre).map(|(w, c)| w * c).sum(),
                ..TestRow::default()
            };
            let mut size = 1.0;
            let samples = inputs.y.iter().zip(&inputs.valid).zip(&state.z1);
            for (w, ((y, valid), z1)) in w.iter().zip(samples) {
                if *valid {
                    row.residual += w * (y - z1);
                    size += w.abs() * (y.abs() + z1.abs());
                } else {
                    row.evaluated &= *w == 0.0;
                }
            }
            row.half_width += self.rounding_tolerance * size;
            if !image.is_empty() {
                combination(image, w, &state.generators);
                row.half_width += absolute_sum(image);
            }
        }
    }

    /// Step 6 and 7: to the next instant. False if the state is not finite any more.
    pub fn advance(&self, state: &mut FilterState, inputs: &Inputs, work: &mut Workspace) -> bool {
        if inputs.complete() {
            self.advance_set(state, work);
        } else {
            self.advance_set_over_gap(state, inputs, work);
        }
        self.observers
            .advance(&mut state.z1, &mut state.z2, inputs, &mut work.observers);
        is_finite(state)
    }

    /// Without a gap: H ← A_e H, c ← A_e c + D_e p_η, the rest is in the table.
    fn advance_set(&self, state: &mut FilterState, work: &mut Workspace) {
        shifted(&self.a_e, &self.shift, &mut state.centre, &mut work.centre);
        if state.generators.columns() > 0 {
            multiply(&self.a_e, &state.generators, &mut work.product);
            state.generators.copy_from(&work.product);
            let largest = state
                .generators
                .iter_rows()
                .flatten()
                .fold(0.0_f64, |most, h| most.max(h.abs()));
            if largest <= DROPPED * self.rounding_tolerance {
                state.generators.reshape(self.a_e.rows(), 0);
            }
        }
        let last = self.thresholds.rows() as u32 - 1;
        state.age = (state.age + 1).min(last);
        state.unguaranteed = state.unguaranteed.saturating_sub(1);
    }
}

/// `centre` ← `dynamics` `centre` + `shift`.
pub(super) fn shifted(dynamics: &Matrix, shift: &[f64], centre: &mut [f64], room: &mut [f64]) {
    apply(dynamics, centre, room);
    for ((target, value), shift) in centre.iter_mut().zip(room.iter()).zip(shift) {
        *target = value + shift;
    }
}

fn is_finite(state: &FilterState) -> bool {
    all_finite(&state.z1)
        && all_finite(&state.z2)
        && all_finite(&state.centre)
        && state.generators.iter_rows().all(all_finite)
}

/// The smallest j with |A_e^j|∞ <= 1e-6.
fn memory(a_e: &DMatrix<f64>) -> u32 {
    let mut power = a_e.clone();
    for j in 1..LONGEST_MEMORY {
        if infinity_norm(&power) <= FORGOTTEN {
            return j;
        }
        power = a_e * power;
    }
    u32::MAX
}
