//! `residual alarms` against a bounds table that the test writes.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Output, Stdio};

use residual_shared::alarm::{AlarmState, AlarmTransition, NONE, alarm_flags};
use residual_shared::bounds_table::{Access, ChannelSpec, SlotSpec, TableSpec, TableWriter};
use residual_shared::clock::{DaemonTime, monotonic_ns};
use residual_shared::names::Instance;
use serde_json::Value;
use tempfile::TempDir;

struct Daemon {
    directory: TempDir,
    writer: TableWriter,
}

impl Daemon {
    /// A daemon with the diagnosers `front` and `rear`, and room for 16 transitions.
    fn start() -> Self {
        let directory = tempfile::Builder::new()
            .prefix("residuald-test-")
            .tempdir_in("/dev/shm")
            .unwrap();
        let writer = Self::create(&directory);
        Self { directory, writer }
    }

    fn create(directory: &TempDir) -> TableWriter {
        let slot = |name: &str| SlotSpec {
            name: name.into(),
            method: "chi_square".into(),
            period_ns: 10_000_000,
            phase_ns: 0,
            margin_ns: 0,
            channels: vec![ChannelSpec {
                name: "yaw".into(),
                unit: "rad/s".into(),
            }],
            faults: vec!["pump".into(), "valve".into()],
        };
        let spec = TableSpec {
            instance: "test".into(),
            slots: vec![slot("front"), slot("rear")],
            inputs: vec![],
            time: DaemonTime::MONOTONIC,
            schedule_epoch_ns: 0,
            stale_after_periods: 100,
            alarm_capacity: 16,
        };
        let access = Access {
            group: None,
            mode: 0o600,
        };
        let path = Instance::new("test".parse().unwrap(), directory.path()).bounds_path();
        let writer = TableWriter::create(&path, &spec, &access).unwrap();
        writer.heartbeat(monotonic_ns() + 3_600_000_000_000);
        writer
    }

    /// Writes a transition; gives its number as text.
    fn raise(&mut self, slot: u32, state: AlarmState) -> String {
        let is_isolated = state == AlarmState::Isolated;
        let transition = AlarmTransition {
            number: Default::default(),
            written_ns: 0,
            instant_ns: 70,
            step: 7,
            slot,
            identity: 0,
            state,
            flags: if is_isolated { alarm_flags::LATCHED } else { 0 },
            verdict: 3,
            occurrence: 2,
            certainly_faulty: if is_isolated { 0b10 } else { 0 },
            possibly_faulty: 0b11,
            channel: if is_isolated { 0 } else { NONE },
            ratio: f64::INFINITY,
            fault_estimate: 0.5,
            fault_estimate_half_width: f64::NAN,
        };
        self.writer.raise(&transition).to_string()
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_residual"));
        command
            .arg("alarms")
            .args(arguments)
            .env("RESIDUALD_RUNTIME_DIRECTORY", self.directory.path());
        command
    }

    /// Runs to the end: lines and exit code.
    fn run(&self, arguments: &[&str]) -> (Vec<String>, i32) {
        let Output { stdout, status, .. } = self.command(arguments).output().unwrap();
        let text = String::from_utf8(stdout).unwrap();
        (text.lines().map(String::from).collect(), status.code().unwrap())
    }
}

/// A line without its time.
fn parts(line: &str) -> Vec<&str> {
    let mut parts: Vec<_> = line.split("  ").collect();
    parts.remove(1);
    parts
}

#[test]
fn each_transition_is_a_line_with_number_diagnoser_state_faults_and_channel() {
    let mut daemon = Daemon::start();
    let (first, second) = (
        daemon.raise(1, AlarmState::Raised),
        daemon.raise(1, AlarmState::Isolated),
    );
    let third = daemon.raise(0, AlarmState::Cleared);
    let (lines, code) = daemon.run(&[]);
    assert_eq!(code, 0);
    assert_eq!(lines.len(), 3);
    assert_eq!(parts(&lines[0]), [&*first, "rear", "raised", "pump?, valve?"]);
    assert_eq!(
        parts(&lines[1]),
        [&*second, "rear", "isolated", "valve", "yaw at inf", "[latched]"]
    );
    let time = lines[1].split("  ").nth(1).unwrap();
    assert!(
        time.len() == 24 && time.starts_with("20") && time.ends_with('Z'),
        "{time}"
    );
    let numbers = |arguments: &[&str]| -> Vec<String> {
        let (lines, _) = daemon.run(arguments);
        lines
            .iter()
            .map(|line| line.split("  ").next().unwrap().into())
            .collect()
    };
    assert_eq!(numbers(&["--since", &second]), [&*third]);
    assert_eq!(numbers(&["--since", "now"]), [""; 0]);
    assert_eq!(numbers(&["--count", "2"]), [&*first, &second]);
    assert_eq!(numbers(&["--diagnoser", "front"]), [&*third]);
    assert_eq!(
        numbers(&["--state", "raised", "--state", "cleared"]),
        [&*first, &third]
    );
}

