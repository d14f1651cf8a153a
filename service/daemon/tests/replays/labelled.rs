//! Replays of recordings with labelled faults, irregular rows and lost samples, and the table of what was detected.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use crate::support::Stage;
use crate::support::daemon::{Daemon, finish, program};
use residuald::demo::plants::aircraft::{Aircraft, Disturbance};
use serde_json::Value;

/// Sampling period, s.
const PERIOD_S: f64 = 0.08;

/// Speed of the replays through a daemon.
const SPEED: &str = "4";

/// Rows of the run with a fault, and the first one that shows it.
const ROWS: usize = 110;
const FIRST_FAULTY_ROW: usize = 102;

/// Rows of the run without a fault.
const HEALTHY_ROWS: usize = 95;

/// A stage whose diagnoser has time.
fn stage() -> Stage {
    let mut stage = Stage::new();
    stage.set_diagnoser("sample_time_s", PERIOD_S);
    stage.set_diagnoser("margin_s", PERIOD_S / 2.0);
    stage.set("realtime", "fifo_priority", 50);
    stage
}

/// Names the columns of [`record`] in a stage's `[replay]`.
fn use_labels(stage: &mut Stage) {
    stage.set("replay", "run_column", "flight");
    stage.set("replay", "kind_column", "kind");
    stage.set("replay", "fault_column", "fault");
}

/// Writes the recording of two flights, the first with a fault of actuator 1; `time_s` is the time of a row.
fn record(stage: &Stage, name: &str, time_s: impl Fn(usize) -> f64) -> PathBuf {
    let mut text = String::from("flight,kind,t,v_x,v_z,q,theta,collective,cyclic,fault\n");
    for (flight, kind, rows) in [("first", "actuator", ROWS), ("second", "none", HEALTHY_ROWS)] {
        let mut aircraft = Aircraft::new(1, Disturbance::Sine, 5);
        for row in 0..rows {
            let [v_x, v_z, q, mix] = aircraft.measure();
            let theta = mix - v_z - q;
            let [collective, cyclic] = aircraft.command();
            aircraft.advance();
            let fault = u8::from(row >= FIRST_FAULTY_ROW);
            let time_s = time_s(row);
            writeln!(
                text,
                "{flight},{kind},{time_s},{v_x},{v_z},{q},{theta},{collective},{cyclic},{fault}"
            )
            .unwrap();
        }
    }
    let path = stage.files.path().join(name);
    fs::write(&path, text).unwrap();
    path
}

fn regular(row: usize) -> f64 {
    row as f64 * PERIOD_S
}

/// Steps of 0.08, 0.14 and 0.02 s.
fn irregular(row: usize) -> f64 {
    regular(row) + if row % 3 == 2 { 0.06 } else { 0.0 }
}

/// Replays a recording; gives what was printed.
fn replay(stage: &Stage, recording: &Path, arguments: &[&str]) -> String {
    let mut command = program();
    command
        .arg("replay")
        .arg(stage.configuration_file())
        .arg(recording);
    let finished = finish(command.args(arguments));
    assert_eq!(finished.code, Some(0), "{}", finished.messages);
    finished.output
}

/// Replays a recording and gives its records.
fn records(stage: &Stage, recording: &Path, name: &str, arguments: &[&str]) -> String {
    let path = stage.files.path().join(name);
    let file = path.display().to_string();
    replay(stage, recording, &[&["--records", &file], arguments].concat());
    fs::read_to_string(path).unwrap()
}

/// Bits of the measurements (4) and commands (2) that each record saw.
fn inputs_valid(records: &str) -> Vec<u64> {
    let lines = records.lines().skip(1);
    lines
        .map(|line| line.split(',').nth(8).unwrap().parse().unwrap())
        .collect()
}

const SENSORS: u64 = 0b1111;
const COMMANDS: u64 = 0b11_0000;

