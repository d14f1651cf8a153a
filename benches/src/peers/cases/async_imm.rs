//! Interacting multiple models: 3 modes, 3 sensors with 2 rows each, once at their own times, once all at the sampling
//! instant as a textbook estimator needs it.

use anyhow::{Result, anyhow};
use nalgebra::DVector;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use residual_diagnosis::async_imm::exact::discretise;
use residual_diagnosis::async_imm::options::AsyncImmTables;
use residual_diagnosis::async_imm::plant::LinearPlant;
use residual_diagnosis::covariance::semidefinite_factor;
use residual_diagnosis::diagnoser::{PacketHeader, PacketSource};
use serde_json::{Value, json};

use super::plant::matrix;
use super::{Case, Program, design};
use crate::peers::contender::Inputs;

/// The turning target: position and velocity in two axes, either actuator may have an offset.
const TABLES: &str = r#"
[plant]
A = [[0, 1, 0, 0], [0, 0, 0, -0.2], [0, 0, 0, 1], [0, 0.2, 0, 0]]
B = [[0, 0], [-1, 0], [0, 0], [0, 1]]
G = [[0, 0], [-1, 0], [0, 0], [0, 1]]
F = [[0, 0], [-1, 0], [0, 0], [0, 1]]
process_noise_psd = [[0.01, 0], [0, 0.01]]
[input]
constant = [0.5, 0.5]
[[sensor]]
name = "sensor 1"
measurement_matrix = [[1, 0, 0, 0], [0, 0, 1, 0]]
noise_covariance = [[25, 0], [0, 25]]
[[sensor]]
name = "sensor 2"
measurement_matrix = [[1, 0, 0, 0], [0, 0, 1, 0]]
noise_covariance = [[16, 0], [0, 16]]
[[sensor]]
name = "sensor 3"
measurement_matrix = [[1, 0, 0, 0], [0, 0, 1, 0]]
noise_covariance = [[9, 1], [1, 9]]
[[mode]]
name = "normal"
direction = [[0], [0]]
[[mode]]
name = "actuator 1"
direction = [[1], [0]]
[[mode]]
name = "actuator 2"
direction = [[0], [1]]
[transition]
kind = "per_step"
matrix = [[0.98, 0.01, 0.01], [0.01, 0.98, 0.01], [0.01, 0.01, 0.98]]
[initial]
state = [0, 5, 0, 5]
state_covariance = [[25, 0, 0, 0], [0, 4, 0, 0], [0, 0, 25, 0], [0, 0, 0, 4]]
mode_probability = [0.9, 0.05, 0.05]
[amplitude]
prior_standard_deviation = [2.0]
"#;

const PERIOD_NS: u64 = 1_000_000_000;
const STEPS: usize = 300;
/// The offset of actuator 2 begins at this instant.
const FAULT_FROM: usize = 150;

pub(super) fn cases() -> Result<Vec<Case>> {
    let numpy = Program::Python {
        script: "async_imm",
        package: "numpy",
    };
    let filterpy = Program::Python {
        script: "imm_filterpy",
        package: "filterpy",
    };
    Ok(vec![
        case(
            "async_imm",
            "asynchronous multiple models, 3 modes, 3 sensors with 2 rows at their own times",
            "mixing = \"shared_channel\"",
            [0.3, 0.7, 1.0],
            vec![(numpy, None)],
        )?,
        case(
            "synchronous_imm",
            "multiple models, 3 modes, 6 rows at the sampling instant",
            "mixing = \"all\"",
            [1.0; 3],
            vec![(filterpy, Some(100.0)), (numpy, None)],
        )?,
    ])
}

fn case(
    name: &'static str,
    title: &str,
    mixing: &str,
    moments: [f64; 3],
    peers: Vec<(Program, Option<f64>)>,
) -> Result<Case> {
    let designed = design::<AsyncImmTables>(&format!("{TABLES}{mixing}\n"), PERIOD_NS as f64 * 1e-9)?;
    let inputs = target(&designed.tables, moments)?;
    let mut problem = designed.problem(PERIOD_NS as f64 * 1e-9, &inputs);
    problem["moments"] = json!(moments);
    Ok(Case {
        name,
        title: title.to_owned(),
        compared: designed.channels(&["fault probability", "probability", "amplitude"]),
        own: vec![("residuald".to_owned(), designed.diagnoser, 0.0)],
        peers,
        inputs,
        problem,
        tolerance: 1e-9,
    })
}

/// The samples of the three sensors, each taken at its moment of the period, in (0, 1].
fn target(tables: &Value, moments: [f64; 3]) -> Result<Inputs> {
    let plant = &tables["plant"];
    let g = matrix(&plant["G"]);
    let model = LinearPlant {
        a: matrix(&plant["A"]),
        b: matrix(&plant["B"]),
        f: matrix(&plant["F"]),
        noise: &g * matrix(&plant["process_noise_psd"]) * g.transpose(),
    };
    let mut generator = ChaCha8Rng::seed_from_u64(2);
    // Uniform with variance 1.
    let mut draw = || generator.random_range(-1.0..=1.0_f64) * 3.0_f64.sqrt();
    let mut x = DVector::from_column_slice(&[0.0, 5.0, 0.0, 5.0]);
    let mut inputs = Inputs::default();
    for k in 0..STEPS {
        let instant_ns = (k as u64 + 1) * PERIOD_NS;
        let offset = if k >= FAULT_FROM { 2.0 } else { 0.0 };
        let entering = DVector::from_column_slice(&[0.5, 0.5, 0.0, offset]);
        let (mut last, mut headers, mut values) = (0.0, Vec::new(), Vec::new());
        for (sensor, moment) in moments.into_iter().enumerate() {
            if moment > last {
                let interval = discretise(&model, moment - last);
                let noise = semidefinite_factor(&interval.omega.to_dense())
                    .map_err(|error| anyhow!("the process noise: {error:?}"))?;
                let drawn = DVector::from_fn(4, |_, _| draw());
                x = interval.phi.to_dense() * x + interval.gain.to_dense() * &entering + noise * drawn;
                last = moment;
            }
            headers.push(PacketHeader {
                source: PacketSource::Sensor(sensor),
                sequence: k as u64,
                time_ns: instant_ns - ((1.0 - moment) * PERIOD_NS as f64) as u64,
                start: values.len(),
                length: 2,
            });
            let deviation = [5.0, 4.0, 3.0][sensor];
            values.extend([x[0] + deviation * draw(), x[2] + deviation * draw()]);
        }
        inputs.measurements.push(values.clone());
        inputs.commands.push(vec![0.5, 0.5]);
        inputs.packets.push((headers, values));
        inputs.instants_ns.push(instant_ns);
    }
    Ok(inputs)
}
