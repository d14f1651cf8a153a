//! All statistics of the chi-square diagnoser: 3 states, 2 sensors, 4 windows, 120 onsets of 4 fault modes.

use anyhow::Result;
use nalgebra::DMatrix;
use residual_diagnosis::chi_square::ChiSquareOptions;

use super::plant::{Plant, matrix};
use super::{Case, Program, design};

/// A vehicle with position, wheel speed and acceleration; GNSS and wheel speed are measured.
const TABLES: &str = r#"
[model]
transition = [[1.0, 0.1, -0.005], [0.0, 1.0, -0.1], [0.0, 0.0, 0.999]]
input = [[0.005], [0.1], [0.0]]
process_noise_input = [[0.00025, 0.0], [0.005, 0.0], [0.0, 0.001]]
process_noise_covariance = [[1.0, 0.0], [0.0, 1.0]]
measurement = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
measurement_noise_covariance = [[2.25, 0.0], [0.0, 0.0064]]
initial_covariance = [[4.0, 0.0, 0.0], [0.0, 0.25, 0.0], [0.0, 0.0, 0.01]]
[threshold]
mode = "per_instant"
glr = 19.53
cusum = 14.80
"#;

const SAMPLE_TIME_S: f64 = 0.1;

pub(super) fn cases() -> Result<Vec<Case>> {
    let designed = design::<ChiSquareOptions>(TABLES, SAMPLE_TIME_S)?;
    let model = &designed.tables["model"];
    // Uniform with the variances of the model.
    let root_three = 3.0_f64.sqrt();
    let inputs = Plant {
        a: matrix(&model["transition"]),
        b: matrix(&model["input"]),
        c: matrix(&model["measurement"]),
        feedthrough: DMatrix::zeros(2, 1),
        d: matrix(&model["process_noise_input"]),
        disturbance: vec![root_three; 2],
        noise: vec![1.5 * root_three, 0.08 * root_three],
        command: vec![0.5],
        state: vec![1.0, 0.2, 0.05],
    }
    .run(300, 4);
    let problem = designed.problem(SAMPLE_TIME_S, &inputs);
    Ok(vec![Case {
        name: "chi_square",
        title: "chi-square tests, 3 states, 2 sensors, 4 windows, 120 onsets of 4 faults".to_owned(),
        compared: designed.channels(&[""]),
        own: vec![("residuald".to_owned(), designed.diagnoser, 0.0)],
        peers: vec![(
            Program::Python {
                script: "chi_square",
                package: "numpy",
            },
            None,
        )],
        inputs,
        problem,
        tolerance: 1e-9,
    }])
}
