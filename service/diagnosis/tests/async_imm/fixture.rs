//! Designs, packets and runs from the reference files.

use crate::support::{integers, numbers, reference_of, rows};
use nalgebra::DMatrix;
use residual_diagnosis::async_imm::{
    decision::DecisionRule,
    design::{Form, ImmDesign, Mixing, Mode, ModeTransition, Prior, Sensor},
    estimator::{ImmEstimator, Sample},
    fusion::{AmplitudeEstimate, Fusion},
    inputs::InputHistory,
    plant::{LinearPlant, Plant},
    state::Posterior,
};
use serde_json::Value;

/// A reference file of the method.
pub fn file(name: &str) -> Value {
    reference_of("async_imm", name)
}

/// A matrix.
pub fn dense(value: &Value) -> DMatrix<f64> {
    let rows = rows(value);
    DMatrix::from_fn(rows.len(), rows[0].len(), |i, j| rows[i][j])
}

/// A matrix as the list of its entries by rows.
pub fn flat(matrix: &DMatrix<f64>) -> Vec<f64> {
    matrix.transpose().as_slice().to_vec()
}

/// The plant of a file.
pub fn plant(value: &Value) -> LinearPlant {
    let g = dense(&value["G"]);
    LinearPlant {
        a: dense(&value["A"]),
        b: dense(&value["B"]),
        f: dense(&value["F"]),
        noise: &g * dense(&value["process_noise_psd"]) * g.transpose(),
    }
}

fn sensor(value: &Value) -> Sensor {
    Sensor {
        name: value["name"].as_str().unwrap().to_owned(),
        measurement_matrix: dense(&value["measurement_matrix"]),
        noise_covariance: dense(&value["noise_covariance"]),
        arrival_probability: value["arrival_probability"].as_f64().unwrap(),
        initial_held_value: Some(numbers(&value["initial_held_value"])),
    }
}

/// The design of a scenario file in one of its cases.
pub fn design(file: &Value, case: &str) -> ImmDesign {
    let expected = &file["expected"][case];
    let initial = &file["initial"];
    let slots = numbers(&initial["amplitude"]).len();
    let modes = file["modes"].as_array().unwrap().iter().enumerate();
    let walk = &file["amplitude_random_walk_psd"];
    ImmDesign {
        plant: Plant::Constant(plant(&file["plant"])),
        sensors: file["sensors"].as_array().unwrap().iter().map(sensor).collect(),
        modes: modes
            .map(|(m, mode)| Mode {
                name: mode["name"].as_str().unwrap().to_owned(),
                direction: dense(&mode["direction"]),
                random_walk_psd: if walk.is_null() {
                    vec![0.0; slots]
                } else {
                    numbers(&walk[m])
                },
            })
            .collect(),
        prior: Prior {
            state: numbers(&initial["state"]),
            state_covariance: dense(&initial["state_covariance"]),
            amplitude: numbers(&initial["amplitude"]),
            amplitude_covariance: dense(&initial["amplitude_covariance"]),
            mode_probability: numbers(&initial["mode_probability"]),
        },
        transition: ModeTransition::PerStep(dense(&expected["mode_transition_matrix"])),
        form: match expected["update"].as_str() {
            Some("batch_unobserved") => Form::BatchUnobserved,
            _ => Form::Sequential,
        },
        mixing: match expected["amplitude_mixing"].as_str().unwrap() {
            "all" => Mixing::All,
            _ => Mixing::SharedChannel,
        },
    }
}

/// The decision rule of a case.
pub fn rule(file: &Value, case: &str) -> DecisionRule {
    let expected = &file["expected"][case];
    DecisionRule {
        threshold: expected["decision_threshold"].as_f64().unwrap_or(0.5),
        window_steps: expected["window_steps"].as_u64().unwrap_or(1) as u32,
    }
}

