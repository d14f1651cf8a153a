//! `residual plot` and `residual export csv` on a recording that the test writes, and on a live daemon.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod live;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::Duration;

use live::Live;
use residual_client::{AlarmNumber, AlarmState, AlarmTransition, Channel, DaemonTime, StepRecord, Verdict};
use residual_recording::header::{ChannelOf, Diagnoser, Header};
use residual_recording::{RecordMessage, Totals, Writer};
use tempfile::TempDir;

/// Records of `front`, whose channel `force` leaves its bounds at step 60, and a few of `rear`.
fn recording(directory: &TempDir) -> PathBuf {
    let diagnoser = |name: &str, channels: &[&str]| Diagnoser {
        name: name.into(),
        method: "chi_square".into(),
        period_ns: 10_000_000,
        phase_ns: 0,
        margin_ns: 0,
        channels: channels
            .iter()
            .map(|name| ChannelOf {
                name: (*name).into(),
                unit: "N".into(),
            })
            .collect(),
        faults: vec!["pump".into(), "valve".into()],
    };
    let header = Header {
        instance: "car".into(),
        epoch: 7,
        pid: 1,
        time: DaemonTime::MONOTONIC,
        wall_clock_offset_ns: 1_764_000_000_000_000_000,
        schedule_epoch_ns: 0,
        configuration: None,
        earlier_samples: 0,
        diagnosers: vec![
            diagnoser("front", &["force", "never"]),
            diagnoser("rear", &["yaw rate"]),
        ],
        inputs: vec![],
    };
    let path = directory.path().join("drive.mcap");
    let mut writer = Writer::create(&path, header, &[0, 1], false).unwrap();
    for step in 0..100_u64 {
        let faulty = step >= 60;
        let mut record = StepRecord::new(2);
        record.step = step;
        record.instant_ns = 5_000_000_000 + step * 10_000_000;
        record.verdict = if faulty {
            Verdict::Isolated
        } else {
            Verdict::Nominal
        } as u32;
        record.certainly_faulty = if faulty { 0b10 } else { 0 };
        record.channels_mut()[0] = Channel::two_sided(0.1 * step as f64, 6.0);
        let front = RecordMessage {
            sequence: 2 * step,
            slot: 0,
            record,
        };
        writer.write_record(&front, 0).unwrap();
        let mut record = StepRecord {
            verdict: Verdict::Nominal as u32,
            ..record
        };
        record.channel_count = 1;
        record.certainly_faulty = 0;
        record.channels[0] = Channel::two_sided(-0.25, 1.0);
        let rear = RecordMessage {
            sequence: 2 * step + 1,
            slot: 1,
            record,
        };
        writer.write_record(&rear, 0).unwrap();
        if step == 62 {
            writer.write_alarm(&raised(step), 0).unwrap();
        }
    }
    let totals = Totals {
        lost_records: 3,
        ..Totals::default()
    };
    writer.finish(&totals).unwrap();
    path
}

fn raised(step: u64) -> AlarmTransition {
    AlarmTransition {
        number: AlarmNumber { epoch: 7, number: 1 },
        written_ns: 0,
        instant_ns: 5_000_000_000 + step * 10_000_000,
        step,
        slot: 0,
        identity: 0,
        state: AlarmState::Raised,
        flags: 0,
        verdict: Verdict::Isolated as u32,
        occurrence: 1,
        certainly_faulty: 0b10,
        possibly_faulty: 0b10,
        channel: 0,
        ratio: 1.1,
        fault_estimate: f64::NAN,
        fault_estimate_half_width: f64::NAN,
    }
}

fn run(arguments: &[&str], path: &Path) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_residual"));
    command.args(arguments).arg(path).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

