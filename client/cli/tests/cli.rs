//! The binary against a bounds table that the test writes.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod support;

use std::io::{BufRead, BufReader, Read};
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

use residual_shared::alarm::{AlarmState, AlarmTransition, alarm_flags};
use residual_shared::counters::{InputCounters, ScheduleCounters};
use residual_shared::names::Instance;
use residual_shared::record::{Channel, Verdict};
use serde_json::Value;

use support::{Daemon, NOMINAL};

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

#[test]
fn status_shows_verdict_faults_worst_channel_and_counters() {
    let mut daemon = Daemon::start();
    let beyond = Channel {
        lower: 0.0,
        residual: 1.0,
        upper: 0.0,
        ratio: f64::INFINITY,
    };
    daemon.publish(0, 41, Verdict::Isolated, &[NOMINAL[0], beyond]);
    daemon.publish(1, 42, Verdict::Nominal, &[]);
    daemon.writer.publish_schedule_counters(
        0,
        &ScheduleCounters {
            skipped: 777,
            ..Default::default()
        },
    );
    daemon.writer.publish_input_counters(
        0,
        &InputCounters {
            lost: 888,
            ..Default::default()
        },
    );
    let output = daemon.run(&["status", "--instance", "test"]);
    let shown = text(&output.stdout);
    let row = |name: &str| {
        shown
            .lines()
            .find(|line| line.contains(name))
            .unwrap()
            .to_string()
    };
    for word in ["fresh", "isolated", "valve", "yaw", "inf", "41", "777"] {
        assert!(row("front").contains(word), "{word}: {shown}");
    }
    // A nominal record names no fault, whatever its fault sets hold.
    assert!(
        row("rear").contains("nominal") && !row("rear").contains("valve"),
        "{shown}"
    );
    assert!(row("imu").contains("888"), "{shown}");
    assert_eq!(output.status.code(), Some(4));
}

/// The alarm of `front` becomes isolated and stays until it is acknowledged.
fn latch(daemon: &mut Daemon) {
    daemon.writer.raise(&AlarmTransition {
        number: Default::default(),
        written_ns: 0,
        instant_ns: 70,
        step: 7,
        slot: 0,
        identity: 0,
        state: AlarmState::Isolated,
        flags: alarm_flags::LATCHED,
        verdict: Verdict::Isolated as u32,
        occurrence: 2,
        certainly_faulty: 0b10,
        possibly_faulty: 0b10,
        channel: 0,
        ratio: 1.5,
        fault_estimate: f64::NAN,
        fault_estimate_half_width: f64::NAN,
    });
}

#[test]
fn an_alarm_that_outlives_the_fault_is_shown_and_counts_as_one() {
    let mut daemon = Daemon::start();
    daemon.publish_nominal();
    latch(&mut daemon);
    let output = daemon.run(&["status"]);
    let shown = text(&output.stdout);
    let front = shown.lines().find(|line| line.contains("front")).unwrap();
    assert!(front.contains("isolated, latched, occurred 2 times"), "{shown}");
    let rear = shown.lines().find(|line| line.contains("rear")).unwrap();
    assert!(rear.contains("cleared") && !rear.contains("latched"), "{shown}");
    assert_eq!(output.status.code(), Some(4));
}

#[test]
fn watch_writes_a_line_when_an_alarm_changes() {
    let mut daemon = Daemon::start();
    daemon.publish_nominal();
    let arguments = ["watch", "--diagnoser", "front", "--interval", "5", "--count", "2"];
    let child = daemon.command(&arguments).stdout(Stdio::piped()).spawn().unwrap();
    let mut child = Watching(child);
    let mut lines = BufReader::new(child.0.stdout.take().unwrap())
        .lines()
        .map(Result::unwrap);
    assert!(!lines.next().unwrap().contains("alarm"));
    latch(&mut daemon);
    let second = lines.next().unwrap();
    assert_eq!(second, "front fresh | alarm isolated, latched, occurred 2 times");
}

