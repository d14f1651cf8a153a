//! The example configurations are right and do what they say.

use residual_diagnosis::{chi_square::ChiSquareOptions, method::MethodOptions};
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

/// The method's tables of every diagnoser of an example, with its names of measurements and commands.
fn diagnosers(name: &str) -> Vec<(ChiSquareOptions, [usize; 2])> {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../deploy/config");
    let file: toml::Table = fs::read_to_string(folder.join(name)).unwrap().parse().unwrap();
    let tables = file["diagnoser"].as_array().unwrap().iter();
    tables
        .map(|table| {
            let mut table = table.as_table().unwrap().clone();
            assert_eq!(table["method"].as_str(), Some("chi_square"));
            let length = |key: &str| table.get(key).map_or(0, |list| list.as_array().unwrap().len());
            let counts = [length("measurements"), length("commands")];
            COMMON.iter().for_each(|key| {
                table.remove(*key);
            });
            (table.try_into().unwrap(), counts)
        })
        .collect()
}

#[test]
fn every_example_designs_without_a_warning() {
    for name in ["vehicle.toml", "scalar.toml"] {
        for (mut options, [measurements, commands]) in diagnosers(name) {
            assert_eq!(options.signal_counts(), (measurements, commands));
            let signal = |i: usize| (format!("signal_{i}"), "unit".to_owned());
            let names: Vec<_> = (0..measurements).map(signal).collect();
            options.name_signals(&names, &[]);
            let designed = options.design(0.1).unwrap();
            println!("{name}: {:#?}", designed.notes);
            assert!(designed.warnings.is_empty(), "{name}: {:#?}", designed.warnings);
            assert_eq!(designed.diagnoser.description().faults.len(), measurements);
        }
    }
}
