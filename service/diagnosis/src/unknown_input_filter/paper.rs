//! One filter as printed in the paper, for comparison (method sheet 4.10; paper equations (11)-(16), (31)-(41)).
//!
//! | symbol | here | shape |
//! |---|---|---|
//! | N = L0 + S P, T = I - NC | `n`, `t` | nx x ny, nx x nx |
//! | p⁻, H⁻ | `Prediction::centre`, `Prediction::generators` | nx, nx x r |
//! | CH⁻ | `Prediction::spread` | ny x r |
//! | Λ | `Workspace::gain` | nx x ny |
//! | I - CN | `decoupling.test_rows` | ny x ny |

use super::{
    decoupling::{Decoupling, complete_decoupling, fault_matrix},
    modes::FaultMode,
    options::TestRule,
    outcome::{Outcome, RowContext, TestRow},
    plant::{Command, Measured, Plant},
    state::SetState,
    workspace::Workspace,
};
use crate::{
    factor::{cholesky, cholesky_solve},
    matrix::{Matrix, absolute_dot, absolute_sum, apply, dot, multiply, multiply_transposed},
};
use nalgebra::DMatrix;

/// T and N of one mode.
#[derive(Clone, Debug)]
pub(crate) struct UnknownInputObserver {
    pub t: Matrix,
    pub n: Matrix,
    /// T A0.
    pub ta0: Matrix,
    /// The decoupling whose test rows are I - CN.
    pub decoupling: Decoupling,
}

impl UnknownInputObserver {
    /// `s` is S (nx x ny), zero in the fault-free mode, where T = I and N = 0.
    pub fn new(plant: &Plant, mode: FaultMode, s: Option<&DMatrix<f64>>) -> Self {
        let s = s.filter(|_| !mode.is_empty());
        let shaping =
            s.map(|s| Matrix::from(&(DMatrix::identity(plant.ny(), plant.ny()) - plant.c.to_dense() * s)));
        let decoupling = complete_decoupling(plant, &fault_matrix(plant, mode), shaping.as_ref());
        let basis = decoupling.null_basis.to_dense();
        let mut n = decoupling.gain.to_dense();
        if let Some(s) = s {
            n += s * basis.transpose() * basis;
        }
        let t = DMatrix::identity(plant.nx(), plant.nx()) - &n * plant.c.to_dense();
        Self {
            ta0: Matrix::from(&(&t * plant.a0.to_dense())),
            t: Matrix::from(&t),
            n: Matrix::from(&n),
            decoupling,
        }
    }
}

/// Constants of one filter in the paper's form.
#[derive(Clone, Debug)]
pub(crate) struct PaperFilter {
    observer: UnknownInputObserver,
    /// T D diag(w).
    disturbance: Matrix,
    /// N V.
    noise: Matrix,
    test: TestRule,
    order: usize,
}

impl PaperFilter {
    pub fn new(plant: &Plant, observer: UnknownInputObserver, test: TestRule, order: usize) -> Self {
        let weighted = plant.disturbance_matrix().to_dense();
        let bounds = DMatrix::from_diagonal(&nalgebra::DVector::from_column_slice(&plant.noise));
        Self {
            disturbance: Matrix::from(&(observer.t.to_dense() * weighted)),
            noise: Matrix::from(&(observer.n.to_dense() * bounds)),
            observer,
            test,
            order,
        }
    }

    /// The decoupling whose test rows are I - CN.
    pub fn decoupling(&self) -> &Decoupling {
        &self.observer.decoupling
    }

    /// (I - ΛC)TA0 with the gain Λ of the last step: what moves the errors.
    pub fn transition(&self, plant: &Plant, work: &Workspace) -> DMatrix<f64> {
        closed_loop(plant, &work.gain, &self.observer)
    }

