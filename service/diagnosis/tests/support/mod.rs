//! Reference data and small runners shared by the tests of the diagnosis methods.
#![allow(dead_code)]

pub mod example;

use std::{fs, path::PathBuf};

use residual_diagnosis::{
    diagnoser::{Channel, Diagnoser, StepInput, StepRecord, flags},
    model::{LinearModel, ModelOptions},
    unknown_input_filter::{
        UnknownInputFilterBank, certificate::ParityCertificate, options::UnknownInputFilterOptions,
    },
};
use serde_json::Value;

/// A reference file of the method `unknown_input_filter`.
pub fn reference(name: &str) -> Value {
    reference_of("unknown_input_filter", name)
}

/// A reference file of a method: beside the workspace, or the copy in the tests.
pub fn reference_of(method: &str, name: &str) -> Value {
    let package = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
    let folders = ["../../../shared/reference", "tests/reference"];
    let path = folders
        .iter()
        .map(|folder| package.join(folder).join(method).join(name))
        .find(|path| path.exists())
        .unwrap();
    serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

/// Numbers of a JSON value of any depth in order; null is NaN.
pub fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(items) => items.iter().flat_map(numbers).collect(),
        Value::Null => vec![f64::NAN],
        other => vec![other.as_f64().unwrap()],
    }
}

/// A list of lists.
pub fn rows(value: &Value) -> Vec<Vec<f64>> {
    value.as_array().unwrap().iter().map(numbers).collect()
}

/// The integers of a list.
pub fn integers(value: &Value) -> Vec<usize> {
    value
        .as_array()
        .unwrap()
        .iter()
        .map(|item| item.as_u64().unwrap() as usize)
        .collect()
}

/// Options of the model of a reference file with the start set ⟨p0, H0⟩ (H0 diagonal).
pub fn model_options(file: &Value) -> ModelOptions {
    let model = &file["model"];
    let radius = rows(&file["H0"])
        .iter()
        .enumerate()
        .map(|(i, row)| row[i])
        .collect();
    ModelOptions {
        a: rows(&model["A0"]),
        b: rows(&model["B"]),
        c: rows(&model["C"]),
        d: rows(&model["D"]),
        a_uncertainty: rows(&model["A_plus"]),
        disturbance_bound: numbers(&model["disturbance_bound"]),
        measurement_noise_bound: numbers(&model["noise_bound"]),
        initial_state_center: Some(numbers(&file["p0"])),
        initial_state_radius: Some(radius),
        ..ModelOptions::default()
    }
}

/// The model of the aircraft example.
pub fn vtol() -> ModelOptions {
    model_options(&reference("vtol_design.json"))
}

/// The model of the battery loop.
pub fn battery() -> ModelOptions {
    model_options(&reference("battery_bank.json"))
}

/// The certificates of a reference file.
pub fn certificates(file: &Value) -> Vec<ParityCertificate> {
    let entries = file["certificates"].as_array().unwrap().iter();
    entries
        .map(|entry| ParityCertificate {
            mode: serde_json::from_value(entry["mode"].clone()).unwrap(),
            fault: entry["fault"].as_u64().unwrap() as usize,
            length: entry["L"].as_u64().unwrap() as usize,
            mu: rows(&entry["mu"]),
            lambda: rows(&entry["lambda"]),
        })
        .collect()
}

/// Options from TOML text.
pub fn options(text: &str) -> UnknownInputFilterOptions {
    toml::from_str(text).unwrap()
}

/// A bank of this model.
pub fn bank(model: &ModelOptions, options: &UnknownInputFilterOptions) -> UnknownInputFilterBank {
    let model = LinearModel::new(model, 0.01).unwrap();
    UnknownInputFilterBank::new(model, options).unwrap()
}

/// One step of a bank.
pub fn step(bank: &mut UnknownInputFilterBank, y: &[f64], u: &[f64]) -> StepRecord {
    let mut record = StepRecord::new(bank.description().channels.len());
    bank.step(&StepInput::new(y, u), &mut record);
    record
}

/// The channel with this name.
pub fn channel(bank: &UnknownInputFilterBank, record: &StepRecord, name: &str) -> Channel {
    channel_of(bank, record, name)
}

/// The channel of any diagnoser with this name.
pub fn channel_of(diagnoser: &dyn Diagnoser, record: &StepRecord, name: &str) -> Channel {
    let position = diagnoser
        .description()
        .channels
        .iter()
        .position(|channel| channel.name == name);
    record.channels()[position.unwrap_or_else(|| panic!("no channel {name}"))]
}

/// Residual and half width of a channel; zeros when it was not evaluated.
pub fn residual_and_width(bank: &UnknownInputFilterBank, record: &StepRecord, name: &str) -> (f64, f64) {
    let channel = channel(bank, record, name);
    (channel.residual, channel.upper)
}

/// Channels of a prefix (without estimates and floors) that alarm, in order of their position.
pub fn alarming_channels<'a>(
    bank: &'a UnknownInputFilterBank,
    record: &StepRecord,
    prefix: &str,
) -> Vec<&'a str> {
    let channels = bank.description().channels.iter().zip(record.channels());
    channels
        .filter(|(description, channel)| description.name.starts_with(prefix) && channel.ratio > 1.0)
        .map(|(description, _)| description.name.as_str())
        .collect()
}

/// Whether a test alarmed at the instant of this record.
pub fn alarm_now(record: &StepRecord) -> bool {
    record.flags & flags::ALARM_NOW != 0
}

/// Fails unless both agree to `tolerance` times the largest expected entry; NaN entries must agree.
pub fn assert_close(what: &str, actual: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(actual.len(), expected.len(), "{what}");
    let scale = expected
        .iter()
        .filter(|value| value.is_finite())
        .fold(0.0_f64, |most, value| most.max(value.abs()));
    for (i, (a, e)) in actual.iter().zip(expected).enumerate() {
        let equal = a == e || (a.is_nan() && e.is_nan()) || (a - e).abs() <= tolerance * scale;
        assert!(
            equal,
            "{what}[{i}]: {a:e} instead of {e:e}, off by {:e} of {scale:e}",
            a - e
        );
    }
}