#[test]
fn json_has_every_field_and_one_object_a_line() {
    let mut daemon = Daemon::start();
    let number = daemon.raise(1, AlarmState::Isolated);
    let (lines, _) = daemon.run(&["--json"]);
    let [line] = lines.as_slice() else {
        panic!("{lines:?}")
    };
    let mut json: Value = serde_json::from_str(line).unwrap();
    let fields = json.as_object_mut().unwrap();
    assert!(fields.remove("time").is_some_and(|time| time.is_string()));
    assert!(fields.remove("written_ns").unwrap().as_u64().unwrap() <= monotonic_ns());
    let expected = serde_json::json!({
        "event": "transition", "number": number, "instant_ns": 70, "step": 7, "diagnoser": "rear",
        "state": "isolated", "verdict": "isolated", "flags": ["latched"], "occurrence": 2,
        "certainly_faulty": ["valve"], "possibly_faulty": ["pump", "valve"], "channel": "yaw", "ratio": "inf",
        "fault_estimate": 0.5, "fault_estimate_half_width": null,
    });
    assert_eq!(json, expected);
}

#[test]
fn what_is_lost_is_a_gap_whatever_is_filtered() {
    let mut daemon = Daemon::start();
    (0..20).for_each(|_| _ = daemon.raise(0, AlarmState::Raised));
    let epoch = daemon.writer.epoch();
    let since = format!("{epoch}.1");
    let (lines, _) = daemon.run(&["--since", &since, "--diagnoser", "rear"]);
    assert_eq!(lines, ["GAP: 3 transitions lost, numbers 2 to 4"]);
    let (lines, _) = daemon.run(&["--since", &since, "--json", "--count", "1"]);
    assert_eq!(lines, [r#"{"event":"gap","first":2,"last":4,"lost":3}"#]);
    let (lines, _) = daemon.run(&["--since", "5.9", "--count", "1"]);
    let expected = format!(
        "GAP: numbers begin anew with {epoch}.1; how many transitions are lost behind 5.9 is unknown"
    );
    assert_eq!(lines, [expected]);
}

#[test]
fn mistakes_and_an_ended_daemon_have_their_exit_codes() {
    let mut daemon = Daemon::start();
    daemon.raise(0, AlarmState::Raised);
    for arguments in [
        ["--since", "x"],
        ["--state", "on"],
        ["--diagnoser", "middle"],
        ["--count", "0"],
    ] {
        assert_eq!(daemon.run(&arguments).1, 2, "{arguments:?}");
    }
    assert_eq!(daemon.run(&["--instance", "other"]).1, 3);
    let said = |daemon: &Daemon, arguments: &[&str]| {
        let output = daemon.command(arguments).output().unwrap();
        String::from_utf8(output.stderr).unwrap()
    };
    assert!(said(&daemon, &["--instance", "other"]).contains("are test)\n"));
    assert_eq!(said(&daemon, &[]), "");
    assert!(said(&daemon, &["--since", "now"]).contains("runs and has no such alarm transition"));
    daemon.writer.close();
    assert!(said(&daemon, &[]).contains("does not run; these are transitions that it left"));
    assert!(said(&daemon, &["--since", "now"]).contains("does not run, and has left no such"));
    let (lines, code) = daemon.run(&[]);
    assert_eq!((lines.len(), code), (1, 3));
}

/// A running command, ended with the test.
struct Following(Child);

impl Drop for Following {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn follow_shows_transitions_as_they_come_over_a_restart() {
    let mut daemon = Daemon::start();
    let first = daemon.raise(0, AlarmState::Raised);
    let mut following = Following(
        daemon
            .command(&["--follow", "--count", "3"])
            .stdout(Stdio::piped())
            .spawn()
            .unwrap(),
    );
    let mut lines = BufReader::new(following.0.stdout.take().unwrap()).lines();
    let mut number = || {
        let line = lines.next().unwrap().unwrap();
        String::from(line.split("  ").next().unwrap())
    };
    assert_eq!(number(), first);
    assert_eq!(daemon.raise(0, AlarmState::Isolated), number());
    daemon.writer = Daemon::create(&daemon.directory);
    assert_eq!(daemon.raise(0, AlarmState::Cleared), number());
    assert_eq!(following.0.wait().unwrap().code(), Some(0));
}
