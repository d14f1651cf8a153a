//! Simulated discrete-time plants: x⁺ = A x + B u + D d, y = C x + E u + v.

use nalgebra::{DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::super::contender::Inputs;

/// A plant that keeps its bounds.
pub struct Plant {
    pub a: DMatrix<f64>,
    pub b: DMatrix<f64>,
    pub c: DMatrix<f64>,
    pub feedthrough: DMatrix<f64>,
    pub d: DMatrix<f64>,
    /// |d|, uniformly distributed.
    pub disturbance: Vec<f64>,
    /// |v|, uniformly distributed.
    pub noise: Vec<f64>,
    /// Amplitude of u, a square wave.
    pub command: Vec<f64>,
    pub state: Vec<f64>,
}

impl Plant {
    /// `steps` instants.
    pub fn run(&self, steps: usize, seed: u64) -> Inputs {
        let mut generator = ChaCha8Rng::seed_from_u64(seed);
        let mut uniform = |bounds: &[f64]| {
            let draws = bounds
                .iter()
                .map(|bound| bound * generator.random_range(-1.0..=1.0));
            DVector::from_iterator(bounds.len(), draws)
        };
        let mut x = DVector::from_column_slice(&self.state);
        let (mut measurements, mut commands) = (Vec::new(), Vec::new());
        for k in 0..steps {
            let sign = if k / 37 % 2 == 0 { 1.0 } else { -1.0 };
            let u = DVector::from_column_slice(&self.command) * sign;
            let y = &self.c * &x + &self.feedthrough * &u + uniform(&self.noise);
            measurements.push(y.as_slice().to_vec());
            commands.push(u.as_slice().to_vec());
            x = &self.a * x + &self.b * u + &self.d * uniform(&self.disturbance);
        }
        Inputs::sampled(measurements, commands)
    }
}

/// The matrix of these rows.
pub fn matrix(rows: &serde_json::Value) -> DMatrix<f64> {
    let rows: Vec<Vec<f64>> = serde_json::from_value(rows.clone()).unwrap_or_default();
    let columns = rows.first().map_or(0, Vec::len);
    DMatrix::from_row_iterator(rows.len(), columns, rows.into_iter().flatten())
}