#[test]
fn detection_counts_from_the_label_in_the_time_of_the_recording() {
    let mut stage = stage();
    use_labels(&mut stage);
    let recording = record(&stage, "regular.csv", regular);
    let table: Value = serde_json::from_str(&replay(&stage, &recording, &["--table=json"])).unwrap();
    let first = &table["runs"][0];
    assert_eq!(first["run"], "first");
    assert_eq!(first["onset_s"], FIRST_FAULTY_ROW as f64 * PERIOD_S);
    let delay_s = first["detected_after_s"].as_f64().unwrap();
    assert!((0.0..=PERIOD_S * 1.001).contains(&delay_s), "{first}");
    assert_eq!(first["isolated"], "collective_pitch");
    let second = &table["runs"][1];
    assert!(second["onset_s"].is_null() && second["detected_after_s"].is_null());
    assert_eq!(
        (&first["false_alarms"], &second["false_alarms"]),
        (&0.into(), &0.into())
    );

    let totals = table["totals"].as_array().unwrap();
    let of_kind = |kind: &str| totals.iter().find(|total| total["kind"] == kind).unwrap();
    let numbers = |kind: &str| ["runs", "faulty", "detected"].map(|key| of_kind(kind)[key].as_u64().unwrap());
    assert_eq!(numbers("actuator"), [1, 1, 1]);
    assert_eq!(numbers("none"), [1, 0, 0]);
    assert_eq!(numbers("(all)"), [2, 1, 1]);

    let lines = replay(&stage, &recording, &["--table=csv"]);
    assert_eq!(lines.lines().count(), 3, "{lines}");
    assert!(lines.lines().nth(1).unwrap().starts_with("first,actuator,"));
    let people = replay(&stage, &recording, &["--table"]);
    assert!(
        people.contains("| first  | actuator |") && people.contains("1 of 1"),
        "{people}"
    );
    // Without the table the totals count the faulty run alone.
    let said = replay(&stage, &recording, &["--totals"]);
    assert!(said.contains("fault detected in 1 of 1 runs"), "{said}");
}

#[test]
fn a_labelled_fault_is_judged_like_the_same_fault_injected() {
    let mut stage = stage();
    stage.set("replay", "run_column", "flight");
    stage.set("replay", "kind_column", "kind");
    let recording = record(&stage, "healthy.csv", regular);
    let injected = ["--runs", "second", "--table=json", "--fault"];
    let fault = format!("offset,column=v_x,size=3,onset={}", regular(50));
    let injected = replay(&stage, &recording, &[&injected[..], &[&fault]].concat());

    let text = fs::read_to_string(&recording).unwrap();
    let faulty = text.lines().enumerate().map(|(line, text)| {
        let mut cells: Vec<String> = text.split(',').map(str::to_owned).collect();
        // One header line and the first flight stand before the second flight.
        if line > ROWS + 50 {
            cells[3] = (cells[3].parse::<f64>().unwrap() + 3.0).to_string();
            cells[9] = "7".into();
        }
        cells.join(",")
    });
    fs::write(&recording, faulty.collect::<Vec<_>>().join("\n")).unwrap();
    stage.set("replay", "fault_column", "fault");
    let labelled = replay(&stage, &recording, &["--runs", "second", "--table=json"]);
    assert!(labelled.contains("\"onset_s\": 4.0"), "{labelled}");
    assert_eq!(labelled, injected);
}

#[test]
fn irregular_rows_one_a_period_give_the_records_of_regular_ones_and_delays_as_recorded() {
    let mut stage = stage();
    use_labels(&mut stage);
    let even = record(&stage, "regular.csv", regular);
    let expected = records(&stage, &even, "expected.csv", &[]);

    let uneven = record(&stage, "irregular.csv", irregular);
    stage.set("replay", "row_period_s", PERIOD_S);
    assert!(records(&stage, &uneven, "records.csv", &[]) == expected);
    let table = |recording: &Path| -> Value {
        serde_json::from_str(&replay(&stage, recording, &["--runs", "first", "--table=json"])).unwrap()
    };
    let (regular_run, run) = (&table(&even)["runs"][0], &table(&uneven)["runs"][0]);
    let onset_s = run["onset_s"].as_f64().unwrap();
    assert!((onset_s - irregular(FIRST_FAULTY_ROW)).abs() < 1e-9);
    let after = |run: &Value| run["detected_after_s"].as_f64().unwrap();
    let detected_row = FIRST_FAULTY_ROW + (after(regular_run) / PERIOD_S).round() as usize;
    assert!(
        (onset_s + after(run) - irregular(detected_row)).abs() < 1e-9,
        "{run}"
    );

    // A fault is injected by the recording's clock as well.
    let fault = format!("dropout,column=v_x,onset={}", irregular(53));
    let dropped = records(
        &stage,
        &uneven,
        "dropped.csv",
        &["--runs", "second", "--fault", &fault],
    );
    let valid = inputs_valid(&dropped);
    assert_eq!(valid.iter().position(|&bits| bits == COMMANDS), Some(53));
}

