//! One filter in the coupled form with a fixed gain (method sheet 4.2, `gain = "fixed"`).
//!
//! With L, the test rows W and the estimate rows φ constant, the product of H with (I - LC)A0 gives the corrected
//! set, its products with WCA0 and φCA0 all half widths and the radii of the estimates. Incomplete
//! packets and unbounded sets take the general step.

use super::{
    decoupling::Decoupling,
    filter::CoupledFilter,
    fixed_gain::FixedGain,
    outcome::{FaultEstimate, Outcome, TestRow},
    outward::Outward,
    plant::{Command, Measured, Plant},
    state::SetState,
    workspace::Workspace,
};
use crate::matrix::{Matrix, absolute_dot, combination, dot, multiply, product_row_sums};
use nalgebra::DMatrix;

/// What a constant row is for.
#[derive(Clone, Copy, Debug)]
enum Purpose {
    /// Projector row of this output.
    Output(usize),
    /// Row matched to the actuator in this slot.
    Matched(usize),
    /// Estimate of this own fault.
    Estimate(usize),
}

/// A constant row of W or φ.
#[derive(Clone, Debug)]
struct FixedRow {
    purpose: Purpose,
    weights: Vec<f64>,
    /// Response to a unit fault of each actuator.
    responses: Vec<f64>,
    /// Part of the half width that no datum changes: |w|v and the disturbance outside the box.
    constant: f64,
    /// What one unit of f̄ adds to the half width under outward rounding, for each decoupled direction.
    leaks: Vec<f64>,
}

/// Constants of one filter with a fixed gain.
#[derive(Clone, Debug)]
pub(crate) struct FixedFilter {
    coupled: CoupledFilter,
    gain: Matrix,
    rows: Vec<FixedRow>,
    /// \[(I - LC); WC; φC\], (nx + rows) x nx.
    map: Matrix,
    /// (I - LC)A0.
    transition: Matrix,
    /// WCA0 and φCA0.
    tests: Matrix,
    /// What one unit of f̄ adds to η, nx x r.
    leaks: Vec<Vec<f64>>,
    /// (I - LC) D diag(w) when D is not square and diagonal.
    disturbance: Option<Matrix>,
    /// L V.
    noise: Matrix,
}

impl FixedFilter {
    /// The filter with the offline result `fixed`; `coupled` takes the irregular steps.
    pub fn new(plant: &Plant, coupled: CoupledFilter, fixed: &FixedGain) -> Self {
        let (nx, ny) = (plant.nx(), plant.ny());
        let decoupling = &coupled.decoupling;
        let mut rows = Vec::new();
        let mut add = |purpose, weights: &[f64]| {
            let mut responses = vec![0.0; plant.nu()];
            combination(&mut responses, weights, &plant.cb);
            rows.push(FixedRow {
                purpose,
                weights: weights.to_vec(),
                responses,
                constant: 0.0,
                leaks: match purpose {
                    Purpose::Estimate(own) => decoupling.estimate_leaks(weights, own, plant.epsilon),
                    _ => decoupling.leaks(weights, plant.epsilon),
                },
            });
        };
        for j in (0..ny).filter(|j| !decoupling.blind[*j]) {
            add(Purpose::Output(j), decoupling.test_rows.row(j));
        }
        for (slot, row) in fixed.matched_rows.iter().enumerate() {
            if let Some(row) = row {
                add(Purpose::Matched(slot), row);
            }
        }
        for (k, row) in fixed.estimate_rows.iter().enumerate() {
            add(Purpose::Estimate(decoupling.pivot[k]), row);
        }
        let mut map = Matrix::zeros(nx + rows.len(), nx);
        let correction = DMatrix::identity(nx, nx) - fixed.gain.to_dense() * plant.c.to_dense();
        for i in 0..nx {
            (0..nx).for_each(|k| map[(i, k)] = correction[(i, k)]);
        }
        for (r, row) in rows.iter().enumerate() {
            combination(map.row_mut(nx + r), &row.weights, &plant.c);
        }
        let mapped = plant
            .disturbance_generators
            .as_ref()
            .map(|generators| map.to_dense() * generators.to_dense());
        for (r, row) in rows.iter_mut().enumerate() {
            row.constant = absolute_dot(&row.weights, &plant.noise);
            if let Some(mapped) = &mapped {
                row.constant += mapped.row(nx + r).iter().map(|value| value.abs()).sum::<f64>();
            }
        }
        let mut stacked = Matrix::zeros(nx + rows.len(), nx);
        multiply(&map, &plant.a0, &mut stacked);
        let (mut transition, mut tests) = (Matrix::zeros(nx, nx), Matrix::zeros(rows.len(), nx));
        (0..nx).for_each(|i| transition.row_mut(i).copy_from_slice(stacked.row(i)));
        (0..rows.len()).for_each(|r| tests.row_mut(r).copy_from_slice(stacked.row(nx + r)));
        let leaks = (0..nx).map(|i| decoupling.state_leaks(i, fixed.gain.row(i), plant.epsilon));
        let mut noise = Matrix::with_capacity(nx, ny);
        noise.append_scaled(&fixed.gain, &plant.noise);
        Self {
            disturbance: mapped.map(|mapped| Matrix::from(&mapped.rows(0, nx).into_owned())),
            gain: fixed.gain.clone(),
            leaks: leaks.collect(),
            coupled,
            rows,
            map,
            transition,
            tests,
            noise,
        }
    }

