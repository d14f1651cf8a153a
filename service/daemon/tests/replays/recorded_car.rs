//! The figures that the README states for the recorded car.

use crate::recordings::Recording;

fn recording() -> Option<Recording> {
    Recording::find("f1tenth.csv", "f1tenth.toml")
}

#[test]
fn fault_free_runs_give_no_alarm_and_the_same_records_each_time() {
    let Some(recording) = recording() else { return };
    let directory = tempfile::tempdir().unwrap();
    let records = |name: &str| {
        let path = directory.path().join(name);
        let report = recording.replay(&["--totals", "--records", path.to_str().unwrap()]);
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
        let report = recording.replay(&["--totals", "--runs", "even", "--fault", &fault]);
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
