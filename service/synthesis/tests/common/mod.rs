//! Where the reference files are, and the models in them.

use residual_diagnosis::model::{LinearModel, ModelOptions};
use serde_json::Value;
use std::path::PathBuf;

/// The workspace root.
pub fn workspace() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// A reference file: beside the workspace, or else the copy in the diagnosis crate.
pub fn reference(name: &str) -> Value {
    let places = ["../shared/reference/unknown_input_filter", "service/diagnosis/tests/reference/unknown_input_filter"];
    let path = places.map(|place| workspace().join(place).join(name)).into_iter().find(|path| path.exists());
    serde_json::from_str(&std::fs::read_to_string(path.unwrap()).unwrap()).unwrap()
}

/// A list of lists of numbers.
pub fn rows(value: &Value) -> Vec<Vec<f64>> {
    serde_json::from_value(value.clone()).unwrap()
}

/// A list of numbers.
pub fn list(value: &Value) -> Vec<f64> {
    serde_json::from_value(value.clone()).unwrap()
}

/// The model of `vtol_design.json`.
pub fn aircraft() -> LinearModel {
    let file = reference("vtol_design.json");
    let model = &file["model"];
    let options = ModelOptions {
        a: rows(&model["A0"]),
        b: rows(&model["B"]),
        c: rows(&model["C"]),
        d: rows(&model["D"]),
        a_uncertainty: rows(&model["A_plus"]),
        disturbance_bound: list(&model["disturbance_bound"]),
        measurement_noise_bound: list(&model["noise_bound"]),
        ..ModelOptions::default()
    };
    LinearModel::new(&options, file["sample_time_s"].as_f64().unwrap()).unwrap()
}
