//! The Kalman filter in square-root innovation form (method sheet 4, steps 1 to 5).

use super::{finite::all_finite, settled::Settled, step_model::StepModel};
use crate::buffer::Buffer;
use crate::{
    factor::cholesky,
    matrix::{Matrix, add_scaled, apply, dot, forward_substitution, multiply, triangularise},
};
use serde::{Deserialize, Serialize};

/// x̂ and the factor of its covariance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Filter {
    /// x̂, length n.
    pub estimate: Vec<f64>,
    /// L_P, n x n.
    pub covariance_factor: Matrix,
}

/// What one update of the filter yields for the statistics, rows in the order of `rows`.
#[derive(Clone, Debug)]
pub(super) struct Correction {
    /// The available rows a.
    pub rows: Buffer<usize>,
    /// ν, length m_k.
    pub innovation: Buffer<f64>,
    /// Diagonal of S, length m_k.
    pub variance: Buffer<f64>,
    /// e, length m_k.
    pub whitened: Buffer<f64>,
    /// L_S, m_k x m_k.
    pub innovation_factor: Matrix,
    /// K̄, n x m_k.
    pub gain: Matrix,
    /// γ = K̄ e, length n.
    pub correction: Vec<f64>,
    /// Instants in a row, this one included, with the same model and gains and all rows.
    pub steady_steps: usize,
    settled: Settled,
}

/// Room for one step of the filter.
#[derive(Clone, Debug)]
pub(super) struct FilterWork {
    vector: Vec<f64>,
    prediction: Matrix,
    noise: Matrix,
    array: Matrix,
}

impl Correction {
    pub fn new(states: usize, measurements: usize, noises: usize) -> Self {
        Self {
            rows: Buffer::with_capacity(measurements),
            innovation: Buffer::with_capacity(measurements),
            variance: Buffer::with_capacity(measurements),
            whitened: Buffer::with_capacity(measurements),
            innovation_factor: Matrix::zeros(measurements, measurements),
            gain: Matrix::zeros(states, measurements),
            correction: vec![0.0; states],
            steady_steps: 0,
            settled: Settled::new(states, measurements, noises),
        }
    }

    /// e'e: the residual statistic; its degrees of freedom are the available rows.
    pub fn residual_statistic(&self) -> f64 {
        dot(&self.whitened, &self.whitened)
    }
}

impl FilterWork {
    pub fn new(states: usize, measurements: usize, noises: usize) -> Self {
        Self {
            vector: vec![0.0; states],
            prediction: Matrix::with_capacity(states, states + noises.max(states)),
            noise: Matrix::zeros(measurements, measurements),
            array: Matrix::zeros(states + measurements, states + measurements),
        }
    }
}

impl Filter {
    /// The filter at instant 0: mean (n) and factor (n x n) of the covariance of x(0).
    pub fn new(estimate: &[f64], covariance_factor: &Matrix) -> Self {
        Self {
            estimate: estimate.to_vec(),
            covariance_factor: covariance_factor.clone(),
        }
    }

    /// One instant: predicts with u(k-1) (`previous_input`) and corrects with the finite elements of `z` and u(k).
    ///
    /// A noise covariance that is not positive definite makes the state not finite.
    pub fn step(
        &mut self,
        model: &StepModel,
        previous_input: &[f64],
        input: &[f64],
        z: &[f64],
        work: &mut FilterWork,
        out: &mut Correction,
    ) {
        self.predict(model, previous_input, work);
        out.rows.clear();
        out.rows.extend((0..z.len()).filter(|row| z[*row].is_finite()));
        let complete = out.rows.len() == z.len();
        if complete && out.settled.holds(model, &self.covariance_factor) {
            out.steady_steps += 1;
        } else {
            out.settled.begin(&self.covariance_factor);
            self.predict_factor(model, work);
            self.update_array(model, work, out);
            let steady = complete && out.settled.hold(model, &mut self.covariance_factor);
            out.steady_steps = usize::from(steady);
        }
        self.correct(model, input, z, out);
    }