/// The input of a file.
pub fn inputs(file: &Value) -> InputHistory {
    let times = integers(&file["input"]["change_time_us"]);
    let values = rows(&file["input"]["value"]);
    let changes: Vec<_> = times.iter().map(|time| *time as i64 * 1000).zip(values).collect();
    InputHistory::with_changes(&vec![0.0; changes[0].1.len()], &changes)
}

/// One sample slot: time (µs), sensor, what was received (`None` = lost).
#[derive(Clone, Debug)]
pub struct Slot {
    pub time_us: i64,
    pub sensor: usize,
    pub value: Option<Vec<f64>>,
}

/// The sample slots of a file.
pub fn slots(file: &Value) -> Vec<Slot> {
    let packets = &file["packets"];
    let values = packets["value"].as_array().unwrap();
    let times = integers(&packets["time_us"]);
    let sensors = integers(&packets["sensor"]);
    let slot = |i: usize| Slot {
        time_us: times[i] as i64,
        sensor: sensors[i],
        value: (!values[i].is_null()).then(|| numbers(&values[i])),
    };
    (0..times.len()).map(slot).collect()
}

/// The fusion instants of a file, µs.
pub fn instants(file: &Value) -> Vec<i64> {
    integers(&file["fusion_time_us"])
        .into_iter()
        .map(|time| time as i64)
        .collect()
}

/// What one fusion instant gives.
pub struct Instant {
    pub probability: Vec<f64>,
    pub log_likelihood: Vec<f64>,
    pub mean: Vec<f64>,
    pub covariance: DMatrix<f64>,
    pub posterior: Posterior,
    pub mode_covariances: Vec<DMatrix<f64>>,
    pub declared: usize,
    pub detected: bool,
    pub amplitudes: Vec<AmplitudeEstimate>,
}

/// Runs a design over slots: the batch form sees every slot, with the held value where it is lost, the others
/// only what was received.
pub fn run(
    design: &ImmDesign,
    rule: DecisionRule,
    slots: &[Slot],
    instants: &[i64],
    inputs: &InputHistory,
) -> Vec<Instant> {
    let mut estimator = ImmEstimator::new(design, 256).unwrap();
    let mut fusion = Fusion::new(design);
    let mut posterior = estimator.start(0);
    let mut held = posterior.held.clone();
    let mut begin = 0;
    let mut out = Vec::new();
    for &end in instants {
        let in_interval = slots
            .iter()
            .filter(|slot| begin < slot.time_us && slot.time_us <= end);
        let mut values: Vec<(i64, usize, Vec<f64>)> = Vec::new();
        for slot in in_interval {
            match &slot.value {
                Some(value) => held[slot.sensor].clone_from(value),
                None if design.form != Form::BatchUnobserved => continue,
                None => {}
            }
            values.push((slot.time_us * 1000, slot.sensor, held[slot.sensor].clone()));
        }
        let samples = values.iter().map(|(time_ns, sensor, values)| Sample {
            time_ns: *time_ns,
            sensor: *sensor,
            values,
            held_before: None,
        });
        let report = estimator.advance(&mut posterior, end * 1000, samples, inputs);
        assert_eq!((report.used as usize, report.update_rejected), (values.len(), 0));
        let probability = fusion.read_probability(&posterior).to_vec();
        rule.update(&mut posterior.decision, &probability);
        let declared = rule.declared_mode(&posterior.decision);
        let (mean, covariance) = fusion.fuse(&posterior);
        let (mean, covariance) = (mean.to_vec(), covariance.to_dense());
        out.push(Instant {
            log_likelihood: estimator.log_likelihood().to_vec(),
            mean,
            covariance,
            mode_covariances: (0..design.modes.len())
                .map(|m| fusion.mode_covariance(&posterior, m).unwrap().to_dense())
                .collect(),
            amplitudes: fusion.read_amplitudes(&posterior, declared).to_vec(),
            probability,
            declared,
            detected: rule.fault_detected(&posterior.decision),
            posterior: posterior.clone(),
        });
        begin = end;
    }
    out
}
