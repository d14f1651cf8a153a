//! The Python example that publishes samples and takes step records, with a real daemon.
//!
//! Needs a Python with the package `iceoryx2` 0.10.0: `RESIDUAL_PYTHON`, or `python3`.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod support;

use std::process::{Command, Stdio};

use residual_client::RUNTIME_DIRECTORY_VARIABLE;
use serde_json::Value;
use support::daemon::{Daemon, finish};
use support::{INPUTS, Stage};

/// A Python that has iceoryx2; none, with a note, where there is none.
fn python() -> Option<Command> {
    let program = std::env::var("RESIDUAL_PYTHON").unwrap_or_else(|_| "python3".into());
    let mut probe = Command::new(&program);
    probe
        .args(["-c", "import iceoryx2"])
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    if probe.status().is_ok_and(|status| status.success()) {
        return Some(Command::new(program));
    }
    eprintln!(
        "SKIPPED: `{program}` has no package iceoryx2; `pip install iceoryx2==0.10.0`, or name a Python that has it in \
         RESIDUAL_PYTHON"
    );
    None
}

#[test]
fn python_publishes_to_the_daemon_and_takes_every_step_record() {
    let Some(mut python) = python() else { return };
    let stage = Stage::new();
    let daemon = Daemon::start(&stage);
    python
        .arg(concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../client/python/examples/publish_and_record.py"
        ))
        .args([stage.instance.name.to_string(), "2".into()])
        .args([format!("{}=4", INPUTS[0]), format!("{}=2", INPUTS[1])])
        .env(RUNTIME_DIRECTORY_VARIABLE, stage.directory.path());
    let finished = finish(&mut python);
    assert_eq!(finished.code, Some(0), "{}", finished.messages);
    let lines = finished
        .output
        .lines()
        .map(|line| serde_json::from_str(line).unwrap());
    let lines: Vec<Value> = lines.collect();
    let (total, records) = lines.split_last().unwrap();
    assert_eq!(total["published"], 200);
    assert_eq!(total["lost"], 0);
    assert_eq!(total["received"], records.len());
    let steps: Vec<_> = records
        .iter()
        .map(|record| record["step"].as_u64().unwrap())
        .collect();
    assert!(steps.is_sorted_by(|left, right| left < right), "{steps:?}");
    // The filter begins with the first complete packet, and the aircraft is at rest.
    let nominal = records.iter().filter(|record| record["verdict"] == 1).count();
    assert!(nominal > 50, "{nominal} of {}", records.len());
    assert!(
        records
            .iter()
            .all(|record| record["verdict"] != 2 && record["verdict"] != 3)
    );
    let door = stage.input_counters(0);
    assert_eq!((door.accepted, door.lost), (200, 0), "{door:?}");
    daemon.stop();
}
