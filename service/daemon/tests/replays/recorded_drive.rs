//! The figures that the README states for the recorded drive.

use crate::recordings::Recording;
use serde_json::Value;

/// Column, size of the offset, faulty component, and the longest delay of either diagnoser with all samples, s.
const FAULTS: [(&str, f64, &str, f64); 8] = [
    ("yaw_rate_car", 0.01, "yaw_rate_car", 0.5),
    ("gyro_z", -0.01, "yaw_rate_phone", 0.5),
    ("gyro_z", 0.005, "yaw_rate_phone", 1.6),
    ("w_fl", 0.5, "front_left", 0.4),
    ("w_rr", -0.2, "rear_right", 1.6),
    ("v_gnss", -1.0, "speed", 2.6),
    ("steer", 0.0349, "steering", 0.9),
    ("steer", -0.01745, "steering", 3.0),
];

fn recording() -> Option<Recording> {
    Recording::find("comma2k19.csv", "comma2k19.toml")
}

/// Asserts that a run was without false alarm and its fault isolated within `within_s`.
fn assert_isolated(run: &Value, component: &str, within_s: f64) {
    assert_eq!(run["false_alarms"], 0, "{run}");
    assert_eq!(run["isolated"], component, "{run}");
    let after_s = run["isolated_after_s"].as_f64().unwrap();
    assert!(after_s <= within_s + 1e-9, "{run}");
}

/// The one run of each of the two diagnosers.
fn runs_of_both(table: &Value) -> &[Value] {
    let runs = table["runs"].as_array().unwrap();
    let mut names: Vec<_> = runs
        .iter()
        .map(|run| run["diagnoser"].as_str().unwrap())
        .collect();
    names.sort_unstable();
    assert_eq!(names, ["packets", "sensors"]);
    runs
}

#[test]
fn the_drive_without_fault_gives_no_alarm() {
    let Some(recording) = recording() else { return };
    let table = recording.table(&[]);
    for run in runs_of_both(&table) {
        assert_eq!(run["false_alarms"], 0, "{run}");
    }
}

#[test]
fn offsets_of_sensors_and_steering_are_isolated_by_both_diagnosers() {
    let Some(recording) = recording() else { return };
    for (column, size, component, within_s) in FAULTS {
        let fault = format!("offset,column={column},size={size},onset=30");
        let table = recording.table(&["--fault", &fault]);
        for run in runs_of_both(&table) {
            assert_isolated(run, component, within_s);
        }
    }
}

#[test]
fn with_three_in_ten_samples_lost_packets_isolate_the_same_offsets_without_false_alarm() {
    let Some(recording) = recording() else { return };
    for (seed, (column, size, component, within_s)) in (41..).zip(FAULTS) {
        let fault = format!("offset,column={column},size={size},onset=30");
        let loss = format!("all=0.3,seed={seed}");
        let table = recording.table(&["--fault", &fault, "--loss", &loss]);
        let mut runs = table["runs"].as_array().unwrap().iter();
        let packets = runs.find(|run| run["diagnoser"] == "packets").unwrap();
        assert_isolated(packets, component, 2.0 * within_s);
    }
}
