//! Reduced-order observers of a servo drive: 3 states, 2 outputs, one detecting observer and one fault estimator.

use anyhow::Result;
use nalgebra::DMatrix;
use residual_diagnosis::reduced_order_observer::options::ReducedOrderObserverOptions;

use super::plant::{Plant, matrix};
use super::{Case, Program, design};

const TABLES: &str = r#"
[model]
A = [[0.49, 0.10, 0.06], [-0.32, 0.95, -0.23], [-0.25, -0.06, 0.63]]
B = [[0.4], [0.4], [0.5]]
C = [[1, 0, 0], [0, 1, 0]]
D = [[-0.1], [0.2], [-0.1]]
initial_state_lower = [-1, -1, -1]
initial_state_upper = [1, 1, 1]
disturbance_lower = [-1]
disturbance_upper = [1]
measurement_noise_bound = [0.01, 0.01]
"#;

const SAMPLE_TIME_S: f64 = 0.1;

pub(super) fn cases() -> Result<Vec<Case>> {
    let designed = design::<ReducedOrderObserverOptions>(TABLES, SAMPLE_TIME_S)?;
    let model = &designed.tables["model"];
    let inputs = Plant {
        a: matrix(&model["A"]),
        b: matrix(&model["B"]),
        c: matrix(&model["C"]),
        feedthrough: DMatrix::zeros(2, 1),
        d: matrix(&model["D"]),
        disturbance: vec![1.0],
        noise: vec![0.01; 2],
        command: vec![2.0],
        state: vec![0.5, -0.4, 0.3],
    }
    .run(500, 5);
    let problem = designed.problem(SAMPLE_TIME_S, &inputs);
    Ok(vec![Case {
        name: "reduced_order_observer",
        title: "reduced-order observers, 3 states, 2 outputs, detection and fault estimate".to_owned(),
        compared: designed.channels(&[""]),
        own: vec![("residuald".to_owned(), designed.diagnoser, 0.0)],
        peers: vec![(
            Program::Python {
                script: "reduced_order_observer",
                package: "numpy",
            },
            None,
        )],
        inputs,
        problem,
        tolerance: 1e-9,
    }])
}
