//! A daemon's bounds table, written by the test, and the binary that looks at it.
#![allow(dead_code)] // each test binary uses a part of it

use std::path::Path;
use std::process::{Command, Output};

use residual_shared::bounds_table::{Access, ChannelSpec, InputSpec, SlotSpec, TableSpec, TableWriter};
use residual_shared::clock::{DaemonTime, monotonic_ns};
use residual_shared::names::Instance;
use residual_shared::record::{Channel, StepRecord, Verdict};
use tempfile::TempDir;

/// A daemon as its clients see it: a bounds table that the test writes.
pub struct Daemon {
    pub directory: TempDir,
    pub writer: TableWriter,
}

impl Daemon {
    /// A daemon with the diagnosers `front` (two channels) and `rear` (none), and the input `imu`.
    pub fn start() -> Self {
        let directory = tempfile::Builder::new()
            .prefix("residuald-test-")
            .tempdir_in("/dev/shm")
            .unwrap();
        let writer = Self::create(directory.path(), "test");
        Self { directory, writer }
    }

    pub fn create(directory: &Path, name: &str) -> TableWriter {
        let channel = |name: &str, unit: &str| ChannelSpec {
            name: name.into(),
            unit: unit.into(),
        };
        let slot = |name: &str, channels| SlotSpec {
            name: name.into(),
            method: "chi_square".into(),
            period_ns: 10_000_000_000,
            phase_ns: 0,
            margin_ns: 0,
            channels,
            faults: vec!["pump".into(), "valve".into()],
        };
        let spec = TableSpec {
            instance: name.into(),
            slots: vec![
                slot("front", vec![channel("force", "N"), channel("yaw", "rad/s")]),
                slot("rear", vec![]),
            ],
            inputs: vec![InputSpec {
                name: "imu".into(),
                signals: vec!["ax".into()],
            }],
            time: DaemonTime::MONOTONIC,
            schedule_epoch_ns: 0,
            stale_after_periods: 100,
            alarm_capacity: 64,
        };
        let path = Instance::new(name.parse().unwrap(), directory).bounds_path();
        TableWriter::create(
            &path,
            &spec,
            &Access {
                group: None,
                mode: 0o600,
            },
        )
        .unwrap()
    }

    pub fn publish(&mut self, slot: usize, step: u64, verdict: Verdict, channels: &[Channel]) {
        self.publish_at(monotonic_ns(), slot, step, verdict, channels);
    }

    pub fn publish_at(
        &mut self,
        instant_ns: u64,
        slot: usize,
        step: u64,
        verdict: Verdict,
        channels: &[Channel],
    ) {
        let mut record = StepRecord::new(channels.len());
        record.step = step;
        record.instant_ns = instant_ns;
        record.verdict = verdict as u32;
        record.certainly_faulty = 0b10;
        record.possibly_faulty = 0b11;
        record.channels_mut().copy_from_slice(channels);
        self.writer.publish(slot, &record);
    }

    pub fn publish_nominal(&mut self) {
        self.publish(0, 1, Verdict::Nominal, &NOMINAL);
        self.publish(1, 1, Verdict::Nominal, &[]);
    }

    pub fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_residual"));
        command
            .args(arguments)
            .env("RESIDUALD_RUNTIME_DIRECTORY", self.directory.path());
        command
    }

    pub fn run(&self, arguments: &[&str]) -> Output {
        self.command(arguments).output().unwrap()
    }
}

/// One channel within its bounds, and one that was not evaluated.
pub const NOMINAL: [Channel; 2] = [
    Channel {
        lower: -2.0,
        residual: 0.5,
        upper: 2.0,
        ratio: 0.25,
    },
    Channel::NOT_EVALUATED,
];
