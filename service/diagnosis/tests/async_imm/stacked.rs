//! Theorem 1 against the plain covariance of all samples, computed forward in time.

use crate::random::{random_commands, random_design, random_samples};
use crate::simulation::Draw;
use nalgebra::DMatrix;
use residual_diagnosis::async_imm::{
    design::{Form, ImmDesign, ModeTransition},
    estimator::{ImmEstimator, Sample},
    exact::discretise,
    plant::{LinearPlant, Plant},
};

/// Covariance of the stacked samples of a mode from the covariance at t_0.
fn forward(
    design: &ImmDesign,
    plant: &LinearPlant,
    mode: usize,
    samples: &[(i64, usize, Vec<f64>)],
) -> DMatrix<f64> {
    let (nx, p) = (plant.a.nrows(), design.slots());
    let n = nx + p;
    let augmented = plant.augmented(&design.modes[mode].direction, &vec![0.0; p]);
    let mut spread = DMatrix::zeros(n, n);
    spread
        .view_mut((0, 0), (nx, nx))
        .copy_from(&design.prior.state_covariance);
    spread
        .view_mut((nx, nx), (p, p))
        .copy_from(&design.prior.amplitude_covariance);
    let rows: Vec<usize> = samples
        .iter()
        .map(|(_, s, _)| design.sensors[*s].measurement_matrix.nrows())
        .collect();
    let total: usize = rows.iter().sum();
    let mut out = DMatrix::zeros(total, total);
    let (mut time, mut first) = (0, 0);
    // Cov(x̄(t_i), x̄(t_j)) = P(t_i) Φ̄(t_j, t_i)' for t_i <= t_j.
    for (i, (time_ns, sensor, _)) in samples.iter().enumerate() {
        let interval = discretise(&augmented, (time_ns / 1000 - time) as f64 * 1e-6);
        let phi = interval.phi.to_dense();
        spread = &phi * spread * phi.transpose() + interval.omega.to_dense();
        time = time_ns / 1000;
        let sensor = &design.sensors[*sensor];
        let h = sensor.measurement_matrix.clone().resize_horizontally(n, 0.0);
        let mut column = first;
        for (j, (later_ns, other, _)) in samples.iter().enumerate().skip(i) {
            let phi = discretise(&augmented, (later_ns / 1000 - time) as f64 * 1e-6)
                .phi
                .to_dense();
            let other = &design.sensors[*other];
            let h_other = other.measurement_matrix.clone().resize_horizontally(n, 0.0);
            let mut block = &h * &spread * phi.transpose() * h_other.transpose();
            if i == j {
                block += &sensor.noise_covariance;
            }
            out.view_mut((first, column), block.shape()).copy_from(&block);
            out.view_mut((column, first), (block.ncols(), block.nrows()))
                .copy_from(&block.transpose());
            column += rows[j];
        }
        first += rows[i];
    }
    out
}

#[test]
fn the_innovation_covariance_is_that_of_the_stacked_samples() {
    for seed in 0..20 {
        let mut draw = Draw::new(seed);
        let mut design = random_design(&mut draw);
        let modes = design.modes.len();
        design.form = Form::BatchUnobserved;
        design
            .sensors
            .iter_mut()
            .for_each(|sensor| sensor.arrival_probability = 1.0);
        design.transition = ModeTransition::PerStep(DMatrix::identity(modes, modes));
        design.mixing = residual_diagnosis::async_imm::design::Mixing::All;
        let end = 1_000_000_000;
        let samples = random_samples(&mut draw, &design, 8, end);
        let commands = random_commands(&mut draw, &design, end);
        let mut estimator = ImmEstimator::new(&design, samples.len()).unwrap();
        let mut posterior = estimator.start(0);
        let own = samples.iter().map(|(time_ns, sensor, values)| Sample {
            time_ns: *time_ns,
            sensor: *sensor,
            values,
            held_before: None,
        });
        estimator.advance(&mut posterior, end, own, &commands);
        let Plant::Constant(plant) = &design.plant else {
            panic!()
        };
        // The terms are those of the last mode.
        let expected = forward(&design, plant, modes - 1, &samples);
        let c = estimator.batch().unwrap().terms().c;
        let difference = (&c - &expected).amax() / expected.amax();
        assert!(difference < 1e-11, "{seed}: {difference}");
    }
}
