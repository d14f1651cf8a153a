//! One filter in the coupled form: the same measurement noise in prediction and correction (method sheet 4.2).

use super::{
    decoupling::{Decoupling, complete_decoupling, fault_matrix},
    gain::Candidates,
    missing::gain_coordinates,
    modes::FaultMode,
    outcome::{Outcome, RowContext},
    outward::Outward,
    plant::{Command, Measured, Plant},
    prediction::Prediction,
    state::SetState,
    strip_reset::Strip,
    workspace::Workspace,
};
use crate::matrix::{Matrix, product_row_sums, row_sums};

/// Constants of one filter in the coupled form.
#[derive(Clone, Debug)]
pub(crate) struct CoupledFilter {
    pub mode: FaultMode,
    /// F, the columns of B in the mode.
    pub fault_matrix: Matrix,
    /// The decoupling of a complete packet.
    pub decoupling: Decoupling,
    /// I - CS when S is configured; always I in the fault-free mode.
    shaping: Option<Matrix>,
    /// F diag(fault bound) under the policy `bounded_fault`.
    fault_generators: Option<Matrix>,
    strip_rows: Option<Matrix>,
    /// (L_fix - L0) Z, unless it is the strip gain.
    fixed_rows: Option<Matrix>,
    row_wise: bool,
    sweeps: usize,
    order: usize,
}

/// Options of a coupled filter.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CoupledOptions<'a> {
    pub shaping: Option<&'a Matrix>,
    /// Bounds of all actuator faults under the policy `bounded_fault`.
    pub fault_bound: Option<&'a [f64]>,
    pub row_wise: bool,
    pub sweeps: usize,
    pub order: usize,
}

impl CoupledFilter {
    /// The filter of a mode whose own faults the complete outputs separate.
    pub fn new(plant: &Plant, mode: FaultMode, options: &CoupledOptions<'_>) -> Self {
        let fault_matrix = fault_matrix(plant, mode);
        let fault_generators = options.fault_bound.map(|bound| {
            let own: Vec<f64> = mode.actuators().map(|j| bound[j]).collect();
            let mut generators = Matrix::with_capacity(plant.nx(), own.len());
            generators.append_scaled(&fault_matrix, &own);
            generators
        });
        let shaping = options.shaping.filter(|_| !mode.is_empty()).cloned();
        let decoupling = complete_decoupling(plant, &fault_matrix, shaping.as_ref());
        let strip_rows = plant.strip.as_ref().filter(|_| options.row_wise).map(|strip| {
            let mut rows = Matrix::zeros(plant.nx(), plant.ny());
            gain_coordinates(&strip.gain, &decoupling, &mut rows);
            rows
        });
        Self {
            mode,
            fault_matrix,
            decoupling,
            shaping,
            fault_generators,
            strip_rows,
            fixed_rows: None,
            row_wise: options.row_wise,
            sweeps: options.sweeps,
            order: options.order,
        }
    }

    /// Lets the rows of the fixed gain `gain` (L_fix, nx x ny) compete in the row-wise choice.
    pub fn set_fixed_candidate(&mut self, plant: &Plant, gain: &Matrix) {
        let same = |strip: &Strip| {
            let difference = (gain.to_dense() - strip.gain.to_dense()).amax();
            difference <= 1e-9 * strip.gain.to_dense().amax()
        };
        if plant.strip.as_ref().is_some_and(same) {
            return;
        }
        let mut rows = Matrix::zeros(plant.nx(), plant.ny());
        gain_coordinates(gain, &self.decoupling, &mut rows);
        self.fixed_rows = Some(rows);
    }

    fn own_faults_bounded(&self) -> bool {
        self.fault_generators.is_some()
    }

