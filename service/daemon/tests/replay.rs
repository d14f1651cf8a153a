//! Replays of one recording agree to the last bit, in this process and through a running daemon.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod support;

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use residuald::demo::plants::aircraft::{Aircraft, Disturbance};
use support::Stage;
use support::daemon::{Daemon, Finished, finish, program};
use toml::Value;

/// Rows of the recording, with the fault of actuator 1 from the row 102 on.
const ROWS: usize = 110;

/// Speed of the replays through a daemon.
const SPEED: &str = "4";

/// Sampling period, s: longer than the aircraft's, so that a busy machine keeps up at [`SPEED`].
const PERIOD_S: f64 = 0.08;

/// A stage whose diagnoser has time.
fn stage() -> Stage {
    let mut stage = Stage::new();
    stage.set_diagnoser("sample_time_s", PERIOD_S);
    stage.set_diagnoser("margin_s", PERIOD_S / 2.0);
    // Used where it is permitted.
    stage.set("realtime", "fifo_priority", 50);
    stage
}

/// Writes the recording of an aircraft whose actuator 1 fails, with the columns of the shipped `[replay]`.
fn record_aircraft(stage: &Stage) -> PathBuf {
    let mut aircraft = Aircraft::new(1, Disturbance::Sine, 5);
    let mut text = String::from("t,v_x,v_z,q,theta,collective,cyclic\n");
    for row in 0..ROWS {
        let [v_x, v_z, q, mix] = aircraft.measure();
        let theta = mix - v_z - q;
        let [collective, cyclic] = aircraft.command();
        aircraft.advance();
        writeln!(
            text,
            "{},{v_x},{v_z},{q},{theta},{collective},{cyclic}",
            row as f64 * PERIOD_S
        )
        .unwrap();
    }
    let path = stage.files.path().join("recording.csv");
    fs::write(&path, text).unwrap();
    path
}

/// Replays the recording of a stage with more arguments.
fn replay(stage: &Stage, recording: &Path, arguments: &[&str]) -> Finished {
    let mut command = program();
    command
        .arg("replay")
        .arg(stage.configuration_file())
        .arg(recording);
    finish(command.args(arguments))
}

/// Replays into a file, and the alarms into one beside it with the extension `alarms`; gives what was printed and
/// the file's path.
fn replay_into(stage: &Stage, recording: &Path, name: &str, arguments: &[&str]) -> (String, PathBuf) {
    let path = stage.files.path().join(name);
    let (records, alarms) = (path.display().to_string(), alarms_of(&path).display().to_string());
    let arguments = [&["--records", &records, "--alarms", &alarms], arguments].concat();
    let finished = replay(stage, recording, &arguments);
    assert_eq!(finished.code, Some(0), "{}", finished.messages);
    (finished.output, path)
}

fn alarms_of(records: &Path) -> PathBuf {
    records.with_extension("alarms")
}

/// Adds diagnosers of the same plant with other periods and phases.
fn add_diagnosers(stage: &mut Stage) {
    let first = stage.diagnosers()[0].clone();
    for (name, period, phase, margin) in [("slow", 2.0, 0.5, 0.4), ("odd", 3.0, 0.0, 0.6)] {
        let mut other = first.clone();
        let table = other.as_table_mut().unwrap();
        table.insert("name".into(), name.into());
        table.insert("sample_time_s".into(), (period * PERIOD_S).into());
        table.insert("phase_s".into(), (phase * PERIOD_S).into());
        table.insert("margin_s".into(), (margin * PERIOD_S).into());
        stage.diagnosers().push(other);
    }
}

/// Replays through a daemon, until nothing was late, and compares with the files of the replay in one process.
fn assert_the_same_through_a_daemon(stage: &Stage, recording: &Path, files: &[PathBuf]) {
    for _ in 0..3 {
        // A daemon goes on with the alarms of its predecessor, a replay in one process has none.
        let _ = fs::remove_file(stage.instance.bounds_path());
        let mut daemon = Daemon::spawn(stage, &["--speed", SPEED]);
        daemon.wait_ready();
        let arguments = ["--through-daemon", "--speed", SPEED];
        let (_, path) = replay_into(stage, recording, "through.csv", &arguments);
        let summary = daemon.stop();
        let differing = files.iter().find_map(|file| {
            let name = file.file_name().unwrap().to_str().unwrap();
            let there = path.with_file_name(name.replace("local", "through"));
            let line = first_difference(file, &there)?;
            Some(format!("line {line} of {name}"))
        });
        let Some(differing) = differing else { return };
        let late = summary.inputs.iter().flat_map(|input| &input.counters);
        let late: u64 = late
            .filter(|(name, _)| name == "late")
            .map(|(_, value)| value)
            .sum();
        let busy = late + summary.schedule_total("overruns") + summary.schedule_total("skipped") > 0;
        assert!(busy, "{differing} differs although nothing was late: {summary}");
        println!("the machine was too busy: {summary}");
    }
    panic!("three times samples were late or steps behind");
}

