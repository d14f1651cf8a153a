//! The figures that the README states for the flights with real faults.

use crate::recordings::Recording;
use serde_json::Value;

/// Detected faults, faults, and runs with false alarms of a kind of flight by a diagnoser.
fn total(table: &Value, kind: &str, diagnoser: &str) -> [u64; 3] {
    let totals = table["totals"].as_array().unwrap();
    let found = totals
        .iter()
        .find(|total| total["kind"] == kind && total["diagnoser"] == diagnoser);
    let total = found.unwrap_or_else(|| panic!("no total of {kind} by {diagnoser}"));
    ["detected", "faulty", "runs_with_false_alarms"].map(|key| total[key].as_u64().unwrap())
}

#[test]
fn stuck_surfaces_and_engine_cuts_of_all_flights_are_found_with_two_false_alarms() {
    let Some(recording) = Recording::find("alfa_rates.csv", "alfa.toml") else {
        return;
    };
    let table = recording.table(&[]);
    assert_eq!(total(&table, "rudder", "roll"), [4, 4, 0]);
    assert_eq!(total(&table, "aileron", "roll"), [6, 7, 0]);
    assert_eq!(total(&table, "elevator", "climb"), [2, 2, 0]);
    assert_eq!(total(&table, "engine", "climb"), [21, 23, 0]);
    assert_eq!(total(&table, "none", "roll"), [0, 0, 0]);
    assert_eq!(total(&table, "none", "climb"), [0, 0, 1]);
    assert_eq!(total(&table, "(all)", "(any)"), [33, 36, 2]);
}

#[test]
fn the_flights_that_took_no_part_in_the_design_show_the_same() {
    let Some(recording) = Recording::find("alfa_rates.csv", "alfa.toml") else {
        return;
    };
    let table = recording.table(&["--runs", "even"]);
    assert_eq!(total(&table, "rudder", "roll"), [2, 2, 0]);
    assert_eq!(total(&table, "aileron", "roll"), [3, 3, 0]);
    assert_eq!(total(&table, "elevator", "climb"), [1, 1, 0]);
    assert_eq!(total(&table, "engine", "climb"), [12, 12, 0]);
    assert_eq!(total(&table, "(all)", "(any)"), [18, 18, 1]);
}