    /// One step with the command of the last transition and the measurements of this instant.
    pub fn step(
        &self,
        plant: &Plant,
        command: &Command,
        measured: &Measured,
        state: &mut SetState,
        work: &mut Workspace,
        outcome: &mut Outcome,
    ) {
        outcome.clear();
        if state.void {
            return;
        }
        if !command.known {
            state.set_void();
            outcome.lost = true;
            return;
        }
        let regular = measured.is_complete(plant) && state.unbounded.columns() == 0;
        if !regular {
            work.missing.prepare(
                plant,
                measured,
                state,
                &self.fault_matrix,
                self.own_faults_bounded(),
                self.shaping.as_ref(),
            );
        }
        let bounded = !regular && work.missing.bounded;
        let fault_generators = self.fault_generators.as_ref().filter(|_| bounded);
        work.prediction.predict(plant, state, command, fault_generators);
        work.prediction.observe(plant, measured);
        self.choose_gain(plant, measured, regular, work);
        self.test(plant, measured, regular, work, outcome);
        self.correct(plant, measured, regular, state, work);
        outcome.lost |= state.void;
        if outcome.lost {
            state.set_void();
        }
    }

    /// L of this step into `work.gain` (method sheet 4.2 steps 4 and 5).
    pub fn choose_gain(&self, plant: &Plant, measured: &Measured, regular: bool, work: &mut Workspace) {
        let decoupling = if regular {
            &self.decoupling
        } else {
            &work.missing.decoupling
        };
        let missing_strip = (work.missing.strip_available && self.row_wise).then_some((
            &work.missing.strip_rows,
            work.missing.strip_half_widths.as_slice(),
        ));
        let strip = match (&plant.strip, &self.strip_rows) {
            (Some(strip), Some(rows)) if regular => Some((rows, strip.radius.as_slice())),
            _ => missing_strip.filter(|_| !regular),
        };
        let candidates = Candidates {
            strip,
            fixed: self.fixed_rows.as_ref().filter(|_| regular),
            sweeps: self.sweeps,
        };
        let Prediction {
            generators, spread, ..
        } = &work.prediction;
        work.choice.prepare(decoupling, spread, &measured.noise);
        work.choice
            .choose(decoupling, generators, spread, candidates, &mut work.gain);
    }

    /// Test rows and fault estimates (method sheet 4.2 steps 6 and 7).
    fn test(
        &self,
        plant: &Plant,
        measured: &Measured,
        regular: bool,
        work: &mut Workspace,
        outcome: &mut Outcome,
    ) {
        let decoupling = if regular {
            &self.decoupling
        } else {
            &work.missing.decoupling
        };
        let (m, rank) = (measured.count(), decoupling.rank());
        bound_own_faults(
            decoupling,
            &work.prediction,
            measured,
            &mut work.spread_radius,
            &mut work.own_fault,
        );
        let outward = (plant.epsilon > 0.0).then_some(Outward {
            epsilon: plant.epsilon,
            prediction_size: &work.prediction.size,
            output_size: &work.prediction.output_size[..m],
            own_fault: &work.own_fault[..rank],
            decoupling,
        });
        let context = RowContext {
            plant,
            measured,
            prediction: &work.prediction,
            outward,
        };
        context.test_outputs(decoupling, &mut work.spreads, outcome);
        let others = || self.mode.other_actuators(plant.nu()).enumerate();
        let estimated = if regular || work.missing.separated {
            rank
        } else {
            0
        };
        // The rows that this step has found: matched rows, those of faults not seen left out, then φ.
        let rows = &mut work.rows;
        let mut count = 0;
        let mut visible = 0_u64;
        rows.reshape(plant.nu() + rank, m);
        for (slot, actuator) in others().filter(|_| decoupling.complete) {
            let signature = &mut work.signature[..m];
            for (value, &output) in signature.iter_mut().zip(&measured.received) {
                *value = plant.cb[(output, actuator)];
            }
            if work
                .choice
                .matched_row(decoupling, signature, rows.row_mut(count))
            {
                visible |= 1 << slot;
                count += 1;
            }
        }
        for k in 0..estimated {
            work.choice.estimate_row(decoupling, k, rows.row_mut(count + k));
        }
        rows.reshape(count + estimated, m);
        product_row_sums(rows, &work.prediction.spread, &mut work.spreads);
        let mut found = rows.iter_rows().zip(&work.spreads);
        for (slot, _) in others().filter(|(slot, _)| visible >> slot & 1 == 1) {
            if let Some((row, spread)) = found.next() {
                let test = context.test(row, *spread);
                outcome.lost |= !test.evaluated;
                outcome.matched[slot] = test;
                outcome.note_sensitivity(test.half_width, context.responses(row));
            }
        }
        for (k, (row, spread)) in found.enumerate() {
            let own = decoupling.pivot[k];
            outcome.estimates[own] = context.estimate(row, own, *spread);
        }
    }