/// The first line, from 1, in which two files differ.
fn first_difference(left: &Path, right: &Path) -> Option<usize> {
    let (left, right) = (
        fs::read_to_string(left).unwrap(),
        fs::read_to_string(right).unwrap(),
    );
    let differing = left
        .lines()
        .zip(right.lines())
        .position(|(left, right)| left != right);
    differing
        .or((left != right).then(|| left.lines().count().min(right.lines().count())))
        .map(|line| line + 1)
}

#[test]
fn two_replays_in_this_process_write_the_same_bytes_and_find_the_fault() {
    let stage = stage();
    let recording = record_aircraft(&stage);
    let (said, first) = replay_into(&stage, &recording, "one.csv", &[]);
    let (_, second) = replay_into(&stage, &recording, "two.csv", &[]);
    assert_eq!(fs::read(&first).unwrap(), fs::read(&second).unwrap());
    assert!(said.contains("110 steps, 109 evaluated"), "{said}");
    let text = fs::read_to_string(&first).unwrap();
    let verdict = |row: usize| text.lines().nth(row + 1).unwrap().split(',').nth(3).unwrap();
    assert_eq!(verdict(101), "nominal");
    assert_eq!(verdict(103), "isolated");
    // Through iceoryx2 to a daemon, the same bytes again.
    let local = stage.files.path().join("local.csv");
    fs::rename(&first, &local).unwrap();
    fs::rename(alarms_of(&first), alarms_of(&local)).unwrap();
    let alarms = fs::read_to_string(alarms_of(&local)).unwrap();
    let transitions: Vec<Vec<&str>> = alarms
        .lines()
        .skip(1)
        .map(|line| line.split(',').collect())
        .collect();
    let steps_and_states: Vec<_> = transitions.iter().map(|cells| (cells[2], cells[4])).collect();
    // Two violations raise it.
    assert_eq!(
        steps_and_states[..3],
        [("102", "pending"), ("103", "raised"), ("103", "isolated")]
    );
    assert_eq!(transitions[2][8], "collective_pitch");
    assert!(said.contains("alarm raised 1 times, cleared 0 times"), "{said}");
    assert_the_same_through_a_daemon(&stage, &recording, &[alarms_of(&local), local]);
}

#[test]
fn diagnosers_with_other_periods_and_phases_write_the_same_bytes_both_ways() {
    let mut stage = stage();
    add_diagnosers(&mut stage);
    let recording = record_aircraft(&stage);
    let (said, path) = replay_into(&stage, &recording, "local.csv", &[]);
    let files: Vec<PathBuf> = ["aircraft_actuators", "slow", "odd"]
        .iter()
        .map(|name| path.with_extension(format!("{name}.csv")))
        .collect();
    // Instants up to the last sample.
    for (file, steps) in files.iter().zip([110, 55, 37]) {
        assert_eq!(
            fs::read_to_string(file).unwrap().lines().count(),
            steps + 1,
            "{said}"
        );
    }
    assert_the_same_through_a_daemon(&stage, &recording, &[files, vec![alarms_of(&path)]].concat());
}

#[test]
fn a_running_daemon_with_another_speed_or_configuration_is_refused() {
    let stage = stage();
    let recording = record_aircraft(&stage);
    let through =
        |stage: &Stage, speed: &str| replay(stage, &recording, &["--through-daemon", "--speed", speed]);
    let none = through(&stage, SPEED);
    assert_eq!(none.code, Some(1));
    assert!(
        none.messages.contains("is the daemon running"),
        "{}",
        none.messages
    );

    let mut daemon = Daemon::spawn(&stage, &["--speed", SPEED]);
    daemon.wait_ready();
    let speed = through(&stage, "3");
    assert_eq!(speed.code, Some(1));
    assert!(
        speed.messages.contains("runs at speed 4, not 3") && speed.messages.contains("--speed 3"),
        "{}",
        speed.messages
    );

    let refused = |change: &dyn Fn(&mut Stage), phrases: [&str; 2]| {
        let mut other = Stage::new();
        other.configuration = stage.configuration.clone();
        change(&mut other);
        let finished = through(&other, SPEED);
        assert_eq!(finished.code, Some(1));
        for phrase in phrases {
            assert!(
                finished.messages.contains(phrase),
                "`{phrase}` in: {}",
                finished.messages
            );
        }
    };
    refused(
        &|other| other.set_diagnoser("name", "another"),
        ["`aircraft_actuators`", "`another`"],
    );
    refused(
        &|other| other.set_diagnoser("sample_time_s", 0.16),
        ["period 80 ms", "period 160 ms"],
    );
    refused(
        &|other| other.set_diagnoser("phase_s", 0.01),
        ["phase 0 ms", "phase 10 ms"],
    );
    refused(&|other| add_diagnosers(other), ["1 diagnosers", "3 here"]);
    daemon.stop();
}

