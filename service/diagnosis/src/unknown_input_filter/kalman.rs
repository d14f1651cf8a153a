//! Kalman-type baseline with 3σ thresholds, without guarantee (method sheet 4.11).
//!
//! | symbol | here | shape |
//! |---|---|---|
//! | x̂, P | `SetState::centre`, `SetState::covariance` | nx, nx x nx |
//! | Q = diag(w/3)², Rv = diag(v/3)² | in `process`, `noise_variance` | |
//! | T, N | `observer` | nx x nx, nx x ny |
//! | Σ, K | `output_covariance`, `gain` | ny x ny, nx x ny |

use super::{
    outcome::{Outcome, TestRow},
    paper::{UnknownInputObserver, closed_loop},
    plant::{Command, Measured, Plant},
    state::SetState,
};
use crate::{
    factor::{cholesky, cholesky_solve},
    matrix::{Matrix, apply, dot, multiply, multiply_transposed},
};
use nalgebra::DMatrix;

/// Where a baseline filter starts and when it alarms.
#[derive(Clone, Debug)]
pub(crate) struct KalmanOptions {
    pub initial_state: Vec<f64>,
    pub initial_covariance: Matrix,
    /// Threshold of ‖r‖.
    pub norm_threshold: f64,
}

/// Constants of one baseline filter.
#[derive(Clone, Debug)]
pub(crate) struct KalmanFilter {
    observer: UnknownInputObserver,
    options: KalmanOptions,
    /// TDQD'T' + N Rv N' with a measurement, DQD' without.
    process: [Matrix; 2],
    noise_variance: Vec<f64>,
}

/// Room for one step of the baseline.
#[derive(Clone, Debug)]
pub(crate) struct KalmanWorkspace {
    predicted: Vec<f64>,
    innovation: Vec<f64>,
    covariance: Matrix,
    product: Matrix,
    correction: Matrix,
    cross: Matrix,
    output_covariance: Matrix,
    factor: Matrix,
    gain: Matrix,
}

impl KalmanWorkspace {
    pub fn new(plant: &Plant) -> Self {
        let (nx, ny) = (plant.nx(), plant.ny());
        Self {
            predicted: vec![0.0; nx],
            innovation: vec![0.0; ny],
            covariance: Matrix::zeros(nx, nx),
            product: Matrix::zeros(nx, nx),
            correction: Matrix::zeros(nx, nx),
            cross: Matrix::zeros(nx, ny),
            output_covariance: Matrix::zeros(ny, ny),
            factor: Matrix::zeros(ny, ny),
            gain: Matrix::zeros(nx, ny),
        }
    }
}

impl KalmanFilter {
    pub fn new(plant: &Plant, observer: UnknownInputObserver, options: KalmanOptions) -> Self {
        let noise_variance: Vec<f64> = plant.noise.iter().map(|v| (v / 3.0).powi(2)).collect();
        let weighted = plant.disturbance_matrix().to_dense() / 3.0;
        let (t, n) = (observer.t.to_dense(), observer.n.to_dense());
        let rv = DMatrix::from_diagonal(&nalgebra::DVector::from_column_slice(&noise_variance));
        let process = &weighted * weighted.transpose();
        let observed = &t * &process * t.transpose() + &n * rv * n.transpose();
        Self {
            process: [Matrix::from(&observed), Matrix::from(&process)],
            observer,
            options,
            noise_variance,
        }
    }

    /// (I - KC)TA0 with the gain K of the last step: what moves the errors.
    pub fn transition(&self, plant: &Plant, work: &KalmanWorkspace) -> DMatrix<f64> {
        closed_loop(plant, &work.gain, &self.observer)
    }

    /// Starts from the configured state and covariance.
    pub fn start(&self, state: &mut SetState) {
        state.centre.copy_from_slice(&self.options.initial_state);
        state.covariance.copy_from(&self.options.initial_covariance);
        state.void = false;
    }

