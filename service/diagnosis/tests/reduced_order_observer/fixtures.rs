//! Plants, options and runners that the tests of this method share.

use crate::support::{reference_of, rows};
use nalgebra::{DMatrix, DVector};
use residual_diagnosis::{
    diagnoser::{Channel, Diagnoser, StepInput, StepRecord},
    reduced_order_observer::{
        design::Design,
        observer::{Decoupled, Observer},
        options::{Gains, ModelOptions, ObserverM, ReducedOrderObserverOptions},
        plant::Plant,
        reach::Reach,
    },
};
use serde_json::Value;

/// A reference file of this method.
pub fn file(name: &str) -> Value {
    reference_of("reduced_order_observer", name)
}

/// A, B, C, D of a `plant` entry; boxes are still missing.
pub fn matrices(plant: &Value) -> ModelOptions {
    ModelOptions {
        a: rows(&plant["A"]),
        b: rows(&plant["B"]),
        c: rows(&plant["C"]),
        d: rows(&plant["D"]),
        ..ModelOptions::default()
    }
}

/// The model with x(0) in a box of this half width, |η| <= `disturbance`, |v| <= `noise`.
pub fn bounded(mut model: ModelOptions, state: f64, disturbance: f64, noise: f64) -> ModelOptions {
    let (n, q, p) = (model.a.len(), model.d[0].len(), model.c.len());
    model.initial_state_lower = vec![-state; n];
    model.initial_state_upper = vec![state; n];
    model.disturbance_lower = vec![-disturbance; q];
    model.disturbance_upper = vec![disturbance; q];
    model.measurement_noise_bound = vec![noise; p];
    model
}

/// The paper's plant with the paper's boxes.
pub fn servo(noise: f64) -> ReducedOrderObserverOptions {
    ReducedOrderObserverOptions {
        model: bounded(matrices(&file("design.json")["plant"]), 1.0, 1.0, noise),
        ..ReducedOrderObserverOptions::default()
    }
}

/// One of the other plants of `design.json`.
pub fn other_plant(name: &str, noise: f64) -> ReducedOrderObserverOptions {
    let design = file("design.json");
    let plants = design["other_plants"].as_array().unwrap();
    let plant = plants.iter().find(|plant| plant["name"] == name).unwrap();
    let disturbance = plant["disturbance_abs"].as_f64().unwrap();
    ReducedOrderObserverOptions {
        model: bounded(matrices(plant), 1.0, disturbance, noise),
        ..ReducedOrderObserverOptions::default()
    }
}

/// The same options with these gains.
pub fn given(
    mut options: ReducedOrderObserverOptions,
    k: &[Vec<f64>],
    m: &[Vec<f64>],
) -> ReducedOrderObserverOptions {
    options.design.gains = Gains::Given;
    options.design.spectral_radius_max = 0.999;
    options.design.k = Some(k.to_vec());
    options.design.observer_m = ObserverM::Matrix(m.to_vec());
    options
}

/// Rows of a JSON value as a matrix.
pub fn dense(value: &Value) -> DMatrix<f64> {
    let rows = rows(value);
    DMatrix::from_fn(rows.len(), rows[0].len(), |i, j| rows[i][j])
}

/// An observer of a plant with these gains and its reach; all disturbances decoupled.
pub fn observer(plant: &Plant, k: DMatrix<f64>, m: DMatrix<f64>) -> (Observer, Reach) {
    let decoupled = Decoupled {
        disturbances: true,
        actuator: None,
    };
    let observer = Observer::new(plant, k, m, decoupled);
    let reach = Reach::new(plant, &observer).unwrap();
    (observer, reach)
}

/// The numbers of a vector.
pub fn list(vector: &DVector<f64>) -> Vec<f64> {
    vector.as_slice().to_vec()
}

/// The numbers of a matrix row by row.
pub fn row_major(matrix: &DMatrix<f64>) -> Vec<f64> {
    matrix.transpose().as_slice().to_vec()
}

/// One step.
pub fn step(diagnoser: &mut dyn Diagnoser, y: &[f64], u: &[f64]) -> StepRecord {
    let mut record = StepRecord::new(diagnoser.description().channels.len());
    diagnoser.step(&StepInput::new(y, u), &mut record);
    record
}

/// The channel with this name.
pub fn channel(diagnoser: &dyn Diagnoser, record: &StepRecord, name: &str) -> Channel {
    let channels = &diagnoser.description().channels;
    let place = channels.iter().position(|channel| channel.name == name);
    record.channels()[place.unwrap_or_else(|| panic!("no channel {name} in {channels:?}"))]
}

/// The design of options that are accepted.
pub fn design(options: &ReducedOrderObserverOptions) -> Design {
    Design::new(options).unwrap()
}
