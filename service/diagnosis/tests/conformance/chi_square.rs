//! Chi-square tests, likelihood ratio and cumulative sums on a vehicle with position, wheel speed and acceleration.

use crate::case::{Case, Promise, design};
use crate::conforms;
use crate::plant::{Draw, LinearPlant, Noise, Plant, Sample};
use nalgebra::DMatrix;
use residual_diagnosis::chi_square::ChiSquareOptions;
use std::sync::OnceLock;

const MATRICES: &str = r#"
transition = [[1.0, 0.1, -0.005], [0.0, 1.0, -0.1], [0.0, 0.0, 0.999]]
input = [[0.005], [0.1], [0.0]]
process_noise_input = [[0.00025, 0.0], [0.005, 0.0], [0.0, 0.001]]
process_noise_covariance = [[1.0, 0.0], [0.0, 1.0]]
measurement = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
measurement_noise_covariance = [[2.25, 0.0], [0.0, 0.0064]]
"#;

const START: &str = "initial_covariance = [[4.0, 0.0, 0.0], [0.0, 0.25, 0.0], [0.0, 0.0, 0.01]]";

fn vehicle_with(seed: u64, loss: f64) -> LinearPlant {
    let mut draw = Draw::new(seed, Noise::Gaussian);
    let state = draw.vector(&[2.0, 0.5, 0.1]);
    LinearPlant {
        a: DMatrix::from_row_slice(3, 3, &[1.0, 0.1, -0.005, 0.0, 1.0, -0.1, 0.0, 0.0, 0.999]),
        b: DMatrix::from_row_slice(3, 1, &[0.005, 0.1, 0.0]),
        c: DMatrix::from_row_slice(2, 3, &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0]),
        feedthrough: DMatrix::zeros(2, 1),
        d: DMatrix::from_row_slice(3, 2, &[0.00025, 0.0, 0.005, 0.0, 0.0, 0.001]),
        disturbance: vec![1.0; 2],
        noise: vec![1.5, 0.08],
        command: vec![0.5],
        actuator_fault: vec![0.0],
        sensor_fault: vec![0.0, 1.0],
        state,
        draw,
        loss,
        k: 0,
    }
}

fn vehicle(seed: u64) -> Box<dyn Plant> {
    Box::new(vehicle_with(seed, 0.0))
}

fn vehicle_with_losses(seed: u64) -> Box<dyn Plant> {
    Box::new(vehicle_with(seed, 0.1))
}

/// The vehicle, and after its command the number of the model, always one that fits.
struct Selecting(LinearPlant);

impl Plant for Selecting {
    fn next(&mut self, faulty: bool) -> Sample {
        let number = (self.0.k / 7 % 2) as f64;
        let mut sample = self.0.next(faulty);
        sample.commands.push(number);
        sample
    }
}

fn selecting_vehicle(seed: u64) -> Box<dyn Plant> {
    Box::new(Selecting(vehicle_with(seed, 0.1)))
}

fn case(options: &str, promise: Promise) -> Case {
    Case {
        tables: format!("[model]\n{MATRICES}{START}\n{options}"),
        design: design::<ChiSquareOptions>,
        period_ns: 100_000_000,
        plant: vehicle,
        promise,
        designed: OnceLock::new(),
    }
}

/// Thresholds that the calibration finds for this vehicle with 100000 runs of 199 steps, M = 40.
const JOINT: &str = "[glr]\nwindow_steps = 40\n[threshold]\nglr = 19.53\ncusum = 14.80\n";

const RATE: Promise = Promise::PerRun {
    probability: 0.05,
    steps: 200,
    at_most: false,
};

conforms! {
    likelihood_ratio_and_sums => case(JOINT, RATE);
    likelihood_ratio_and_sums_with_losses => Case {
        plant: vehicle_with_losses,
        promise: Promise::PerRun { probability: 0.05, steps: 200, at_most: true },
        ..case(JOINT, RATE)
    };
    residual => case(
        "[statistics]\nenabled = [\"residual\"]\ndecision = [\"residual\"]\n[threshold]\nmode = \"per_instant\"",
        Promise::PerInstant { channel: "residual", probability: 5e-3 },
    );
    state_tests => Case {
        plant: vehicle_with_losses,
        ..case(
            "[statistics]\nenabled = [\"state_plain\", \"state_window\", \"state_two_propagator\"]\n\
             decision = [\"state_window\", \"state_two_propagator\"]\nstability_guard = \"warn\"\n\
             [threshold]\nmode = \"per_instant\"",
            Promise::NoClaim("alarms of the state tests come in bursts; the rate per instant is tested elsewhere"),
        )
    };
    selected_models_with_exclusion => Case {
        tables: format!(
            "[model]\nschedule = \"selected\"\n{START}\n[[models]]\n{MATRICES}[[models]]\n{MATRICES}\n{JOINT}\
             [alarm]\non_isolation = \"exclude_and_compensate\"\nwarmup_steps = 5\nconfirm_steps = 2"
        ),
        plant: selecting_vehicle,
        promise: Promise::PerRun { probability: 0.05, steps: 200, at_most: true },
        ..case("", RATE)
    };
}