    /// One step; an incomplete packet only predicts, an unknown command restarts.
    pub fn step(
        &self,
        plant: &Plant,
        command: &Command,
        measured: &Measured,
        state: &mut SetState,
        work: &mut KalmanWorkspace,
        outcome: &mut Outcome,
    ) {
        outcome.clear();
        if state.void || !command.known {
            self.start(state);
            return;
        }
        let complete = measured.is_complete(plant);
        self.predict(plant, command, measured, complete, state, work);
        if complete {
            self.test(plant, measured, work, outcome);
            if !self.correct(plant, state, work) {
                state.void = true;
            }
        } else {
            state.centre.copy_from_slice(&work.predicted);
            state.covariance.copy_from(&work.covariance);
        }
        if !crate::matrix::all_finite(&state.centre) {
            state.void = true;
        }
    }

    /// x⁻ = T(A0x̂ + Bu) + Ny, P⁻ = TA0 P (TA0)' + process; T = I and N = 0 without a complete packet.
    fn predict(
        &self,
        plant: &Plant,
        command: &Command,
        measured: &Measured,
        complete: bool,
        state: &mut SetState,
        work: &mut KalmanWorkspace,
    ) {
        let observer = &self.observer;
        for i in 0..plant.nx() {
            work.predicted[i] = dot(plant.a0.row(i), &state.centre) + dot(plant.b.row(i), &command.centre);
        }
        if complete {
            state.centre.copy_from_slice(&work.predicted);
            for i in 0..plant.nx() {
                work.predicted[i] =
                    dot(observer.t.row(i), &state.centre) + dot(observer.n.row(i), &measured.y);
            }
        }
        let transition = if complete { &observer.ta0 } else { &plant.a0 };
        multiply(transition, &state.covariance, &mut work.product);
        multiply_transposed(&work.product, transition, &mut work.covariance);
        let process = &self.process[usize::from(!complete)];
        for i in 0..plant.nx() {
            for (value, noise) in work.covariance.row_mut(i).iter_mut().zip(process.row(i)) {
                *value += noise;
            }
        }
    }

    fn test(&self, plant: &Plant, measured: &Measured, work: &mut KalmanWorkspace, outcome: &mut Outcome) {
        apply(&plant.c, &work.predicted, &mut work.innovation);
        for (value, y) in work.innovation.iter_mut().zip(&measured.y) {
            *value = y - *value;
        }
        multiply_transposed(&work.covariance, &plant.c, &mut work.cross);
        multiply(&plant.c, &work.cross, &mut work.output_covariance);
        for (j, variance) in self.noise_variance.iter().enumerate() {
            work.output_covariance[(j, j)] += variance;
            let half_width = 3.0 * work.output_covariance[(j, j)].sqrt();
            let residual = work.innovation[j];
            let evaluated = residual.is_finite() && half_width.is_finite();
            outcome.outputs[j] = TestRow {
                residual,
                half_width,
                evaluated,
            };
        }
        let norm = dot(&work.innovation, &work.innovation).sqrt();
        outcome.norm = Some(TestRow {
            residual: norm,
            half_width: self.options.norm_threshold,
            evaluated: norm.is_finite(),
        });
    }

    /// K = P⁻C'Σ⁻¹, x̂ = x⁻ + Kr, P = (I - KC)P⁻(I - KC)' + K Rv K'; false if Σ cannot be inverted.
    fn correct(&self, plant: &Plant, state: &mut SetState, work: &mut KalmanWorkspace) -> bool {
        work.factor.copy_from(&work.output_covariance);
        if !cholesky(&mut work.factor) {
            return false;
        }
        work.gain.copy_from(&work.cross);
        for i in 0..work.gain.rows() {
            cholesky_solve(&work.factor, work.gain.row_mut(i));
            state.centre[i] = work.predicted[i] + dot(work.gain.row(i), &work.innovation);
        }
        let nx = state.centre.len();
        for i in 0..nx {
            for k in 0..nx {
                let seen: f64 = (0..self.noise_variance.len())
                    .map(|j| work.gain[(i, j)] * plant.c[(j, k)])
                    .sum();
                work.correction[(i, k)] = f64::from(u8::from(i == k)) - seen;
            }
        }
        multiply(&work.correction, &work.covariance, &mut work.product);
        multiply_transposed(&work.product, &work.correction, &mut state.covariance);
        for i in 0..nx {
            for k in 0..nx {
                let weights = work
                    .gain
                    .row(i)
                    .iter()
                    .zip(work.gain.row(k))
                    .zip(&self.noise_variance);
                state.covariance[(i, k)] += weights.map(|((a, b), variance)| a * b * variance).sum::<f64>();
            }
        }
        true
    }
}
