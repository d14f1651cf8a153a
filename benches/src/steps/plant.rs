//! Random plants and their periodic runs.

use nalgebra::{DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Instants of one period of everything that drives a plant.
pub const PERIOD: usize = 64;

/// Periods after which no plant here remembers its start: all contract by a factor of 0.95 at least at every instant.
const PERIODS_TO_STEADY: usize = 16;

/// Random numbers of one seed.
#[derive(Clone, Debug)]
pub struct Draw(ChaCha8Rng);

impl Draw {
    /// Numbers for a plant with so many states.
    pub fn new(states: usize) -> Self {
        Self(ChaCha8Rng::seed_from_u64(states as u64))
    }

    /// A matrix of entries between -1 and 1.
    pub fn matrix(&mut self, rows: usize, columns: usize) -> DMatrix<f64> {
        DMatrix::from_fn(rows, columns, |_, _| self.0.random_range(-1.0..1.0))
    }

    /// A square matrix of spectral norm `norm`.
    pub fn of_norm(&mut self, norm: f64, n: usize) -> DMatrix<f64> {
        let matrix = self.matrix(n, n);
        let largest = matrix.singular_values().max();
        matrix * (norm / largest)
    }

    /// A number of a standard normal distribution (Box and Muller).
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.0.random::<f64>()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.0.random::<f64>()).cos()
    }

    /// Columns of [`Draw::normal`], one an instant.
    pub fn normal_columns(&mut self, rows: usize, instants: usize) -> DMatrix<f64> {
        DMatrix::from_fn(rows, instants, |_, _| self.normal())
    }
}

/// x(k+1) = A x + B u + D d, y = C x + F u + v.
#[derive(Clone, Debug)]
pub struct Plant {
    /// A, n x n, a contraction.
    pub a: DMatrix<f64>,
    /// B, n x m.
    pub b: DMatrix<f64>,
    /// C, p x n.
    pub c: DMatrix<f64>,
    /// F, p x m.
    pub feedthrough: DMatrix<f64>,
    /// D, n x q.
    pub d: DMatrix<f64>,
}

/// What drives a plant over one period: one column an instant.
#[derive(Clone, Debug)]
pub struct Drive {
    /// u, m rows.
    pub commands: DMatrix<f64>,
    /// d, q rows.
    pub disturbance: DMatrix<f64>,
    /// v, p rows.
    pub noise: DMatrix<f64>,
}

/// One period of a plant in its periodic steady state.
#[derive(Clone, Debug)]
pub struct Run {
    /// x at the first instant.
    pub start: DVector<f64>,
    /// y, one column an instant.
    pub outputs: DMatrix<f64>,
}

/// Slow sines between -1 and 1 with whole numbers of oscillations in a period, one row a command.
pub fn commands(count: usize) -> DMatrix<f64> {
    DMatrix::from_fn(count, PERIOD, |command, k| {
        (std::f64::consts::TAU * ((command + 1) * k) as f64 / PERIOD as f64).sin()
    })
}

impl Plant {
    /// The periodic steady state under this drive.
    pub fn run(&self, drive: &Drive) -> Run {
        let mut state = DVector::zeros(self.a.nrows());
        for k in (0..PERIOD).cycle().take(PERIODS_TO_STEADY * PERIOD) {
            state = self.next(&state, drive, k);
        }
        let start = state.clone();
        let mut outputs = DMatrix::zeros(self.c.nrows(), PERIOD);
        for k in 0..PERIOD {
            let u = drive.commands.column(k);
            let y = &self.c * &state + &self.feedthrough * u + drive.noise.column(k);
            outputs.set_column(k, &y);
            state = self.next(&state, drive, k);
        }
        Run { start, outputs }
    }

    fn next(&self, state: &DVector<f64>, drive: &Drive, k: usize) -> DVector<f64> {
        &self.a * state + &self.b * drive.commands.column(k) + &self.d * drive.disturbance.column(k)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_repeats_without_a_seam() {
        let mut draw = Draw::new(12);
        let plant = Plant {
            a: draw.of_norm(0.95, 12),
            b: draw.matrix(12, 2),
            c: draw.matrix(6, 12),
            feedthrough: DMatrix::zeros(6, 2),
            d: DMatrix::identity(12, 12),
        };
        let drive = Drive {
            commands: commands(2),
            disturbance: draw.matrix(12, PERIOD),
            noise: draw.matrix(6, PERIOD),
        };
        let run = plant.run(&drive);
        let end = (0..PERIOD).fold(run.start.clone(), |state, k| plant.next(&state, &drive, k));
        assert!((end - &run.start).amax() < 1e-12 * run.start.amax());
    }
}
