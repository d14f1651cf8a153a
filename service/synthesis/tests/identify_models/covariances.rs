//! Q and R of given models.

use crate::simulation::runs;
use nalgebra::{DMatrix, DVector, dmatrix};
use residual_diagnosis::covariance::semidefinite_factor;
use residual_synthesis::identify::RunData;
use residual_synthesis::identify::model::{
    IdentifiedModel, Plant, Structure, StructureOptions, identify_model,
};

fn plant() -> Plant {
    Plant {
        a: dmatrix![1.0, 0.1; 0.0, 0.95],
        b: dmatrix![0.005; 0.1],
        c: dmatrix![1.0, 0.0; 0.0, 1.0],
        feedthrough: DMatrix::zeros(2, 1),
        disturbance: dmatrix![0.005; 0.1],
    }
}

const FIXED: &str = "A = [[1, 0.1], [0, 0.95]]\nB = [[0.005], [0.1]]\nC = [[1, 0], [0, 1]]\nD = [[0.005], [0.1]]\n\
                     initial_state_radius = [2, 2]\n";

fn found(text: &str, q: f64, r: &DMatrix<f64>, seed: u64) -> IdentifiedModel {
    let options: StructureOptions = toml::from_str(&format!("{FIXED}{text}")).unwrap();
    let structure = Structure::new(&options, 0.1, 2, 1).unwrap();
    identify_model(&structure, &runs(&plant(), &dmatrix![q], r, seed, 4, 300), &[]).unwrap()
}

#[test]
fn variances_are_recovered_within_their_statistical_error() {
    let truth = [2.0_f64, 0.1, 0.3];
    let (mut squares, mut worst) = (0.0, 0.0_f64);
    for seed in 0..10 {
        let found = found("", truth[0], &dmatrix![truth[1], 0.0; 0.0, truth[2]], seed);
        for (noise, truth) in found.noise.iter().zip(truth) {
            let z = (noise.value - truth.ln()) / noise.standard_error;
            squares += z * z / 30.0;
            worst = worst.max(z.abs());
            assert!(noise.standard_error < 0.15, "{noise:?}");
        }
        let recovered = found.measurement_noise_covariance[(1, 1)].sqrt();
        assert!((recovered / truth[2] - 1.0).abs() < 0.1, "{recovered}");
    }
    assert!((0.5..1.7).contains(&squares) && worst < 4.0, "{squares} {worst}");
}

#[test]
fn correlated_noise_is_recovered_where_the_start_is_correlated() {
    let factor = dmatrix![0.2, 0.0; 0.24, 0.18];
    let start = "measurement_noise_covariance = [[0.1, 0.01], [0.01, 0.1]]";
    let found = found(start, 1.0, &factor, 3);
    let truth = &factor * factor.transpose();
    assert!(
        (&found.measurement_noise_covariance - &truth).amax() < 0.1 * truth.amax(),
        "{found:?}"
    );
    assert!(found.measurement_noise_covariance.clone().cholesky().is_some());
}

#[test]
fn a_disturbance_that_is_not_there_gets_the_variance_zero() {
    let found = found("", 0.0, &dmatrix![0.1, 0.0; 0.0, 0.1], 6);
    // Zero, or so small that it moves the speed far less than the noise does.
    assert!(found.disturbance_covariance[(0, 0)].sqrt() < 0.2, "{found:?}");
    let given = self::found(
        "disturbance_covariance = [[0]]",
        0.0,
        &dmatrix![0.1, 0.0; 0.0, 0.1],
        6,
    );
    assert_eq!(given.disturbance_covariance[(0, 0)], 0.0);
    assert_eq!(given.noise.len(), 2);
}

#[test]
fn a_start_far_off_leads_to_the_same_covariances() {
    let truth = dmatrix![0.1, 0.0; 0.0, 0.3];
    let reference = found("", 2.0, &truth, 1);
    let far = "disturbance_covariance = [[1e-3]]\nmeasurement_noise_covariance = [[10, 0], [0, 1e-3]]";
    let other = found(far, 2.0, &truth, 1);
    for (a, b) in reference.noise.iter().zip(&other.noise) {
        assert!(
            (a.value - b.value).abs() < 0.02 * a.standard_error.max(0.01),
            "{a:?} {b:?}"
        );
    }
}