#[test]
fn part_of_the_rows_make_the_samples_of_a_slower_sensor() {
    let mut stage = stage();
    use_labels(&mut stage);
    let recording = record(&stage, "regular.csv", regular);
    let feeds = stage.configuration["replay"]["input"].as_array_mut().unwrap();
    let sensors = feeds[0].as_table_mut().unwrap();
    sensors.insert("every_rows".into(), 3.into());
    sensors.insert("first_row".into(), 2.into());
    let records = records(&stage, &recording, "records.csv", &["--runs", "second"]);
    for (row, bits) in inputs_valid(&records).into_iter().enumerate() {
        let expected = if row % 3 == 2 {
            SENSORS | COMMANDS
        } else {
            COMMANDS
        };
        assert_eq!(bits, expected, "row {row}");
    }
}

#[test]
fn lost_samples_are_the_same_ones_through_a_daemon_which_counts_them_as_lost() {
    let mut stage = stage();
    use_labels(&mut stage);
    let recording = record(&stage, "regular.csv", regular);
    let loss = [
        "--runs",
        "second",
        "--loss",
        "aircraft_sensors=0.3,aircraft_commands=0.1,seed=4",
    ];
    let local = records(&stage, &recording, "local.csv", &loss);
    let valid = inputs_valid(&local);
    // A loss shows in the number of the next sample, once there has been one.
    let lost = |bits: u64| {
        let received: Vec<bool> = valid.iter().map(|valid| valid & bits != 0).collect();
        let first = received.iter().position(|&received| received).unwrap();
        let last = received.iter().rposition(|&received| received).unwrap();
        received[first..last]
            .iter()
            .filter(|&&received| !received)
            .count() as u64
    };
    assert!((15..=45).contains(&lost(SENSORS)) && (1..=25).contains(&lost(COMMANDS)));

    let through = [&loss[..], &["--through-daemon", "--speed", SPEED]].concat();
    for _ in 0..3 {
        let mut daemon = Daemon::spawn(&stage, &["--speed", SPEED]);
        daemon.wait_ready();
        let there = records(&stage, &recording, "through.csv", &through);
        let summary = daemon.stop();
        let counter = |input: usize, wanted: &str| {
            let mut counters = summary.inputs[input].counters.iter();
            counters.find(|(name, _)| name == wanted).unwrap().1
        };
        assert_eq!(
            (counter(0, "lost"), counter(1, "lost")),
            (lost(SENSORS), lost(COMMANDS))
        );
        if there == local {
            return;
        }
        let late = counter(0, "late") + counter(1, "late");
        let busy = late + summary.schedule_total("overruns") + summary.schedule_total("skipped");
        assert!(
            busy > 0,
            "the records differ although nothing was late: {summary}"
        );
        println!("the machine was too busy: {summary}");
    }
    panic!("three times samples were late or steps behind");
}

#[test]
fn mistakes_in_the_request_are_named() {
    let mut stage = stage();
    use_labels(&mut stage);
    let recording = record(&stage, "regular.csv", regular);
    let refused = |stage: &Stage, arguments: &[&str], code: i32, phrase: &str| {
        let mut command = program();
        command
            .arg("replay")
            .arg(stage.configuration_file())
            .arg(&recording);
        let finished = finish(command.args(arguments));
        assert_eq!(finished.code, Some(code), "{}", finished.messages);
        assert!(
            finished.messages.contains(phrase),
            "`{phrase}` in: {}",
            finished.messages
        );
    };
    refused(&stage, &["--loss", "gyroscope=0.1"], 1, "no input `gyroscope`");
    refused(&stage, &["--loss", "all=2"], 2, "no share from 0 to 1");
    refused(&stage, &["--table", "--totals"], 2, "--totals");
    stage.set("replay", "fault_column", "label");
    refused(&stage, &[], 1, "no column `label`");
}