    /// x̂ ← Φ x̂ + B u(k-1).
    fn predict(&mut self, model: &StepModel, previous_input: &[f64], work: &mut FilterWork) {
        apply(&model.transition, &self.estimate, &mut work.vector);
        for (i, (estimate, moved)) in self.estimate.iter_mut().zip(&work.vector).enumerate() {
            *estimate = moved + dot(model.input.row(i), previous_input);
        }
    }

    /// L_P⁻ = tri\[Φ L_P, G\].
    fn predict_factor(&self, model: &StepModel, work: &mut FilterWork) {
        multiply(&model.transition, &self.covariance_factor, &mut work.prediction);
        work.prediction.append(&model.noise_factor);
        triangularise(&mut work.prediction);
    }

    /// tri\[L_R, H L_P⁻; 0, L_P⁻\] = \[L_S, 0; K̄, L_P\] over the available rows.
    fn update_array(&mut self, model: &StepModel, work: &mut FilterWork, out: &mut Correction) {
        let (n, available) = (self.estimate.len(), out.rows.len());
        out.innovation_factor.reshape(available, available);
        out.gain.reshape(n, available);
        if available == 0 {
            self.covariance_factor.copy_from(&work.prediction);
            return;
        }
        work.noise.reshape(available, available);
        for (i, row) in out.rows.iter().enumerate() {
            for (j, column) in out.rows.iter().enumerate() {
                work.noise[(i, j)] = model.measurement_noise[(*row, *column)];
            }
        }
        let definite = cholesky(&mut work.noise);
        let array = &mut work.array;
        array.reshape(available + n, available + n);
        array.fill(0.0);
        for (i, row) in out.rows.iter().enumerate() {
            for j in 0..=i {
                array[(i, j)] = if definite { work.noise[(i, j)] } else { f64::NAN };
            }
            for (l, h) in model.measurement.row(*row).iter().enumerate() {
                add_scaled(&mut array.row_mut(i)[available..], *h, work.prediction.row(l));
            }
        }
        for i in 0..n {
            array.row_mut(available + i)[available..].copy_from_slice(work.prediction.row(i));
        }
        triangularise(array);
        for i in 0..available {
            out.innovation_factor
                .row_mut(i)
                .copy_from_slice(&array.row(i)[..available]);
        }
        for i in 0..n {
            let (gain, factor) = array.row(available + i).split_at(available);
            out.gain.row_mut(i).copy_from_slice(gain);
            self.covariance_factor.row_mut(i).copy_from_slice(factor);
        }
    }

    /// ν = z - H x̂ - D u, e = L_S⁻¹ ν, γ = K̄ e, x̂ ← x̂ + γ.
    fn correct(&mut self, model: &StepModel, input: &[f64], z: &[f64], out: &mut Correction) {
        out.innovation.clear();
        out.variance.clear();
        for (i, row) in out.rows.iter().enumerate() {
            let expected =
                dot(model.measurement.row(*row), &self.estimate) + dot(model.feedthrough.row(*row), input);
            out.innovation.push(z[*row] - expected);
            out.variance
                .push(dot(out.innovation_factor.row(i), out.innovation_factor.row(i)));
        }
        out.whitened.clear();
        out.whitened.extend_from_slice(&out.innovation);
        forward_substitution(&out.innovation_factor, &mut out.whitened);
        apply(&out.gain, &out.whitened, &mut out.correction);
        add_scaled(&mut self.estimate, 1.0, &out.correction);
    }

    /// L_P ← tri\[L_P, `more`\]: the covariance grows by `more` `more`' (n x c, c at most n).
    pub fn inflate(&mut self, more: &Matrix, work: &mut FilterWork) {
        work.prediction.copy_from(&self.covariance_factor);
        work.prediction.append(more);
        triangularise(&mut work.prediction);
        self.covariance_factor.copy_from(&work.prediction);
    }

    pub fn is_finite(&self) -> bool {
        all_finite(&self.estimate) && self.covariance_factor.iter_rows().all(all_finite)
    }

    pub fn fits(&self, other: &Self) -> bool {
        self.estimate.len() == other.estimate.len()
            && self.covariance_factor.shape() == other.covariance_factor.shape()
    }
}