#[test]
fn json_has_every_channel_with_null_and_strings_for_numbers_it_cannot_hold() {
    let mut daemon = Daemon::start();
    let beyond = Channel {
        lower: 0.0,
        residual: 1.0,
        upper: 0.0,
        ratio: f64::INFINITY,
    };
    daemon.publish(0, 3, Verdict::Nominal, &[beyond, Channel::NOT_EVALUATED]);
    daemon.publish(1, 3, Verdict::Nominal, &[]);
    let output = daemon.run(&["status", "--json"]);
    let json: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(json["daemon"], "running");
    assert_eq!(json["pid"], std::process::id());
    let front = &json["diagnosers"][0];
    assert_eq!((&front["name"], &front["step"]), (&"front".into(), &3.into()));
    assert_eq!(front["channels"][0]["ratio"], "inf");
    assert_eq!(front["channels"][0]["residual"], 1.0);
    assert_eq!(front["channels"][1]["ratio"], Value::Null);
    assert_eq!(front["fault_estimate"], Value::Null);
    assert_eq!(front["alarm"]["state"], "cleared");
    assert_eq!(front["alarm"]["occurrences"], 0);
    assert_eq!(front["worst_channel"]["name"], "force");
    assert_eq!(json["inputs"][0]["counters"]["accepted"], 0);
    assert_eq!(output.status.code(), Some(0));
}

#[test]
fn the_exit_code_tells_the_condition_of_the_diagnosers() {
    let mut daemon = Daemon::start();
    let code = |daemon: &Daemon| daemon.run(&["status"]).status.code().unwrap();
    assert_eq!(code(&daemon), 5, "nothing has been written yet");
    daemon.publish_nominal();
    assert_eq!(code(&daemon), 0);
    daemon.publish(1, 2, Verdict::GuaranteeLost, &[]);
    assert_eq!(code(&daemon), 5);
    daemon.publish(0, 2, Verdict::Fault, &NOMINAL);
    assert_eq!(code(&daemon), 4);
    daemon.writer.heartbeat(0);
    assert_eq!(code(&daemon), 3, "hung");
    daemon.writer.close();
    let output = daemon.run(&["status"]);
    assert_eq!(output.status.code(), Some(3));
    assert!(text(&output.stdout).contains("daemon closed"));
}

#[test]
fn without_a_daemon_the_message_says_where_it_was_looked_for() {
    let daemon = Daemon::start();
    let output = daemon.run(&["status", "--instance", "other"]);
    assert_eq!(output.status.code(), Some(3));
    let message = text(&output.stderr);
    assert!(
        message.contains("residuald.other.bounds")
            && message.contains("running")
            && message.contains("the instances in")
            && message.ends_with("are test)\n"),
        "{message}"
    );
    let empty = tempfile::tempdir().unwrap();
    let directory = empty.path().to_str().unwrap();
    for command in ["status", "watch"] {
        let output = daemon.run(&["--runtime-directory", directory, command]);
        assert_eq!(output.status.code(), Some(3));
        assert!(text(&output.stderr).contains(directory));
    }
    for more in [&[][..], &["--instance", "test"]] {
        let arguments = [&["--runtime-directory", "/nowhere", "status"], more].concat();
        let message = text(&daemon.run(&arguments).stderr);
        assert!(
            message.contains("directory with --runtime-directory"),
            "{message}"
        );
    }
}

