//! A table and a writer that play a daemon.
#![allow(dead_code)] // Every test binary compiles this module for itself and uses a part of it.

use residual_client::{
    AlarmState, AlarmTransition, ChannelSpec, DaemonTime, InputSpec, Instance, SlotSpec, TableSpec,
    monotonic_ns,
};
use residual_shared::bounds_table::{Access, TableWriter};
use tempfile::TempDir;

/// Only the daemon's user reads.
pub const OWN: Access = Access {
    group: None,
    mode: 0o600,
};

/// A directory on a tmpfs and an instance in it.
pub fn instance() -> (TempDir, Instance) {
    let directory = tempfile::Builder::new()
        .prefix("residuald-test-")
        .tempdir_in("/dev/shm")
        .unwrap();
    let instance = Instance::new("test".parse().unwrap(), directory.path());
    (directory, instance)
}

/// A diagnoser with two channels and three faults.
pub fn slot(name: &str) -> SlotSpec {
    let channel = |name: &str, unit: &str| ChannelSpec {
        name: name.into(),
        unit: unit.into(),
    };
    SlotSpec {
        name: name.into(),
        method: "chi_square".into(),
        period_ns: 10_000_000,
        phase_ns: 0,
        margin_ns: 1_000_000,
        channels: vec![channel("yaw rate", "rad/s"), channel("χ²", "")],
        faults: ["actuator 1", "sensor 1", "sensor 2"].map(String::from).to_vec(),
    }
}

/// A table of these diagnosers with an alarm ring of this capacity.
pub fn spec(names: &[&str], alarm_capacity: u32) -> TableSpec {
    TableSpec {
        instance: "test".into(),
        slots: names.iter().map(|name| slot(name)).collect(),
        inputs: vec![InputSpec {
            name: "imu".into(),
            signals: vec!["ax".into(), "ay".into()],
        }],
        time: DaemonTime::MONOTONIC,
        schedule_epoch_ns: 0,
        stale_after_periods: 3,
        alarm_capacity,
    }
}

/// A new life of the daemon, which counts as alive for an hour.
pub fn daemon(instance: &Instance, spec: &TableSpec) -> TableWriter {
    let writer = TableWriter::create(&instance.bounds_path(), spec, &OWN).unwrap();
    writer.heartbeat(monotonic_ns() + 3_600_000_000_000);
    writer
}

/// A transition of the diagnoser in `slot` that carries `step`.
pub fn transition(slot: u32, step: u64) -> AlarmTransition {
    AlarmTransition {
        number: Default::default(),
        written_ns: 0,
        instant_ns: 10 * step,
        step,
        slot,
        identity: 0,
        state: AlarmState::Isolated,
        flags: 1,
        verdict: 3,
        occurrence: step,
        certainly_faulty: 0b010,
        possibly_faulty: 0b110,
        channel: 1,
        ratio: 1.5,
        fault_estimate: -0.25,
        fault_estimate_half_width: 0.125,
    }
}