    /// The corrected set (method sheet 4.2 step 8, 4.7, 4.9).
    pub fn correct(
        &self,
        plant: &Plant,
        measured: &Measured,
        regular: bool,
        state: &mut SetState,
        work: &mut Workspace,
    ) {
        let m = measured.count();
        let prediction = &work.prediction;
        for i in 0..plant.nx() {
            let correction = work.gain.row(i).iter().zip(&prediction.innovation[..m]);
            state.centre[i] = prediction.centre[i] + correction.map(|(l, e)| l * e).sum::<f64>();
        }
        prediction.correct(&work.gain, &measured.noise, &mut state.generators);
        if plant.epsilon > 0.0 {
            let decoupling = if regular {
                &self.decoupling
            } else {
                &work.missing.decoupling
            };
            let outward = Outward {
                epsilon: plant.epsilon,
                prediction_size: &prediction.size,
                output_size: &prediction.output_size[..m],
                own_fault: &work.own_fault[..decoupling.rank()],
                decoupling,
            };
            for (i, error) in work.error.iter_mut().enumerate() {
                *error = outward.state_error(i, work.gain.row(i));
            }
        }
        if regular || work.missing.bounded || work.missing.decoupling.complete {
            state.unbounded.reshape(plant.nx(), 0);
        } else {
            work.missing.update_unbounded(measured, &work.gain, state);
        }
        self.finish(plant, state, work);
    }

    /// Reduces H and, with outward rounding, adds the error of the step (η in `work.error`) and of the reduction.
    pub fn finish(&self, plant: &Plant, state: &mut SetState, work: &mut Workspace) {
        let boxed = work.reducer.reduce(&mut state.generators, self.order);
        if plant.epsilon > 0.0 {
            row_sums(&state.generators, &mut state.radius);
            for (error, radius) in work.error.iter_mut().zip(&state.radius) {
                *error = (*error + plant.epsilon * radius).next_up();
            }
            enlarge(&mut state.generators, boxed, &work.error);
        }
        state.update_radius();
    }
}

/// Adds the box `error` to a generator matrix; `boxed` says that its last columns are a box already.
pub(crate) fn enlarge(generators: &mut Matrix, boxed: bool, error: &[f64]) {
    if !boxed {
        generators.append_diagonal(error);
        return;
    }
    let first = generators.columns() - error.len();
    for (i, value) in error.iter().enumerate() {
        let entry = &mut generators[(i, first + i)];
        *entry = (*entry + value).next_up();
    }
}

/// f̄ into `own_fault` (method sheet 4.9).
fn bound_own_faults(
    decoupling: &Decoupling,
    prediction: &Prediction,
    measured: &Measured,
    spread_radius: &mut [f64],
    own_fault: &mut [f64],
) {
    let m = measured.count();
    row_sums(&prediction.spread, spread_radius);
    for (j, value) in spread_radius[..m].iter_mut().enumerate() {
        *value += prediction.innovation[j].abs() + measured.noise[j];
    }
    decoupling.own_fault_bound(&spread_radius[..m], own_fault);
}

/// Guaranteed bound x̄ of |x| by the set (method sheet 4.4); infinite where there is none.
pub(crate) fn state_bound(plant: &Plant, state: &SetState, out: &mut [f64]) {
    for (i, bound) in out.iter_mut().enumerate() {
        *bound = state.centre[i].abs() + state.extent(i) * (1.0 + plant.epsilon);
    }
}
