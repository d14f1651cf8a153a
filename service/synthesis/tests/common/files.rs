//! The reference files.

use serde_json::Value;
use std::path::PathBuf;

/// A reference file of a method: beside the workspace, or else the copy in the diagnosis crate.
pub fn reference_of(method: &str, name: &str) -> Value {
    let workspace = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..");
    let path = ["../shared/reference", "service/diagnosis/tests/reference"]
        .map(|place| workspace.join(place).join(method).join(name))
        .into_iter()
        .find(|path| path.exists());
    serde_json::from_str(&std::fs::read_to_string(path.unwrap()).unwrap()).unwrap()
}

pub fn list<T: serde::de::DeserializeOwned>(value: &Value) -> Vec<T> {
    serde_json::from_value(value.clone()).unwrap()
}
