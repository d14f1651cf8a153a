//! What is held and looked up against what is computed at every instant.

use super::{ChiSquareDiagnoser, ChiSquareOptions};
use crate::diagnoser::{Diagnoser, StepInput, StepRecord};
use nalgebra::DMatrix;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

/// Instant at which one row is missing.
const LOST: usize = 250;
const INSTANTS: usize = 450;

fn diagonal(n: usize, entry: impl Fn(usize) -> f64) -> Vec<Vec<f64>> {
    let entry = |i: usize, j: usize| if i == j { entry(i) } else { 0.0 };
    (0..n).map(|i| (0..n).map(|j| entry(i, j)).collect()).collect()
}

fn options(n: usize, m: usize, stride: u64) -> ChiSquareOptions {
    let mut options: ChiSquareOptions = toml::from_str(&format!(
        "[statistics]\n\
         enabled = [\"residual\", \"state_plain\", \"state_window\", \"state_two_propagator\", \"glr\", \"cusum\"]\n\
         window_steps = [1, 4, 9]\n\
         stability_guard = \"warn\"\n\
         [glr]\nwindow_steps = 40\nonset_stride_steps = {stride}\n\
         signatures = [\"sensor_step\", \"sensor_ramp\", \"process_step\"]\n\
         [threshold]\nglr = 19.5\ncusum = 14.8\n\
         [model]"
    ))
    .unwrap();
    let model = &mut options.model;
    model.transition = diagonal(n, |i| 0.95 - 0.1 * i as f64);
    (1..n).for_each(|i| model.transition[i - 1][i] = 0.1);
    model.process_noise_covariance = diagonal(n, |_| 0.01);
    model.measurement = (0..m)
        .map(|i| (0..n).map(|j| if j % m == i { 1.0 } else { 0.0 }).collect())
        .collect();
    model.measurement_noise_covariance = diagonal(m, |i| 0.02 + 0.01 * i as f64);
    model.initial_covariance = diagonal(n, |_| 0.3);
    options.glr.process_fault_input = (0..n).map(|i| vec![if i == 0 { 0.5 } else { -0.25 }]).collect();
    options
}

fn measurement(draw: &mut ChaCha8Rng, m: usize, k: usize) -> Vec<f64> {
    let mut z: Vec<f64> = (0..m).map(|_| draw.random_range(-0.5..0.5)).collect();
    if k == LOST {
        z[m - 1] = f64::NAN;
    }
    z
}

fn step(diagnoser: &mut ChiSquareDiagnoser, z: &[f64]) -> StepRecord {
    let mut record = StepRecord::new(diagnoser.description().channels.len());
    diagnoser.step(&StepInput::new(z, &[]), &mut record);
    record
}

fn saved(diagnoser: &ChiSquareDiagnoser) -> Vec<u8> {
    let mut state = Vec::new();
    diagnoser.save(&mut state);
    state
}

/// A restored diagnoser looks nothing up: it has found nothing yet.
#[test]
fn what_is_looked_up_has_the_bits_of_what_is_computed() {
    for (n, m, stride) in [
        (1, 1, 1),
        (2, 1, 1),
        (3, 2, 1),
        (4, 3, 1),
        (6, 2, 1),
        (3, 2, 4),
        (2, 2, 7),
    ] {
        let mut looking_up = ChiSquareDiagnoser::new(&options(n, m, stride)).unwrap();
        let mut computing = looking_up.clone();
        let mut draw = ChaCha8Rng::seed_from_u64(n as u64);
        let mut steadiest = [0, 0];
        for k in 0..INSTANTS {
            let z = measurement(&mut draw, m, k);
            computing.restore(&saved(&computing)).unwrap();
            let (one, other) = (step(&mut looking_up, &z), step(&mut computing, &z));
            assert!(
                one.same_bits(&other),
                "n = {n}, s = {stride}, k = {k}: {one:?}\n{other:?}"
            );
            assert_eq!(
                saved(&looking_up),
                saved(&computing),
                "n = {n}, s = {stride}, k = {k}"
            );
            assert!(computing.engine.outcome.update.steady_steps <= 1);
            let part = usize::from(k > LOST);
            steadiest[part] = steadiest[part].max(looking_up.engine.outcome.update.steady_steps);
        }
        assert!(
            steadiest.iter().all(|steps| *steps > 80),
            "n = {n}: {steadiest:?}"
        );
    }
}

/// P⁻ = ΦPΦ' + GG', P = P⁻ - P⁻H'(HP⁻H' + R)⁻¹HP⁻, without any hold.
#[test]
fn what_is_held_is_the_covariance_of_the_full_recursion() {
    for (n, m) in [(1, 1), (2, 1), (3, 2), (6, 2)] {
        let options = options(n, m, 1);
        let mut diagnoser = ChiSquareDiagnoser::new(&options).unwrap();
        let dense = |rows: &[Vec<f64>]| DMatrix::from_fn(rows.len(), rows[0].len(), |i, j| rows[i][j]);
        let model = &options.model;
        let (phi, h) = (dense(&model.transition), dense(&model.measurement));
        let (q, r) = (
            dense(&model.process_noise_covariance),
            dense(&model.measurement_noise_covariance),
        );
        let mut p = dense(&model.initial_covariance);
        let mut draw = ChaCha8Rng::seed_from_u64(7);
        for k in 0..LOST {
            step(&mut diagnoser, &measurement(&mut draw, m, k));
            let predicted = &phi * p * phi.transpose() + &q;
            let s = &h * &predicted * h.transpose() + &r;
            let gain = &predicted * h.transpose() * s.try_inverse().unwrap();
            p = &predicted - gain * &h * &predicted;
            let factor = diagnoser.covariance_factor().to_dense();
            let error = (&factor * factor.transpose() - &p).amax();
            assert!(error <= 1e-13 * p.amax(), "n = {n}, k = {k}: {error:e}");
        }
        assert!(diagnoser.engine.outcome.update.steady_steps > 80);
    }
}
