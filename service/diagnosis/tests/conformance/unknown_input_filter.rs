//! The bank of unknown-input filters on the aircraft example, in each of its forms.

use crate::case::{Case, Promise, design};
use crate::conforms;
use crate::plant::{Draw, LinearPlant, Noise, Plant};
use nalgebra::DMatrix;
use residual_diagnosis::unknown_input_filter::tables::UnknownInputFilterTables;
use std::sync::OnceLock;

const MODEL: &str = r#"
[model]
A = [[0.9996, 0.0003, 0.0002, -0.0046], [0.0005, 0.9899, 0.0, -0.0402], [0.0010, 0.0007, 0.9929, 0.0012], [0, 0, 0.01, 1]]
B = [[0.0044, 0.0018], [0.0198, -0.0759], [-0.0552, 0.0449], [0, 0]]
C = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 1, 1, 1]]
D = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
disturbance_bound = [0.01, 0.01, 0.01, 0.01]
measurement_noise_bound = [0.01, 0.01, 0.01, 0.01]
initial_state_center = [0, 0, 0, 0]
initial_state_radius = [1, 1, 1, 1]
"#;

/// Noise and disturbance reach their bounds.
fn aircraft(seed: u64) -> Box<dyn Plant> {
    Box::new(aircraft_with(seed, 0.01))
}

/// They stay a rounding error below them: only the coupled form bounds rounding errors.
fn aircraft_within(seed: u64) -> Box<dyn Plant> {
    Box::new(aircraft_with(seed, 0.01 * (1.0 - 1e-9)))
}

fn aircraft_with(seed: u64, bound: f64) -> LinearPlant {
    let mut draw = Draw::new(seed, Noise::Bounded);
    let state = draw.vector(&[1.0; 4]);
    LinearPlant {
        a: DMatrix::from_row_slice(
            4,
            4,
            &[
                0.9996, 0.0003, 0.0002, -0.0046, 0.0005, 0.9899, 0.0, -0.0402, 0.0010, 0.0007, 0.9929,
                0.0012, 0.0, 0.0, 0.01, 1.0,
            ],
        ),
        b: DMatrix::from_row_slice(
            4,
            2,
            &[0.0044, 0.0018, 0.0198, -0.0759, -0.0552, 0.0449, 0.0, 0.0],
        ),
        c: DMatrix::from_row_slice(
            4,
            4,
            &[
                1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 1.0,
            ],
        ),
        feedthrough: DMatrix::zeros(4, 2),
        d: DMatrix::identity(4, 4),
        disturbance: vec![bound; 4],
        noise: vec![bound; 4],
        command: vec![0.5, -0.2],
        actuator_fault: vec![2.0, 0.0],
        sensor_fault: vec![0.0; 4],
        state,
        draw,
        loss: 0.02,
        k: 0,
    }
}

fn case(options: &str) -> Case {
    Case {
        tables: format!("{MODEL}\n[missing]\nfault_bound = [10.0, 10.0]\n{options}"),
        design: design::<UnknownInputFilterTables>,
        period_ns: 10_000_000,
        plant: aircraft,
        promise: Promise::NoFalseAlarm,
        designed: OnceLock::new(),
    }
}

conforms! {
    coupled_row_wise => case("");
    coupled_fixed => case("[filter]\ngain = \"fixed\"");
    coupled_frobenius => case("[filter]\ngain = \"frobenius\"");
    paper => Case {
        plant: aircraft_within,
        ..case("[filter]\nform = \"paper\"")
    };
    kalman_3sigma => Case {
        promise: Promise::NoClaim("the three-sigma baseline bounds nothing"),
        ..case("[filter]\nform = \"kalman_3sigma\"\nresidual_norm_threshold = 0.1\ninitial_covariance = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]")
    };
}
