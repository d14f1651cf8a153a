//! `residuald design --plot` draws what there is to draw, and never instead of the gains.

use crate::common::repository;
use std::path::Path;
use std::process::{Command, Output};

fn design(example: &str, gains: &Path, plots: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_residuald"))
        .arg("design")
        .arg(repository("deploy/config").join(example))
        .arg("-o")
        .arg(gains)
        .arg("--plot")
        .arg(plots)
        .output()
        .unwrap()
}

#[test]
fn an_observer_and_a_filter_are_drawn_over_frequency_time_and_delay() {
    let directory = tempfile::tempdir().unwrap();
    for (example, diagnoser) in [
        ("servo.toml", "servo_actuator"),
        ("two_state.toml", "two_state_plant"),
    ] {
        let output = design(example, &directory.path().join("gains.toml"), directory.path());
        assert!(output.status.success(), "{output:?}");
        for kind in ["frequency", "bounds", "detection"] {
            let path = directory.path().join(format!("{diagnoser}.{kind}.svg"));
            let svg = std::fs::read_to_string(&path).unwrap();
            assert!(
                svg.starts_with("<svg") && svg.contains("polyline"),
                "{}",
                path.display()
            );
            assert!(String::from_utf8_lossy(&output.stderr).contains(&*path.to_string_lossy()));
        }
    }
}

#[test]
fn a_directory_that_cannot_be_made_fails_after_the_gains_were_written() {
    let directory = tempfile::tempdir().unwrap();
    let (gains, occupied) = (directory.path().join("gains.toml"), directory.path().join("file"));
    std::fs::write(&occupied, "").unwrap();
    let output = design("servo.toml", &gains, &occupied);
    assert_eq!(output.status.code(), Some(1));
    let messages = String::from_utf8_lossy(&output.stderr).replace("│", "");
    let words: Vec<_> = messages.split_whitespace().collect();
    assert!(words.join(" ").contains("choose another directory"), "{messages}");
    assert!(gains.exists());
}