    /// One step; an incomplete packet or command loses the set.
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
        if !(command.exact && measured.is_complete(plant)) {
            state.set_void();
            outcome.lost = true;
            return;
        }
        self.predict(plant, command, measured, state, work);
        self.test(plant, measured, work, outcome);
        if !optimal_gain(&plant.noise, work) {
            state.set_void();
        } else {
            for (i, centre) in state.centre.iter_mut().enumerate() {
                *centre = work.prediction.centre[i] + dot(work.gain.row(i), &work.prediction.innovation);
            }
            work.prediction
                .correct(&work.gain, &plant.noise, &mut state.generators);
            work.reducer.reduce(&mut state.generators, self.order);
            state.update_radius();
        }
        outcome.lost |= state.void;
        if outcome.lost {
            state.set_void();
        }
    }

    /// p⁻ = T(A0p + Bu) + Ny and H⁻ = \[TA0H, T diag(A⁺|p|), T diag(A⁺R(H)), TD diag(w), NV\].
    fn predict(
        &self,
        plant: &Plant,
        command: &Command,
        measured: &Measured,
        state: &SetState,
        work: &mut Workspace,
    ) {
        let observer = &self.observer;
        let prediction = &mut work.prediction;
        multiply(&observer.ta0, &state.generators, &mut prediction.generators);
        for spread_of_set in [false, true] {
            for i in 0..plant.nx() {
                let row = plant.a_plus.row(i);
                work.error[i] = if spread_of_set {
                    dot(row, &state.radius)
                } else {
                    signless_dot(row, &state.centre)
                };
            }
            prediction.generators.append_scaled(&observer.t, &work.error);
        }
        prediction.generators.append(&self.disturbance);
        prediction.generators.append(&self.noise);
        for (i, value) in work.error.iter_mut().enumerate() {
            *value = dot(plant.a0.row(i), &state.centre) + dot(plant.b.row(i), &command.centre);
        }
        for i in 0..plant.nx() {
            prediction.centre[i] = dot(observer.t.row(i), &work.error) + dot(observer.n.row(i), &measured.y);
        }
        apply(&plant.c, &prediction.centre, &mut prediction.innovation);
        for (value, y) in prediction.innovation.iter_mut().zip(&measured.y) {
            *value = y - *value;
        }
        multiply(&plant.c, &prediction.generators, &mut prediction.spread);
    }

    /// h = R(CH⁻) + v as printed, or without the noise counted twice.
    fn test(&self, plant: &Plant, measured: &Measured, work: &Workspace, outcome: &mut Outcome) {
        let prediction = &work.prediction;
        let decoupling = &self.observer.decoupling;
        let context = RowContext {
            plant,
            measured,
            prediction,
            outward: None,
        };
        let shared = prediction.spread.columns() - plant.ny();
        for j in 0..plant.ny() {
            let row = prediction.spread.row(j);
            let half_width = match self.test {
                TestRule::Printed => absolute_sum(row) + plant.noise[j],
                TestRule::Tight if decoupling.blind[j] => continue,
                TestRule::Tight => {
                    absolute_sum(&row[..shared]) + absolute_dot(decoupling.test_rows.row(j), &plant.noise)
                }
            };
            let residual = prediction.innovation[j];
            let evaluated = residual.is_finite() && half_width.is_finite();
            outcome.lost |= !evaluated;
            outcome.outputs[j] = TestRow {
                residual,
                half_width,
                evaluated,
            };
            if !decoupling.blind[j] {
                outcome.note_sensitivity(half_width, context.responses(decoupling.test_rows.row(j)));
            }
        }
    }
}

/// (I - KC)TA0.
pub(crate) fn closed_loop(plant: &Plant, gain: &Matrix, observer: &UnknownInputObserver) -> DMatrix<f64> {
    let identity = DMatrix::identity(plant.nx(), plant.nx());
    (identity - gain.to_dense() * plant.c.to_dense()) * observer.ta0.to_dense()
}

/// Sum of a_k |x_k|.
fn signless_dot(row: &[f64], x: &[f64]) -> f64 {
    absolute_dot(x, row)
}

/// Λ = H⁻H⁻'C'(CH⁻H⁻'C' + V²)⁻¹ (35) into `work.gain`; false if the matrix cannot be inverted.
pub(crate) fn optimal_gain(noise: &[f64], work: &mut Workspace) -> bool {
    let prediction = &work.prediction;
    multiply_transposed(&prediction.spread, &prediction.spread, &mut work.square);
    for (j, bound) in noise.iter().enumerate() {
        work.square[(j, j)] += bound * bound;
    }
    if !cholesky(&mut work.square) {
        return false;
    }
    multiply_transposed(&prediction.generators, &prediction.spread, &mut work.gain);
    for i in 0..work.gain.rows() {
        cholesky_solve(&work.square, work.gain.row_mut(i));
    }
    true
}
