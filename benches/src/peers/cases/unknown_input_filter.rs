//! Zonotopic filters: one with a fixed gain (4 states, 3 outputs, 40 generators, one unknown input), and the aircraft's
//! bank of three with row-wise gains.

use anyhow::Result;
use nalgebra::DMatrix;
use residual_diagnosis::diagnoser::Diagnoser;
use residual_diagnosis::unknown_input_filter::tables::UnknownInputFilterTables;
use serde_json::{Value, json};

use super::plant::{Plant, matrix};
use super::{Case, Program, design};

/// Four thermal masses in a row; the heater at the first one may fail.
const TABLES: &str = r#"
[model]
A = [[0.90, 0.06, 0, 0], [0.06, 0.86, 0.06, 0], [0, 0.06, 0.86, 0.06], [0, 0, 0.06, 0.90]]
B = [[0.05], [0.01], [0], [0]]
C = [[1, 0.2, 0, 0], [0, 0.3, 1, 0], [0.3, 0, 0, 1]]
D = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
A_uncertainty = [[0.002, 0, 0, 0], [0, 0.002, 0, 0], [0, 0, 0.002, 0], [0, 0, 0, 0.002]]
disturbance_bound = [0.01, 0.01, 0.01, 0.01]
measurement_noise_bound = [0.02, 0.02, 0.02]
initial_state_center = [0, 0, 0, 0]
initial_state_radius = [1, 1, 1, 1]
[bank]
fault_free_mode = false
[missing]
fault_bound = [3]
[parity]
lengths = []
[filter]
gain = "fixed"
initialisation = "prior"
generator_order = 40
"#;

const SAMPLE_TIME_S: f64 = 0.1;

pub(super) fn cases() -> Result<Vec<Case>> {
    Ok(vec![fixed()?, bank()?])
}

fn fixed() -> Result<Case> {
    let outward = design::<UnknownInputFilterTables>(TABLES, SAMPLE_TIME_S)?;
    let plain = format!("{TABLES}outward_rounding = false\n");
    let designed = design::<UnknownInputFilterTables>(&plain, SAMPLE_TIME_S)?;
    let model = &designed.tables["model"];
    let inputs = Plant {
        a: matrix(&model["A"]),
        b: matrix(&model["B"]),
        c: matrix(&model["C"]),
        feedthrough: DMatrix::zeros(3, 1),
        d: matrix(&model["D"]),
        disturbance: vec![0.01; 4],
        noise: vec![0.02; 3],
        command: vec![1.0],
        state: vec![0.5, -0.3, 0.2, 0.8],
    }
    .run(500, 1);
    let mut problem = designed.problem(SAMPLE_TIME_S, &inputs);
    problem["plain"] = plain_lists(&designed.tables, &designed.gains);
    let aim = Some(1.0);
    Ok(Case {
        name: "unknown_input_filter",
        title: "zonotopic filter, 4 states, 40 generators, fixed gain".to_owned(),
        compared: designed.channels(&["mode_0_output", "mode_0_fault_estimate"]),
        own: own(designed.diagnoser, outward.diagnoser),
        peers: vec![
            (
                Program::Python {
                    script: "unknown_input_filter",
                    package: "numpy",
                },
                Some(100.0),
            ),
            (
                Program::Eigen {
                    source: "unknown_input_filter",
                    native: false,
                },
                aim,
            ),
            (
                Program::Eigen {
                    source: "unknown_input_filter",
                    native: true,
                },
                aim,
            ),
        ],
        inputs,
        problem,
        tolerance: 1e-9,
    })
}

/// The vertical take-off aircraft: the fault-free filter and one for each actuator.
const AIRCRAFT: &str = r#"
[model]
A = [[0.9996, 0.0003, 0.0002, -0.0046], [0.0005, 0.9899, 0.0, -0.0402], [0.0010, 0.0007, 0.9929, 0.0012], [0, 0, 0.01, 1]]
B = [[0.0044, 0.0018], [0.0198, -0.0759], [-0.0552, 0.0449], [0, 0]]
C = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 1, 1, 1]]
D = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
A_uncertainty = [[0.01, 0, 0, 0], [0, 0.01, 0, 0], [0, 0, 0.01, 0], [0, 0, 0, 0]]
disturbance_bound = [0.01, 0.01, 0.01, 0.01]
measurement_noise_bound = [0.01, 0.01, 0.01, 0.01]
initial_state_center = [0, 0, 0, 0]
initial_state_radius = [1, 1, 1, 1]
[missing]
fault_bound = [3, 3]
[parity]
lengths = []
[filter]
gain = "row_wise"
initialisation = "prior"
generator_order = 30
"#;

fn bank() -> Result<Case> {
    let outward = design::<UnknownInputFilterTables>(AIRCRAFT, SAMPLE_TIME_S)?;
    let plain = format!("{AIRCRAFT}outward_rounding = false\n");
    let designed = design::<UnknownInputFilterTables>(&plain, SAMPLE_TIME_S)?;
    let model = &designed.tables["model"];
    let inputs = Plant {
        a: matrix(&model["A"]),
        b: matrix(&model["B"]),
        c: matrix(&model["C"]),
        feedthrough: DMatrix::zeros(4, 2),
        d: matrix(&model["D"]),
        disturbance: vec![0.01; 4],
        noise: vec![0.01; 4],
        command: vec![0.5, -0.2],
        state: vec![0.5, -0.3, 0.2, 0.1],
    }
    .run(300, 7);
    Ok(Case {
        name: "unknown_input_bank",
        title: "bank of 3 zonotopic filters, 4 states, 30 generators, row-wise gains".to_owned(),
        compared: designed.channels(&["mode_"]),
        own: own(designed.diagnoser.boxed_clone(), outward.diagnoser),
        peers: vec![(
            Program::Python {
                script: "unknown_input_bank",
                package: "numpy",
            },
            None,
        )],
        problem: designed.problem(SAMPLE_TIME_S, &inputs),
        inputs,
        tolerance: 1e-9,
    })
}

/// Ours without outward rounding, which does the same additions as the peers, and as configured by default. Until the
/// first reduction the set of the latter has one box more, which stays felt for a while (method sheet 6).
fn own(plain: Box<dyn Diagnoser>, outward: Box<dyn Diagnoser>) -> Vec<(String, Box<dyn Diagnoser>, f64)> {
    vec![
        ("residuald, without outward rounding".to_owned(), plain, 0.0),
        ("residuald, as configured by default".to_owned(), outward, 1e-4),
    ]
}

/// Model and gain as named matrices; lists as one row.
fn plain_lists(tables: &Value, gains: &Value) -> Value {
    let model = &tables["model"];
    let row = |list: &Value| json!([list]);
    json!({
        "A": model["A"], "B": model["B"], "C": model["C"], "A_uncertainty": model["A_uncertainty"],
        "disturbance": row(&model["disturbance_bound"]), "noise": row(&model["measurement_noise_bound"]),
        "centre": row(&model["initial_state_center"]), "radius": row(&model["initial_state_radius"]),
        "L_fix": gains["mode"][0]["L_fix"],
    })
}
