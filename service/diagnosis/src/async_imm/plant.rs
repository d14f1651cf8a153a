//! The continuous-time plant dx/dt = A x + B u + G w + F f, constant or varying in time.

use crate::matrix::Matrix;
use nalgebra::DMatrix;
use std::{fmt, sync::Arc};

/// A, B, F and G Q G' of a time-invariant plant.
#[derive(Clone, Debug, PartialEq)]
pub struct LinearPlant {
    /// A, n_x x n_x, 1/s.
    pub a: DMatrix<f64>,
    /// B, n_x x n_u.
    pub b: DMatrix<f64>,
    /// F, n_x x n_f: one column a fault channel.
    pub f: DMatrix<f64>,
    /// G Q G', n_x x n_x: power spectral density of the process noise in state coordinates.
    pub noise: DMatrix<f64>,
}

impl LinearPlant {
    /// The plant of the filter state \[x; φ\] in a mode with direction D (n_f x p) and a random walk of the
    /// amplitude: Ā = \[A, F D; 0, 0\], B̄ = \[B; 0\], no channels, S̄ = diag(G Q G', diag(q_φ)).
    pub fn augmented(&self, direction: &DMatrix<f64>, random_walk_psd: &[f64]) -> Self {
        let (nx, p) = (self.a.nrows(), direction.ncols());
        let n = nx + p;
        let mut out = Self {
            a: DMatrix::zeros(n, n),
            b: DMatrix::zeros(n, self.b.ncols()),
            f: DMatrix::zeros(n, 0),
            noise: DMatrix::zeros(n, n),
        };
        out.a.view_mut((0, 0), (nx, nx)).copy_from(&self.a);
        out.a.view_mut((0, nx), (nx, p)).copy_from(&(&self.f * direction));
        out.b.view_mut((0, 0), self.b.shape()).copy_from(&self.b);
        out.noise.view_mut((0, 0), (nx, nx)).copy_from(&self.noise);
        for (j, density) in random_walk_psd.iter().enumerate().take(p) {
            out.noise[(nx + j, nx + j)] = *density;
        }
        out
    }
}

/// What a plant given as a function of time is at one time.
#[derive(Clone, Debug, PartialEq)]
pub struct PlantRates {
    /// A(t), n_x x n_x.
    pub a: Matrix,
    /// B(t) u(t), n_x.
    pub input: Vec<f64>,
    /// F(t), n_x x n_f.
    pub f: Matrix,
    /// G Q G' at t, n_x x n_x.
    pub noise: Matrix,
}

impl PlantRates {
    /// Room for n_x states and n_f fault channels.
    pub fn new(states: usize, channels: usize) -> Self {
        Self {
            a: Matrix::zeros(states, states),
            input: vec![0.0; states],
            f: Matrix::zeros(states, channels),
            noise: Matrix::zeros(states, states),
        }
    }
}

/// Writes the plant at a time (seconds of the clock of the packets) under the command held at that time.
///
/// It is called on the real-time path: it must not allocate, block or panic.
pub type PlantFunction = Arc<dyn Fn(f64, &[f64], &mut PlantRates) + Send + Sync>;

/// The plant over time.
#[derive(Clone)]
pub enum Plant {
    /// Time-invariant.
    Constant(LinearPlant),
    /// Piecewise constant: (from which time on, ns; the plant), in order of time. The first plant also holds before its time.
    Schedule(Vec<(i64, LinearPlant)>),
    /// Any function of time, integrated by Runge-Kutta steps (method sheet 3, step 4).
    Function {
        /// n_x.
        states: usize,
        /// n_u.
        inputs: usize,
        /// n_f.
        channels: usize,
        /// The function.
        function: PlantFunction,
    },
}

impl Plant {
    /// (n_x, n_u, n_f).
    pub fn sizes(&self) -> (usize, usize, usize) {
        let of = |plant: &LinearPlant| (plant.a.nrows(), plant.b.ncols(), plant.f.ncols());
        match self {
            Self::Constant(plant) => of(plant),
            Self::Schedule(plants) => plants.first().map_or((0, 0, 0), |(_, plant)| of(plant)),
            Self::Function {
                states,
                inputs,
                channels,
                ..
            } => (*states, *inputs, *channels),
        }
    }

    /// The time-invariant plants it consists of; none for a function of time.
    pub fn pieces(&self) -> impl Iterator<Item = &LinearPlant> {
        let (one, many) = match self {
            Self::Constant(plant) => (Some(plant), &[][..]),
            Self::Schedule(plants) => (None, plants.as_slice()),
            Self::Function { .. } => (None, &[][..]),
        };
        one.into_iter().chain(many.iter().map(|(_, plant)| plant))
    }
}

impl fmt::Debug for Plant {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Constant(plant) => plant.fmt(formatter),
            Self::Schedule(plants) => plants.fmt(formatter),
            Self::Function { .. } => formatter.write_str("a function of time"),
        }
    }
}
