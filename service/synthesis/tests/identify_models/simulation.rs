//! Plants with Gaussian noise, and what they record.

use nalgebra::{DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use residual_synthesis::identify::RunData;
use residual_synthesis::identify::model::Plant;

/// A normal number by Box and Muller.
pub fn normal(random: &mut ChaCha8Rng) -> f64 {
    let (radius, angle): (f64, f64) = (
        random.random_range(f64::MIN_POSITIVE..1.0),
        random.random_range(0.0..1.0),
    );
    (-2.0 * radius.ln()).sqrt() * (std::f64::consts::TAU * angle).cos()
}

/// One run of `plant`; commands are steps that last five samples; `q` and `r` are factors of Q and R.
pub fn simulate(plant: &Plant, q: &DMatrix<f64>, r: &DMatrix<f64>, seed: u64, samples: usize) -> RunData {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut run = RunData {
        name: seed.to_string(),
        ..RunData::default()
    };
    let mut x = DVector::from_fn(plant.a.nrows(), |_, _| normal(&mut random));
    let mut u = DVector::zeros(plant.b.ncols());
    for k in 0..samples {
        if k % 5 == 0 {
            u = DVector::from_fn(plant.b.ncols(), |_, _| random.random_range(-1.0..1.0));
        }
        let v = DVector::from_fn(r.ncols(), |_, _| normal(&mut random));
        let y = &plant.c * &x + &plant.feedthrough * &u + r * v;
        run.commands.push(u.as_slice().to_vec());
        run.measurements.push(y.as_slice().to_vec());
        let d = DVector::from_fn(q.ncols(), |_, _| normal(&mut random));
        x = &plant.a * x + &plant.b * &u + &plant.disturbance * (q * d);
    }
    run
}

/// Several runs with seeds of their own.
pub fn runs(
    plant: &Plant,
    q: &DMatrix<f64>,
    r: &DMatrix<f64>,
    seed: u64,
    count: u64,
    samples: usize,
) -> Vec<RunData> {
    (0..count)
        .map(|run| simulate(plant, q, r, 1000 * seed + run, samples))
        .collect()
}