#[test]
fn every_evaluated_channel_gets_its_picture_with_alarm_and_fault() {
    let directory = tempfile::tempdir().unwrap();
    let path = recording(&directory);
    let output = run(&["plot"], &path);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let plots = path.with_extension("plots");
    let mut files: Vec<_> = fs::read_dir(&plots)
        .unwrap()
        .map(|entry| entry.unwrap().file_name())
        .collect();
    files.sort();
    assert_eq!(files, ["front.force.svg", "rear.yaw_rate.svg"]);
    let front = fs::read_to_string(plots.join("front.force.svg")).unwrap();
    for part in [
        "front: force",
        "residual between its bounds, N",
        "alarm raised",
        "isolated",
        "valve",
    ] {
        assert!(front.contains(part), "{part}");
    }
    let rear = fs::read_to_string(plots.join("rear.yaw_rate.svg")).unwrap();
    assert!(rear.contains("rear: yaw rate") && !rear.contains("alarm raised") && !rear.contains("valve"));
    // The names of the files are told.
    assert!(text(&output.stdout).contains("rear.yaw_rate.svg"));
}

#[test]
fn one_channel_goes_into_one_file_and_a_png_is_one() {
    let directory = tempfile::tempdir().unwrap();
    let path = recording(&directory);
    let picture = directory.path().join("force.png");
    let picture_name = picture.to_str().unwrap();
    let output = run(&["plot", "--channel", "force", "--output", picture_name], &path);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(fs::read(&picture).unwrap().starts_with(b"\x89PNG\r\n"));
    for (arguments, phrase) in [
        (
            &["plot", "--output", "x.svg"][..],
            "2 channels do not fit into one file",
        ),
        (
            &["plot", "--channel", "side"],
            "no channel `side`; it has force, never, yaw rate",
        ),
        (
            &["plot", "--diagnoser", "side"],
            "no diagnoser `side`; it has front, rear",
        ),
        (&["plot", "--channel", "never"], "nothing to draw"),
        (&["export", "csv"], "choose one of front, rear"),
        (&["export", "csv", "--duration", "1"], "for `live` alone"),
        (&["export", "csv", "--instance", "car"], "for `live` alone"),
        (&["plot", "--png", "--output", "w.svg"], "--png asks for PNG"),
        (&["plot", "--output", "w.pdf"], "`w.pdf` ends with .pdf"),
    ] {
        let output = run(arguments, &path);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(text(&output.stderr).contains(phrase), "{}", text(&output.stderr));
    }
}

#[test]
fn csv_has_a_line_a_record_and_the_numbers_with_all_digits() {
    let directory = tempfile::tempdir().unwrap();
    let path = recording(&directory);
    let output = run(&["export", "csv", "--diagnoser", "front"], &path);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let csv = text(&output.stdout);
    let lines: Vec<&str> = csv.lines().collect();
    assert_eq!(lines.len(), 101);
    let head = "run,step,time_ns,verdict,certainly_faulty,possibly_faulty,flags,skipped_instants,inputs_valid,\
                fault_estimate,fault_estimate_half_width,force.lower,force.residual,force.upper,force.ratio,";
    assert!(lines[0].starts_with(head), "{}", lines[0]);
    let expected = format!(
        "car,3,5030000000,nominal,,,0,0,0,NaN,NaN,-6,{},6,{},",
        0.1 * 3.0,
        0.1 * 3.0 / 6.0
    );
    assert!(lines[4].starts_with(&expected), "{}", lines[4]);
    assert!(
        lines[61].starts_with("car,60,5600000000,isolated,valve,,"),
        "{}",
        lines[61]
    );

    let into = directory.path().join("all.csv");
    let output = run(&["export", "csv", "--output", into.to_str().unwrap()], &path);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert_eq!(fs::read_to_string(into.with_extension("front.csv")).unwrap(), csv);
    assert_eq!(
        fs::read_to_string(into.with_extension("rear.csv"))
            .unwrap()
            .lines()
            .count(),
        101
    );
}

