//! The robust fault detection filter: 2 states, 2 outputs, 3 disturbances, window of 100 samples.

use anyhow::Result;
use residual_diagnosis::hinf_filter::options::HinfFilterOptions;
use residual_diagnosis::hinf_filter::plant::zoh;

use super::plant::{Plant, matrix};
use super::{Case, Program, design};

const TABLES: &str = r#"
[model]
A = [[-3.370, 1.636], [-0.325, -1.896]]
B = [[0.5], [0.4]]
C = [[1, 0], [0, 1]]
D = [[0], [0.267]]
Bd = [[0.1, 0, 0], [0.1, 0, 0]]
Dd = [[0, 0.02, 0], [0, 0, 0.02]]
Bf = [[0.5, 0], [0.4, 0]]
Df = [[0, 1], [0, 0]]
[disturbance]
amplitude = [1, 1, 1]
[evaluation]
window = 5.0
"#;

const SAMPLE_TIME_S: f64 = 0.05;

pub(super) fn cases() -> Result<Vec<Case>> {
    let designed = design::<HinfFilterOptions>(TABLES, SAMPLE_TIME_S)?;
    let model = &designed.tables["model"];
    let sampled = |name: &str| zoh(&matrix(&model["A"]), &matrix(&model[name]), SAMPLE_TIME_S);
    let (a, b) = sampled("B");
    let inputs = Plant {
        a,
        b,
        c: matrix(&model["C"]),
        feedthrough: matrix(&model["D"]),
        // The first disturbance; the others are the noise of the outputs.
        d: sampled("Bd").1.columns(0, 1).into_owned(),
        disturbance: vec![1.0],
        noise: vec![0.02; 2],
        command: vec![0.5],
        state: vec![0.3, -0.2],
    }
    .run(500, 6);
    let problem = designed.problem(SAMPLE_TIME_S, &inputs);
    Ok(vec![Case {
        name: "hinf_filter",
        title: "fault detection filter, 2 states, 2 outputs, window of 100 samples".to_owned(),
        compared: designed.channels(&[""]),
        own: vec![("residuald".to_owned(), designed.diagnoser, 0.0)],
        peers: vec![(
            Program::Python {
                script: "hinf_filter",
                package: "numpy",
            },
            None,
        )],
        inputs,
        problem,
        tolerance: 1e-9,
    }])
}
