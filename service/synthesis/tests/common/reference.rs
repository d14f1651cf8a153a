//! The reference files and their plants.

use residual_diagnosis::model::{LinearModel, ModelOptions};
use residual_diagnosis::unknown_input_filter::modes::FaultMode;
use serde_json::Value;

#[path = "files.rs"]
mod files;
pub use files::{list, reference_of};

/// A reference file of the unknown input filter.
pub fn reference(name: &str) -> Value {
    reference_of("unknown_input_filter", name)
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