/// Two disturbances that move a state each.
fn pair() -> Plant {
    Plant {
        a: dmatrix![0.9, 0.1; 0.0, 0.8],
        b: dmatrix![0.5; 0.1],
        c: dmatrix![1.0, 0.0; 0.0, 1.0],
        feedthrough: DMatrix::zeros(2, 1),
        disturbance: dmatrix![1.0, 0.0; 0.0, 1.0],
    }
}

#[test]
fn disturbances_that_are_multiples_of_each_other_keep_their_variances() {
    let factor = dmatrix![1.0; 2.0];
    let truth = &factor * factor.transpose();
    let r = dmatrix![0.3, 0.0; 0.0, 0.3];
    let text = "A = [[0.9, 0.1], [0, 0.8]]\nB = [[0.5], [0.1]]\nC = [[1, 0], [0, 1]]\nD = [[1, 0], [0, 1]]\n\
                initial_state_radius = [2, 2]\ndisturbance_covariance = [[2, 0.1], [0.1, 2]]\n";
    let options: StructureOptions = toml::from_str(text).unwrap();
    let structure = Structure::new(&options, 0.1, 2, 1).unwrap();
    let mut vanished = 0;
    for seed in 0..24 {
        let training = runs(&pair(), &factor, &r, seed, 2, 150);
        let found = identify_model(&structure, &training, &[]).unwrap();
        let q = &found.disturbance_covariance;
        // Four standard errors of a variance from 300 samples.
        assert!((q - &truth).amax() < 0.35 * 4.0, "seed {seed}: {q}");
        assert!(semidefinite_factor(q).is_ok(), "seed {seed}: {q}");
        for (i, deviation) in found.deviations.iter().take(2).enumerate() {
            assert!(
                (deviation.value / q[(i, i)].sqrt() - 1.0).abs() < 1e-5,
                "{deviation:?} {q}"
            );
            assert!(!deviation.at_lower_limit, "{deviation:?}");
        }
        if found.noise.iter().any(|noise| noise.at_limit) {
            vanished += 1;
            // The figures are those of the covariances given, taken as fixed.
            let (predicted, likelihood) = figures(&pair(), q, &found.measurement_noise_covariance, &training);
            assert!(
                (found.training.normalised_square / predicted - 1.0).abs() < 1e-4,
                "seed {seed}: {predicted} {found:?}"
            );
            assert!(
                (found.log_likelihood - likelihood).abs() < 1e-2,
                "seed {seed}: {likelihood} {found:?}"
            );
        }
    }
    assert!(vanished >= 3, "{vanished}");
}

/// Mean normalised innovation square from the fourth instant on, and log-likelihood, by a Kalman filter of its own.
fn figures(plant: &Plant, q: &DMatrix<f64>, r: &DMatrix<f64>, runs: &[RunData]) -> (f64, f64) {
    let (mut square, mut count, mut likelihood) = (0.0, 0.0, 0.0);
    for run in runs {
        let mut x = DVector::zeros(2);
        let mut p = DMatrix::identity(2, 2) * (4.0 / 3.0);
        for (k, (u, y)) in run.commands.iter().zip(&run.measurements).enumerate() {
            if k + 1 == run.commands.len() {
                break;
            }
            let e = DVector::from_column_slice(y) - &plant.c * &x;
            let s = &plant.c * &p * plant.c.transpose() + r;
            let inverse = s.clone().try_inverse().unwrap();
            let normalised = e.dot(&(&inverse * &e));
            likelihood -= 0.5 * (normalised + s.determinant().ln() + 2.0 * std::f64::consts::TAU.ln());
            if k >= 3 {
                (square, count) = (square + normalised, count + 2.0);
            }
            let gain = &p * plant.c.transpose() * inverse;
            x = &plant.a * (x + &gain * e) + &plant.b * DVector::from_column_slice(u);
            let updated = (DMatrix::identity(2, 2) - gain * &plant.c) * p;
            p = &plant.a * updated * plant.a.transpose()
                + &plant.disturbance * q * plant.disturbance.transpose();
        }
    }
    (square / count, likelihood)
}
