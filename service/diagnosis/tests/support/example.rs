//! The diagnosers of an example configuration, as their methods read them.

use std::{fs, path::PathBuf};

/// Keys of a diagnoser's table that belong to every method.
const COMMON: [&str; 9] = [
    "name",
    "method",
    "sample_time_s",
    "phase_s",
    "margin_s",
    "priority",
    "measurements",
    "commands",
    "command_delay_steps",
];

/// One diagnoser of an example.
pub struct Example {
    /// The tables of its method.
    pub tables: toml::Table,
    /// Its sampling period, s.
    pub sample_time_s: f64,
    /// How many measurements and commands it takes.
    pub signal_counts: (usize, usize),
}

/// The diagnosers of the example `name`, which all run `method`.
pub fn examples(name: &str, method: &str) -> Vec<Example> {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../deploy/config");
    let file: toml::Table = fs::read_to_string(folder.join(name)).unwrap().parse().unwrap();
    let example = |diagnoser: &toml::Value| {
        let mut tables = diagnoser.as_table().unwrap().clone();
        assert_eq!(tables["method"].as_str(), Some(method));
        let length = |key: &str| tables.get(key).map_or(0, |list| list.as_array().unwrap().len());
        let signal_counts = (length("measurements"), length("commands"));
        let sample_time_s = tables["sample_time_s"].as_float().unwrap();
        tables.retain(|key, _| !COMMON.contains(&key));
        Example {
            tables,
            sample_time_s,
            signal_counts,
        }
    };
    let examples: Vec<_> = file["diagnoser"]
        .as_array()
        .unwrap()
        .iter()
        .map(example)
        .collect();
    assert!(!examples.is_empty());
    examples
}
