//! The gains files of the examples belong to the examples, hold, and are what `design` finds.

use crate::common::repository;
use residual_diagnosis::gains::file::GainsFile;
use residuald::configuration::{Configuration, Loaded};
use std::path::PathBuf;

/// How far figures of a design that is repeated may lie from those of the file, relative: another processor rounds
/// differently, and a solver's last steps follow.
const REPEATED: f64 = 1e-3;

/// The example configurations with their names.
fn examples() -> Vec<(String, Loaded)> {
    let entries = std::fs::read_dir(repository("deploy/config")).unwrap();
    let paths = entries.map(|entry| entry.unwrap().path());
    let is_configuration = |path: &PathBuf| {
        let name = path.file_name().unwrap().to_string_lossy();
        name.ends_with(".toml") && !name.ends_with(".gains.toml")
    };
    let examples: Vec<_> = paths
        .filter(is_configuration)
        .map(|path| {
            let name = path.file_stem().unwrap().to_string_lossy().into_owned();
            (name, Configuration::from_file(&path).unwrap())
        })
        .collect();
    assert!(examples.len() >= 9, "{}", examples.len());
    examples
}

#[test]
fn every_example_runs_on_a_gains_file_of_its_own_that_holds() {
    for (name, loaded) in examples() {
        let expected = repository("deploy/config").join(format!("{name}.gains.toml"));
        assert_eq!(loaded.configuration.daemon.gains_file, Some(expected), "{name}");
        if let Err(error) = loaded.build_diagnosers() {
            panic!(
                "{name}: {error}: {:?}; see \"Gains\" in deploy/config/README.md",
                error.mistakes()
            );
        }
    }
}

#[test]
fn every_example_is_designed_again_to_the_same_figures() {
    for (name, loaded) in examples() {
        let text = std::fs::read_to_string(loaded.configuration.daemon.gains_file.as_ref().unwrap()).unwrap();
        assert!(
            text.contains(&format!("# Made by: residuald design {name}.toml\n")),
            "{name}"
        );
        let file = GainsFile::parse(&text).unwrap();
        let again = loaded.design(&mut |_, _| ()).unwrap();
        for (stated, designed) in file.diagnoser.iter().zip(&again.diagnosers) {
            if let Err(error) = stated.verify(&designed.achieved, REPEATED) {
                panic!("{name}: {error}");
            }
        }
        let names = |entries: &[residual_diagnosis::gains::file::Entry]| {
            entries.iter().map(|entry| entry.name.clone()).collect::<Vec<_>>()
        };
        assert_eq!(names(&file.diagnoser), names(&again.entries), "{name}");
    }
}
