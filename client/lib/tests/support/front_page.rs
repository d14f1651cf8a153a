//! The programs that the project's front page shows.

use std::fs;
use std::process::Command;

use residual_client::{Channel, Instance, RUNTIME_DIRECTORY_VARIABLE, StepRecord, Verdict, monotonic_ns};

use super::support::{daemon, spec, transition};

/// The front page's program in a language.
pub fn program(language: &str) -> String {
    let page = fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../../README.md")).unwrap();
    let (_, rest) = page.split_once(&format!("\n```{language}\n")).unwrap();
    rest.split_once("\n```").unwrap().0.into()
}

/// What the program prints about a daemon with one record and two alarms.
pub fn run(program: &mut Command) -> String {
    let directory = tempfile::Builder::new()
        .prefix("residuald-test-")
        .tempdir_in("/dev/shm")
        .unwrap();
    let instance = Instance::new("vehicle".parse().unwrap(), directory.path());
    let mut spec = spec(&["steering"], 16);
    spec.instance = "vehicle".into();
    let mut writer = daemon(&instance, &spec);
    let mut record = StepRecord::new(2);
    record.verdict = Verdict::Nominal as u32;
    record.instant_ns = monotonic_ns() + 3_600_000_000_000;
    record.channels_mut()[0] = Channel::two_sided(0.25, 1.0);
    writer.publish(0, &record);
    (1..=2).for_each(|step| _ = writer.raise(&transition(0, step)));
    let output = program
        .env(RUNTIME_DIRECTORY_VARIABLE, directory.path())
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    String::from_utf8(output.stdout).unwrap()
}
