//! The figures that the README states for the recorded car. The recording is not part of the project: without it
//! the tests say so and pass.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::path::{Path, PathBuf};
use std::process::Command;

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// The recording, or none with a note.
fn recording() -> Option<PathBuf> {
    let folder =
        std::env::var_os("RESIDUALD_RECORDINGS").map_or_else(|| root().join("../shared/data"), PathBuf::from);
    let path = folder.join("f1tenth.csv");
    if !path.exists() {
        println!(
            "SKIPPED: there is no {}; name its folder in RESIDUALD_RECORDINGS",
            path.display()
        );
        return None;
    }
    Some(path)
}

fn replay(recording: &Path, options: &[&str]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_residuald"))
        .arg("replay")
        .arg(root().join("deploy/config/f1tenth.toml"))
        .arg(recording)
        .args(["--totals"])
        .args(options)
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn fault_free_runs_give_no_alarm_and_the_same_records_each_time() {
    let Some(recording) = recording() else { return };
    let directory = tempfile::tempdir().unwrap();
    let records = |name: &str| {
        let path = directory.path().join(name);
        let report = replay(&recording, &["--records", path.to_str().unwrap()]);
        assert!(
            report.contains("41 runs") && report.contains("0 false alarms in 0 runs"),
            "{report}"
        );
        std::fs::read(path).unwrap()
    };
    assert!(
        records("first.csv") == records("second.csv"),
        "two replays differ"
    );
}

#[test]
fn a_steering_offset_of_a_tenth_radian_is_found_and_isolated_in_every_checking_run() {
    let Some(recording) = recording() else { return };
    for size in ["0.1", "-0.1"] {
        let fault = format!("offset,column=steer_cmd,size={size},onset=50%");
        let report = replay(&recording, &["--runs", "even", "--fault", &fault]);
        for words in [
            "0 false alarms in 0 runs",
            "fault detected in 20 of 20 runs",
            "isolated yaw_rate_command in 20 of 20 runs",
            "isolated speed_command in 0 of 20 runs",
        ] {
            assert!(report.contains(words), "no `{words}` with {size}:\n{report}");
        }
    }
}