#[test]
fn mistakes_in_the_request_are_named_and_end_with_a_failure() {
    let mut stage = stage();
    let recording = record_aircraft(&stage);
    let refused = |stage: &Stage, arguments: &[&str], code: i32, phrase: &str| {
        let finished = replay(stage, &recording, arguments);
        assert_eq!(finished.code, Some(code), "{}", finished.messages);
        assert!(
            finished.messages.contains(phrase),
            "`{phrase}` in: {}",
            finished.messages
        );
    };
    let no_column = "no column `v_y`";
    refused(
        &stage,
        &["--fault", "offset,column=v_y,size=1,onset=1"],
        1,
        no_column,
    );
    // A mistake in the command line itself ends with 2, as everywhere.
    refused(
        &stage,
        &["--fault", "shift,column=v_x,onset=1"],
        2,
        "none of offset",
    );
    refused(&stage, &["--speed", "2"], 2, "--through-daemon");
    refused(&stage, &["--runs", "7"], 1, "the recording has no run `7`");

    let missing = replay(&stage, Path::new("/no/such.csv"), &[]);
    assert_eq!(missing.code, Some(1));
    assert!(missing.messages.contains("/no/such.csv"), "{}", missing.messages);

    let set_values = |stage: &mut Stage, value: &str| {
        let inputs = stage.configuration["replay"]["input"].as_array_mut().unwrap();
        inputs[1]["values"] = Value::Array(vec![value.into(), "cyclic".into()]);
    };
    set_values(&mut stage, "collectif * 2");
    refused(&stage, &[], 1, "uses the column `collectif`");
    set_values(&mut stage, "collective +* 2");
    refused(&stage, &[], 1, "aircraft_commands");
    set_values(&mut stage, "collective");
    stage.set("replay", "time_column", "time");
    refused(&stage, &[], 1, "no column `time`");
    stage.configuration.remove("replay");
    refused(&stage, &[], 1, "no [replay] section");
}

#[test]
fn each_kind_of_fault_changes_the_records_from_its_onset_on_and_not_before() {
    let stage = stage();
    let recording = record_aircraft(&stage);
    let (_, path) = replay_into(&stage, &recording, "healthy.csv", &[]);
    let healthy = fs::read_to_string(path).unwrap();
    let onset = 50;
    for (fault, detected) in [
        ("offset,column=v_x,size=3,onset=4", true),
        ("scale,column=q,size=40,onset=4", true),
        ("freeze,column=v_x,onset=4", false),
        ("dropout,column=v_x,onset=4,end=4.8", false),
        ("spike,column=v_z,size=3,onset=4", true),
    ] {
        let (said, path) = replay_into(&stage, &recording, "faulty.csv", &["--fault", fault]);
        let faulty = fs::read_to_string(path).unwrap();
        // The header and the rows 0 to 49 stand before the row of the onset.
        let differing: Vec<usize> = healthy
            .lines()
            .zip(faulty.lines())
            .enumerate()
            .filter(|(_, (healthy, faulty))| healthy != faulty)
            .map(|(line, _)| line)
            .collect();
        assert_eq!(differing.first(), Some(&(onset + 1)), "{fault}");
        assert_eq!(
            said.contains("detected after 0.000 s"),
            detected,
            "{fault}: {said}"
        );
        let valid = |row: usize| {
            faulty
                .lines()
                .nth(row + 1)
                .unwrap()
                .split(',')
                .nth(8)
                .unwrap()
                .to_owned()
        };
        let dropped = fault.starts_with("dropout");
        // Four measurements and two commands; a column without value withholds the whole sample.
        for (row, expected) in [(49, "63"), (50, "48"), (59, "48"), (60, "63")] {
            let expected = if dropped { expected } else { "63" };
            assert_eq!(valid(row), expected, "{fault}, row {row}");
        }
    }
}

#[test]
fn a_gap_in_the_recording_is_missing_and_not_invented() {
    let stage = stage();
    let recording = record_aircraft(&stage);
    let text = fs::read_to_string(&recording).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    let cut = [&lines[..31], &lines[41..]].concat().join("\n");
    fs::write(&recording, cut).unwrap();
    let (said, path) = replay_into(&stage, &recording, "gap.csv", &[]);
    let records = fs::read_to_string(path).unwrap();
    assert_eq!(records.lines().count(), ROWS + 1);
    let missing = records.lines().filter(|line| line.split(',').nth(8) == Some("0"));
    assert_eq!(missing.count(), 10, "{said}");
}
