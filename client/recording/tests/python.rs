//! The official Python library of MCAP reads a recording.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use std::path::{Path, PathBuf};
use std::process::Command;

use common::{alarm, header, record, sample};
use residual_recording::{Totals, Writer};
use residual_shared::alarm::AlarmState;

/// Reads the recording and prints what the test compares.
const SCRIPT: &str = r#"
import json, sys
from mcap.reader import make_reader
with open(sys.argv[1], "rb") as file:
    reader = make_reader(file, validate_crcs=True)
    summary = reader.get_summary()
    counts = {summary.channels[id].topic: count for id, count in summary.statistics.channel_message_counts.items()}
    messages = [(schema.encoding, channel.topic, message.log_time, message.publish_time, json.loads(message.data))
                for schema, channel, message in reader.iter_messages(log_time_order=False)]
    fields = {schema.name: json.loads(schema.data)["properties"] for schema in summary.schemas.values()}
    metadata = {record.name: record.metadata for record in reader.iter_metadata()}
record = next(message for message in messages if message[1] == "/vtol/records/front")
alarm = next(message[4] for message in messages if message[1] == "/vtol/alarms")
sample = next(message for message in messages if message[1] == "/vtol/samples/imu")
def paths(fields, prefix=""):
    for name, field in fields.items():
        yield from paths(field["properties"], prefix + name + ".") if "properties" in field else [prefix + name]
print(json.dumps({
    "counts": counts,
    "encodings": sorted({message[0] for message in messages}),
    "instance": metadata["residual.recording"]["instance"],
    "missing": json.loads(metadata["residual.totals"]["topics"])["/vtol/records/front"]["missing"],
    "log_time": record[2], "publish_time": record[3],
    "residuals": [m[4]["channels"]["force"]["residual"] for m in messages if m[1] == "/vtol/records/front"],
    "yaw": record[4]["channels"]["yaw rate"], "faults": record[4]["certainly_faulty"],
    "alarm": [alarm["state"], alarm["diagnoser"], alarm["channel"], alarm["fault_estimate_half_width"]],
    "signals": sample[4]["signals"], "fields": sorted(paths(fields["residual.records.front"])),
}))
"#;

/// A Python with the package `mcap`: the system's, or one in an environment that is kept for later runs.
fn python() -> Option<PathBuf> {
    let works = |python: &Path| {
        let import = Command::new(python).args(["-c", "import mcap.reader"]).output();
        import.is_ok_and(|output| output.status.success())
    };
    let system = PathBuf::from("python3");
    if works(&system) {
        return Some(system);
    }
    let environment = Path::new(env!("CARGO_TARGET_TMPDIR")).join("python-mcap");
    let own = environment.join("bin/python");
    if !works(&own) {
        let make = Command::new(&system)
            .args(["-m", "venv"])
            .arg(&environment)
            .output();
        make.ok().filter(|output| output.status.success())?;
        let install = ["-m", "pip", "install", "--quiet", "--timeout", "10", "mcap"];
        Command::new(&own).args(install).output().ok()?;
    }
    works(&own).then_some(own)
}

#[test]
fn the_official_library_reads_the_same_counts_values_and_fields() {
    let Some(python) = python() else {
        eprintln!("SKIPPED: there is no python3 with the package `mcap`, and it cannot be installed");
        return;
    };
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("recording.mcap");
    let mut writer = Writer::create(&path, header(), &[0, 1], true).unwrap();
    for step in [0, 1, 2, 5] {
        writer
            .write_record(&record(0, step), 1_000_000_000 + 10_000_000 * step + 2_000_000)
            .unwrap();
    }
    writer.flush().unwrap();
    writer.write_record(&record(1, 0), 0).unwrap();
    writer.write_sample(&sample(0, 77, &[0.1, -1e-7])).unwrap();
    writer
        .write_alarm(&alarm(AlarmState::Isolated), 1_000_000_500)
        .unwrap();
    let topics = writer.topics();
    writer
        .finish(&Totals {
            topics,
            ..Totals::default()
        })
        .unwrap();

    let output = Command::new(python)
        .args(["-c", SCRIPT])
        .arg(&path)
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let said: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let expected = serde_json::json!({
        "counts": { "/vtol/records/front": 4, "/vtol/records/rear": 1, "/vtol/samples/imu": 1, "/vtol/alarms": 1 },
        "encodings": ["jsonschema"],
        "instance": "vtol",
        "missing": 2,
        "log_time": 1_764_000_001_002_000_000_u64,
        "publish_time": 1_764_000_001_000_000_000_u64,
        "residuals": [0.0, 0.1, 0.2, 0.5],
        "yaw": { "lower": 0.0, "residual": 0.0, "upper": 0.0, "ratio": null },
        "faults": ["valve \"2\""],
        "alarm": ["isolated", "front", "yaw rate", "inf"],
        "signals": { "ax": 0.1, "ay": -1e-7 },
        "fields": said["fields"],
    });
    assert_eq!(said, expected);
    let fields: Vec<&str> = said["fields"]
        .as_array()
        .unwrap()
        .iter()
        .map(|field| field.as_str().unwrap())
        .collect();
    for field in [
        "channels.force.residual",
        "channels.yaw rate.ratio",
        "verdict_number",
        "instant_ns",
    ] {
        assert!(fields.contains(&field), "{field} in {fields:?}");
    }
}