#[test]
fn a_file_that_is_there_is_never_written() {
    let directory = tempfile::tempdir().unwrap();
    let path = recording(&directory);
    let recorded = fs::read(&path).unwrap();
    let name = path.to_str().unwrap();
    let plots = path.with_extension("plots");
    fs::create_dir(&plots).unwrap();
    let (picture, table) = (
        plots.join("rear.yaw_rate.svg"),
        directory.path().join("a.rear.csv"),
    );
    for file in [&picture, &table] {
        fs::write(file, "precious").unwrap();
    }
    let tables = directory.path().join("a.csv");
    for arguments in [
        &["export", "csv", "--diagnoser", "front", "--output", name][..],
        &["export", "csv", "--output", tables.to_str().unwrap()],
        &["plot"],
    ] {
        let output = run(arguments, &path);
        assert_eq!(output.status.code(), Some(1), "{arguments:?}");
        let said = text(&output.stderr);
        assert!(
            said.contains("exists") && said.contains("choose another file with --output"),
            "{said}"
        );
    }
    assert_eq!(fs::read(&path).unwrap(), recorded);
    for file in [&picture, &table] {
        assert_eq!(fs::read(file).unwrap(), b"precious");
    }
    // Nor are those that could have been written.
    assert!(!plots.join("front.force.svg").exists() && !tables.with_extension("front.csv").exists());
}

#[test]
fn losses_and_a_missing_end_of_the_recording_are_told() {
    let directory = tempfile::tempdir().unwrap();
    let path = recording(&directory);
    let commands = [&["export", "csv", "--diagnoser", "rear"][..], &["plot"]];
    for arguments in commands {
        let said = text(&run(arguments, &path).stderr);
        assert!(
            said.contains("LOST on the way from the daemon to the recording: 3 records"),
            "{said}"
        );
        assert!(!said.contains("no end"), "{said}");
    }
    fs::remove_dir_all(path.with_extension("plots")).unwrap();
    let whole = fs::read(&path).unwrap();
    fs::write(&path, &whole[..whole.len() - 200]).unwrap();
    for arguments in commands {
        let output = run(arguments, &path);
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        assert!(
            text(&output.stderr).contains("the recording has no end"),
            "{}",
            text(&output.stderr)
        );
    }
}

#[test]
fn a_reader_of_the_pipe_that_leaves_ends_the_export_quietly() {
    let directory = tempfile::tempdir().unwrap();
    let path = recording(&directory);
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let mut command = Command::new(env!("CARGO_BIN_EXE_residual"));
    command.args(["export", "csv", "--diagnoser", "front"]).arg(&path);
    let output = command.stdout(writer).output().unwrap();
    assert_eq!(
        (output.status.code(), text(&output.stderr)),
        (Some(0), String::new())
    );
}

#[test]
fn csv_of_a_live_daemon_comes_line_by_line() {
    let mut live = Live::start();
    let mut command = live.command(&[
        "export",
        "csv",
        "live",
        "--diagnoser",
        "rear",
        "--duration",
        "1.5",
    ]);
    let child = command.stdout(Stdio::piped()).spawn().unwrap();
    std::thread::sleep(Duration::from_millis(500));
    for _ in 0..5 {
        live.send_record(0);
        live.send_record(1);
    }
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0));
    let csv = text(&output.stdout);
    assert_eq!(csv.lines().count(), 6, "{csv}");
    assert!(csv.lines().nth(5).unwrap().contains(",4,"), "{csv}");
}

#[test]
fn csv_of_a_live_daemon_ends_when_its_table_is_replaced_and_says_so() {
    let mut live = Live::start();
    let mut command = live.command(&["export", "csv", "live", "--diagnoser", "rear"]);
    let child = command
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    std::thread::sleep(Duration::from_millis(500));
    live.send_record_of(1, 1);
    live.reload(["rear", "front"]);
    for step in 2..5 {
        live.send_record_of(1, 100);
        live.send_record_of(0, step);
    }
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(8), "{}", text(&output.stderr));
    assert!(text(&output.stderr).contains("export again"));
    let csv = text(&output.stdout);
    assert_eq!(csv.lines().count(), 2, "{csv}");
    assert!(csv.lines().nth(1).unwrap().contains(",1,"), "{csv}");
}
