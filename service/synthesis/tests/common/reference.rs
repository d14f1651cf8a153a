//! The reference files and their plants.

use residual_diagnosis::model::{LinearModel, ModelOptions};
use residual_diagnosis::unknown_input_filter::modes::FaultMode;
use serde_json::Value;
use std::path::PathBuf;

/// A reference file: beside the workspace, or else the copy in the diagnosis crate.
pub fn reference(name: &str) -> Value {
    let workspace = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..");
    let places = [
        "../shared/reference/unknown_input_filter",
        "service/diagnosis/tests/reference/unknown_input_filter",
    ];
    let path = places
        .map(|place| workspace.join(place).join(name))
        .into_iter()
        .find(|path| path.exists());
    serde_json::from_str(&std::fs::read_to_string(path.unwrap()).unwrap()).unwrap()
}

pub fn list<T: serde::de::DeserializeOwned>(value: &Value) -> Vec<T> {
    serde_json::from_value(value.clone()).unwrap()
}

/// The model in the notation of the reference files.
pub fn plant(model: &Value) -> LinearModel {
    let options = ModelOptions {
        a: list(&model["A0"]),
        b: list(&model["B"]),
        c: list(&model["C"]),
        d: list(&model["D"]),
        a_uncertainty: list(&model["A_plus"]),
        disturbance_bound: list(&model["disturbance_bound"]),
        measurement_noise_bound: list(&model["noise_bound"]),
        ..ModelOptions::default()
    };
    LinearModel::new(&options, 1.0).unwrap()
}

pub fn aircraft() -> LinearModel {
    plant(&reference("vtol_design.json")["model"])
}

pub fn mode(value: &Value) -> FaultMode {
    serde_json::from_value(value.clone()).unwrap()
}