    /// L_fix.
    pub fn gain(&self) -> &Matrix {
        &self.gain
    }

    /// The decoupling of a complete packet.
    pub fn decoupling(&self) -> &Decoupling {
        &self.coupled.decoupling
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
        let regular = measured.is_complete(plant) && command.exact && state.is_bounded();
        if !regular {
            self.coupled.step(plant, command, measured, state, work, outcome);
            return;
        }
        outcome.clear();
        work.prediction.predict_centre(plant, state, command, None);
        work.prediction.observe_centre(plant, measured);
        multiply(&self.transition, &state.generators, &mut work.corrected);
        product_row_sums(&self.tests, &state.generators, &mut work.spreads);
        let decoupling = &self.coupled.decoupling;
        let prediction = &work.prediction;
        for (j, value) in work.spread_radius.iter_mut().enumerate() {
            // |C|κ + v is at least R(Γ) + v.
            *value = prediction.innovation[j].abs() + prediction.output_size[j];
        }
        decoupling.own_fault_bound(&work.spread_radius, &mut work.own_fault);
        let outward = (plant.epsilon > 0.0).then_some(Outward {
            epsilon: plant.epsilon,
            prediction_size: &prediction.size,
            output_size: &prediction.output_size,
            own_fault: &work.own_fault[..decoupling.rank()],
            decoupling,
        });
        self.test(work, outward.as_ref(), outcome);
        for (i, centre) in state.centre.iter_mut().enumerate() {
            *centre = prediction.centre[i] + dot(self.gain.row(i), &prediction.innovation);
            if let Some(outward) = &outward {
                work.error[i] = outward.state_error_with(i, self.gain.row(i), &self.leaks[i]);
            }
        }
        self.correct(plant, state, work);
        outcome.lost |= state.void;
        if outcome.lost {
            state.set_void();
        }
    }

    fn test(&self, work: &Workspace, outward: Option<&Outward<'_>>, outcome: &mut Outcome) {
        let (nx, prediction) = (self.gain.rows(), &work.prediction);
        for (r, row) in self.rows.iter().enumerate() {
            let residual = dot(&row.weights, &prediction.innovation);
            let mut half_width =
                work.spreads[r] + absolute_dot(self.map.row(nx + r), &prediction.box_radius) + row.constant;
            if let Purpose::Estimate(own) = row.purpose {
                if let Some(outward) = outward {
                    half_width = outward.estimate_radius_with(half_width, &row.weights, residual, &row.leaks);
                }
                outcome.estimates[own] = FaultEstimate::finite(residual, half_width);
                continue;
            }
            if let Some(outward) = outward {
                half_width = outward.half_width_with(half_width, &row.weights, &row.leaks);
            }
            let evaluated = residual.is_finite() && half_width.is_finite();
            outcome.lost |= !evaluated;
            outcome.note_sensitivity(half_width, row.responses.iter().copied());
            let test = TestRow {
                residual,
                half_width,
                evaluated,
            };
            match row.purpose {
                Purpose::Output(j) => outcome.outputs[j] = test,
                Purpose::Matched(slot) => outcome.matched[slot] = test,
                Purpose::Estimate(_) => {}
            }
        }
    }

    /// H = \[(I - LC)\[A0H, box, disturbance\], LV\], reduced.
    fn correct(&self, plant: &Plant, state: &mut SetState, work: &mut Workspace) {
        let nx = plant.nx();
        let columns = work.corrected.columns();
        let box_radius = &work.prediction.box_radius;
        state.generators.reshape(nx, columns + nx);
        for i in 0..nx {
            let (left, right) = state.generators.row_mut(i).split_at_mut(columns);
            left.copy_from_slice(work.corrected.row(i));
            for (target, (value, radius)) in right.iter_mut().zip(self.map.row(i).iter().zip(box_radius)) {
                *target = value * radius;
            }
        }
        if let Some(disturbance) = &self.disturbance {
            state.generators.append(disturbance);
        }
        state.generators.append(&self.noise);
        self.coupled.finish(plant, state, work);
    }
}
