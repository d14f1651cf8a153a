//! Plants of a configuration in simulation, with disturbance, noise and start inside their boxes.

use nalgebra::{DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use residual_diagnosis::reduced_order_observer::options::ModelOptions;

/// How unknowns are drawn from their boxes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Draw {
    /// Uniformly.
    Uniform,
    /// At the corners.
    Vertex,
}

/// x(k+1) = A x + B (u + f) + D η, y = C x + v.
pub struct Simulation {
    a: DMatrix<f64>,
    b: DMatrix<f64>,
    c: DMatrix<f64>,
    d: DMatrix<f64>,
    model: ModelOptions,
    /// The true state.
    pub x: DVector<f64>,
    pub random: ChaCha8Rng,
    draw: Draw,
}

fn dense(rows: &[Vec<f64>]) -> DMatrix<f64> {
    DMatrix::from_fn(rows.len(), rows[0].len(), |i, j| rows[i][j])
}

impl Simulation {
    /// A run of this seed, started inside the box of x(0).
    pub fn new(model: &ModelOptions, seed: u64, draw: Draw) -> Self {
        let mut out = Self {
            a: dense(&model.a),
            b: dense(&model.b),
            c: dense(&model.c),
            d: dense(&model.d),
            model: model.clone(),
            x: DVector::zeros(model.a.len()),
            random: ChaCha8Rng::seed_from_u64(seed),
            draw,
        };
        let (lower, upper) = (
            model.initial_state_lower.clone(),
            model.initial_state_upper.clone(),
        );
        out.x = DVector::from_fn(lower.len(), |i, _| out.between(lower[i], upper[i]));
        out
    }

    /// A number of an interval.
    pub fn between(&mut self, lower: f64, upper: f64) -> f64 {
        match self.draw {
            Draw::Uniform => lower + (upper - lower) * self.random.random::<f64>(),
            Draw::Vertex if self.random.random::<bool>() => lower,
            Draw::Vertex => upper,
        }
    }

    /// True with this probability.
    pub fn chance(&mut self, probability: f64) -> bool {
        self.random.random::<f64>() < probability
    }

    /// y(k).
    pub fn measure(&mut self) -> Vec<f64> {
        let mut y = &self.c * &self.x;
        for i in 0..y.len() {
            let bound = self.model.measurement_noise_bound.get(i).copied().unwrap_or(0.0);
            y[i] += self.between(-bound, bound);
        }
        y.as_slice().to_vec()
    }

    /// From k to k + 1 with a drawn disturbance.
    pub fn advance(&mut self, u: &[f64], f: &[f64]) {
        let count = self.d.ncols();
        let (lower, upper) = (
            self.model.disturbance_lower.clone(),
            self.model.disturbance_upper.clone(),
        );
        let eta = DVector::from_fn(count, |i, _| self.between(lower[i], upper[i]));
        self.advance_with(u, f, &eta);
    }

    /// From k to k + 1.
    pub fn advance_with(&mut self, u: &[f64], f: &[f64], eta: &DVector<f64>) {
        let acting = DVector::from_column_slice(u) + DVector::from_column_slice(f);
        self.x = &self.a * &self.x + &self.b * acting + &self.d * eta;
    }
}

/// A plant whose invariant zeros are stable, whatever it is: some decoupling gain makes F stable.
pub fn random_plant(seed: u64) -> ModelOptions {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let p = random.random_range(1..=4_usize);
    let n = p + random.random_range(0..=3_usize);
    let q = random.random_range(0..=p.min(2));
    let m = random.random_range(1..=2_usize);
    let nz = n - p;
    let mut matrix = |rows: usize, columns: usize, size: f64| {
        DMatrix::from_fn(rows, columns, |_, _| size * random.random_range(-1.0..1.0))
    };
    let k = matrix(nz, p, 1.0);
    let d1 = matrix(p, q, 1.0);
    let a12 = matrix(p, nz, 0.7);
    let f = matrix(nz, nz, 0.8 / nz.max(1) as f64);
    let a22 = f - &k * &a12;
    let a = stack(
        &beside(&matrix(p, p, 0.5), &a12),
        &beside(&matrix(nz, p, 0.5), &a22),
    );
    let d = stack(&d1, &(-k * &d1));
    let b = matrix(n, m, 1.0);
    let t = DMatrix::identity(n, n) + matrix(n, n, 0.3);
    let inverse = t.clone().try_inverse().unwrap();
    let c = t.rows(0, p).into_owned();
    let mut bounds = |length: usize, size: f64| -> (Vec<f64>, Vec<f64>) {
        (0..length)
            .map(|_| {
                let centre = size * random.random_range(-1.0..1.0);
                let radius = size * random.random::<f64>();
                (centre - radius, centre + radius)
            })
            .unzip()
    };
    let (initial_state_lower, initial_state_upper) = bounds(n, 1.0);
    let (disturbance_lower, disturbance_upper) = bounds(q, 1.0);
    let (input_lower, input_upper) = bounds(m, 2.0);
    let noise = if seed.is_multiple_of(3) { 0.0 } else { 0.05 };
    ModelOptions {
        a: rows(&(&inverse * a * &t)),
        b: rows(&(&inverse * b)),
        c: rows(&c),
        d: rows(&(inverse * d)),
        initial_state_lower,
        initial_state_upper,
        disturbance_lower,
        disturbance_upper,
        measurement_noise_bound: vec![noise; p],
        input_lower: Some(input_lower),
        input_upper: Some(input_upper),
        ..ModelOptions::default()
    }
}

fn stack(upper: &DMatrix<f64>, lower: &DMatrix<f64>) -> DMatrix<f64> {
    let above = upper.nrows();
    DMatrix::from_fn(above + lower.nrows(), upper.ncols(), |i, j| {
        if i < above {
            upper[(i, j)]
        } else {
            lower[(i - above, j)]
        }
    })
}

fn beside(left: &DMatrix<f64>, right: &DMatrix<f64>) -> DMatrix<f64> {
    stack(&left.transpose(), &right.transpose()).transpose()
}

/// A matrix as a configuration writes it.
pub fn rows(matrix: &DMatrix<f64>) -> Vec<Vec<f64>> {
    matrix
        .row_iter()
        .map(|row| row.iter().copied().collect())
        .collect()
}
