//! Simulated plants that keep the model's assumptions, and random models.

use nalgebra::{DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use residual_diagnosis::{
    chi_square::{ChiSquareOptions, MatricesOptions, ModelOptions, Schedule},
    covariance::semidefinite_factor,
    tables::matrix,
};

/// Random numbers of one seed.
pub struct Draw(ChaCha8Rng);

impl Draw {
    pub fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.0.random::<f64>()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.0.random::<f64>()).cos()
    }

    pub fn normals(&mut self, count: usize) -> DVector<f64> {
        DVector::from_fn(count, |_, _| self.normal())
    }

    pub fn matrix(&mut self, rows: usize, columns: usize, size: f64) -> Vec<Vec<f64>> {
        (0..rows)
            .map(|_| (0..columns).map(|_| size * self.normal()).collect())
            .collect()
    }

    pub fn below(&mut self, count: usize) -> usize {
        self.0.random_range(0..count)
    }

    pub fn chance(&mut self, probability: f64) -> bool {
        self.0.random::<f64>() < probability
    }
}

/// A plant with the matrices of options with one model.
pub struct Plant {
    phi: DMatrix<f64>,
    input: DMatrix<f64>,
    h: DMatrix<f64>,
    d: DMatrix<f64>,
    noise: DMatrix<f64>,
    measurement_noise: DMatrix<f64>,
    pub state: DVector<f64>,
    pub draw: Draw,
}

impl Plant {
    /// The plant at instant 0, x(0) drawn from its distribution.
    pub fn new(options: &ChiSquareOptions, seed: u64) -> Self {
        let model = &options.model;
        let dense = |rows: &[Vec<f64>]| matrix("", rows).unwrap();
        let (phi, h) = (dense(&model.transition), dense(&model.measurement));
        let inputs = model.matrices().input_count();
        let or_zero = |rows: &[Vec<f64>], count| {
            if rows.is_empty() {
                DMatrix::zeros(count, inputs)
            } else {
                dense(rows)
            }
        };
        let factor = |rows: &[Vec<f64>]| semidefinite_factor(&dense(rows)).unwrap();
        let q = factor(&model.process_noise_covariance);
        let noise = match model.process_noise_input.is_empty() {
            true => q,
            false => dense(&model.process_noise_input) * q,
        };
        let mut draw = Draw::new(seed);
        let n = phi.nrows();
        let mean = model.initial_state.clone().unwrap_or_else(|| vec![0.0; n]);
        let state = DVector::from_vec(mean) + factor(&model.initial_covariance) * draw.normals(n);
        Self {
            input: or_zero(&model.input, n),
            d: or_zero(&model.feedthrough, h.nrows()),
            measurement_noise: factor(&model.measurement_noise_covariance),
            phi,
            h,
            noise,
            state,
            draw,
        }
    }

    /// z of the next instant: u(k-1) drives the state, u(k) feeds through.
    pub fn next(&mut self, previous_input: &[f64], input: &[f64]) -> Vec<f64> {
        let inputs = |u: &[f64]| DVector::from_column_slice(u);
        let w = self.draw.normals(self.noise.ncols());
        self.state = &self.phi * &self.state + &self.input * inputs(previous_input) + &self.noise * w;
        let v = self.draw.normals(self.h.nrows());
        let z = &self.h * &self.state + &self.d * inputs(input) + &self.measurement_noise * v;
        z.as_slice().to_vec()
    }
}

fn square(rows: &[Vec<f64>], diagonal: f64) -> Vec<Vec<f64>> {
    let n = rows.len();
    let dot = |i: usize, j: usize| rows[i].iter().zip(&rows[j]).map(|(a, b)| a * b).sum::<f64>();
    (0..n)
        .map(|i| {
            (0..n)
                .map(|j| dot(i, j) + if i == j { diagonal } else { 0.0 })
                .collect()
        })
        .collect()
}

/// Random matrices with n states, m measurements, p inputs and r noises.
pub fn random_matrices(draw: &mut Draw, [n, m, p, r]: [usize; 4]) -> MatricesOptions {
    let unit = |i: usize| (0..r).map(|j| f64::from(u8::from(i == j))).collect();
    let noise = draw.matrix(m, m, 0.3);
    MatricesOptions {
        transition: draw.matrix(n, n, 0.9 / (n as f64).sqrt()),
        input: draw.matrix(n, p, 1.0),
        process_noise_input: draw.matrix(n, r, 0.5),
        process_noise_covariance: (0..r).map(unit).collect(),
        measurement: draw.matrix(m, n, 1.0),
        feedthrough: draw.matrix(m, p, 1.0),
        measurement_noise_covariance: square(&noise, 0.2),
    }
}

/// Options with a random start for matrices.
pub fn random_options(draw: &mut Draw, matrices: MatricesOptions, schedule: Schedule) -> ChiSquareOptions {
    let (n, p) = (matrices.transition.len(), matrices.input_count());
    let spread = if draw.chance(0.3) { 0.0 } else { 0.7 };
    let start = draw.matrix(n, n, spread);
    let model = ModelOptions {
        initial_state: Some(draw.normals(n).as_slice().to_vec()),
        initial_covariance: square(&start, 0.0),
        initial_input: Some(vec![0.0; p]),
        schedule,
        ..ModelOptions::default()
    };
    let mut options = crate::common::without_calibration(ChiSquareOptions {
        model: crate::common::with_matrices(model, matrices),
        ..ChiSquareOptions::default()
    });
    options.statistics.stability_guard = residual_diagnosis::chi_square::StabilityGuard::Warn;
    options.statistics.enabled = crate::common::ALL.to_vec();
    options
}