#[test]
fn of_several_instances_the_living_one_is_chosen_and_two_living_ones_must_be_named() {
    let mut daemon = Daemon::start();
    daemon.publish_nominal();
    let second = Daemon::create(daemon.directory.path(), "second");
    let output = daemon.run(&["status"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains("second, test"));
    second.close();
    assert!(text(&daemon.run(&["status"]).stdout).contains("instance test"));
}

#[test]
fn wrong_usage_is_refused_with_help() {
    let daemon = Daemon::start();
    for arguments in [
        &["status", "--instance", "A/B"][..],
        &["watch", "--interval", "0"],
        &["watch", "--count", "0"],
        &[],
    ] {
        let output = daemon.run(arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
    }
    let output = daemon.run(&["watch", "--diagnoser", "middle"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains("front, rear"));
    let help = text(&daemon.run(&["--help"]).stdout);
    assert!(help.contains("Exit codes") && help.contains("generate"), "{help}");
}

#[test]
fn a_file_that_is_no_table_is_an_error() {
    let daemon = Daemon::start();
    let path = Instance::new("foreign".parse().unwrap(), daemon.directory.path()).bounds_path();
    std::fs::write(path, [7; 1_000]).unwrap();
    let output = daemon.run(&["status", "--instance", "foreign"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("not a bounds table"));
}

#[test]
fn a_reader_of_the_pipe_that_leaves_does_not_change_the_exit_code_of_status() {
    let mut daemon = Daemon::start();
    daemon.publish(0, 1, Verdict::Fault, &NOMINAL);
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let output = daemon.command(&["status"]).stdout(writer).output().unwrap();
    assert_eq!(
        (output.status.code(), text(&output.stderr)),
        (Some(4), String::new())
    );
}

/// A child that is killed when the test fails.
struct Watching(Child);

impl Drop for Watching {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn watch_writes_one_line_for_each_new_record_and_ends_by_its_count() {
    let mut daemon = Daemon::start();
    daemon.publish(0, 10, Verdict::Nominal, &NOMINAL);
    let arguments = ["watch", "--diagnoser", "front", "--interval", "5", "--count", "3"];
    let child = daemon.command(&arguments).stdout(Stdio::piped()).spawn().unwrap();
    let mut child = Watching(child);
    let mut lines = BufReader::new(child.0.stdout.take().unwrap())
        .lines()
        .map(Result::unwrap);
    let first = lines.next().unwrap();
    assert!(first.starts_with("front fresh | step 10 at "), "{first}");
    assert!(
        first.contains("| nominal | force 0.5000 in [-2.0000, 2.0000] N ratio 0.2500"),
        "{first}"
    );
    assert!(first.contains("| yaw 0 in [0, 0] rad/s ratio -"), "{first}");
    daemon.publish(0, 11, Verdict::Fault, &NOMINAL);
    let second = lines.next().unwrap();
    assert!(
        second.contains("step 11") && second.contains("| fault: valve |"),
        "{second}"
    );
    assert!(!second.contains("missed"), "{second}");
    drop(daemon);
    assert_eq!(lines.next().as_deref(), Some("front dead"));
    assert_eq!(lines.next(), None);
    assert_eq!(child.0.wait().unwrap().code(), Some(0));
}

#[test]
fn watch_counts_the_records_it_missed_and_follows_a_restart() {
    let mut daemon = Daemon::start();
    daemon.publish_nominal();
    let arguments = [
        "watch",
        "--diagnoser",
        "rear",
        "--interval",
        "300",
        "--count",
        "3",
    ];
    let child = daemon.command(&arguments).stdout(Stdio::piped()).spawn().unwrap();
    let mut child = Watching(child);
    let mut lines = BufReader::new(child.0.stdout.take().unwrap())
        .lines()
        .map(Result::unwrap);
    lines.next().unwrap();
    for step in 2..=5 {
        daemon.publish(1, step, Verdict::Nominal, &[]);
    }
    let second = lines.next().unwrap();
    assert!(
        second.contains("step 5") && second.ends_with("| 3 missed"),
        "{second}"
    );
    daemon.writer = Daemon::create(daemon.directory.path(), "test");
    daemon.publish(1, 100, Verdict::Nominal, &[]);
    let third = lines.next().unwrap();
    assert!(third.contains("step 100") && !third.contains("missed"), "{third}");
    assert!(child.0.wait().unwrap().success());
}

#[test]
fn a_reader_of_the_pipe_that_leaves_ends_watch_quietly() {
    let mut daemon = Daemon::start();
    daemon.publish_nominal();
    let mut command = daemon.command(&["watch", "--interval", "1"]);
    let child = command
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut child = Watching(child);
    let mut output = BufReader::new(child.0.stdout.take().unwrap());
    output.read_line(&mut String::new()).unwrap();
    drop(output);
    let deadline = Instant::now() + Duration::from_secs(10);
    let mut step = 2;
    let status = loop {
        daemon.publish(0, step, Verdict::Nominal, &NOMINAL);
        step += 1;
        match child.0.try_wait().unwrap() {
            Some(status) => break status,
            None => assert!(Instant::now() < deadline, "still running"),
        }
        std::thread::sleep(Duration::from_millis(5));
    };
    let mut message = String::new();
    child
        .0
        .stderr
        .take()
        .unwrap()
        .read_to_string(&mut message)
        .unwrap();
    assert_eq!((status.code(), message.as_str()), (Some(0), ""));
}
