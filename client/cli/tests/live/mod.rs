//! A daemon that the test plays, with everything a recorder takes from it.
#![allow(dead_code)] // Not every test file needs every part.

use std::path::PathBuf;
use std::process::Command;
use std::sync::atomic::{AtomicU32, Ordering};

use residual_shared::alarm::{AlarmState, AlarmTransition, alarm_flags};
use residual_shared::bounds_table::{Access, ChannelSpec, InputSpec, SlotSpec, TableSpec, TableWriter};
use residual_shared::clock::{DaemonTime, monotonic_ns};
use residual_shared::names::Instance;
use residual_shared::record::{Channel, StepRecord, Verdict};
use residual_shared::transport::{self, Node, RecordPublisher, SamplePublisher, SampleSubscriber};
use tempfile::TempDir;

/// The diagnosers `front` and `rear` (one channel each), and the input `imu`.
pub struct Live {
    /// The instance.
    pub instance: Instance,
    table: Option<TableWriter>,
    records: RecordPublisher,
    input: SampleSubscriber,
    driver: SamplePublisher,
    steps: [u64; 2],
    _node: Node,
    // After all that lies in it.
    place: Place,
}

impl Live {
    pub fn start() -> Self {
        let directory = tempfile::Builder::new()
            .prefix("rt-")
            .tempdir_in("/dev/shm")
            .unwrap();
        // iceoryx2's memory lies in /dev/shm whatever the directory: each daemon has a name of its own there.
        static NEXT: AtomicU32 = AtomicU32::new(0);
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        let name = format!("test{}-{number}", std::process::id());
        let instance = Instance::new(name.parse().unwrap(), directory.path());
        let node = transport::open_node(&instance).unwrap();
        let records = RecordPublisher::create(&node, &instance).unwrap();
        let input = SampleSubscriber::create(&node, &instance, "imu", 64, 2).unwrap();
        let driver = SamplePublisher::open(&node, &instance, "imu").unwrap();
        let access = Access {
            group: None,
            mode: 0o600,
        };
        let table = TableWriter::create(&instance.bounds_path(), &spec(&name), &access).unwrap();
        table.heartbeat(monotonic_ns());
        Self {
            place: Place {
                instance: instance.clone(),
                directory,
            },
            instance,
            table: Some(table),
            records,
            input,
            driver,
            steps: [0; 2],
            _node: node,
        }
    }

    /// `residual` with these arguments.
    pub fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_residual"));
        command
            .args(arguments)
            .env("RESIDUALD_RUNTIME_DIRECTORY", self.place.directory.path());
        command
    }

    /// A file beside those of the instance.
    pub fn file(&self, name: &str) -> PathBuf {
        self.place.directory.path().join(name)
    }

    /// The next record of a diagnoser, in the table and in the stream.
    pub fn send_record(&mut self, slot: usize) {
        let mut record = StepRecord::new(1);
        record.step = self.steps[slot];
        record.instant_ns = monotonic_ns();
        record.verdict = Verdict::Nominal as u32;
        record.channels_mut()[0] = Channel {
            lower: -2.0,
            residual: 0.5,
            upper: 2.0,
            ratio: 0.25,
        };
        self.steps[slot] += 1;
        if let Some(table) = &mut self.table {
            table.publish(slot, &record);
            table.heartbeat(monotonic_ns());
        }
        self.records.send(slot, &record).unwrap();
    }

    /// The alarm of the first diagnoser is raised and latched.
    pub fn raise_alarm(&mut self, occurrence: u64) {
        let transition = AlarmTransition {
            number: Default::default(),
            written_ns: 0,
            instant_ns: monotonic_ns(),
            step: 0,
            slot: 0,
            identity: 0,
            state: AlarmState::Raised,
            flags: alarm_flags::LATCHED,
            verdict: Verdict::Fault as u32,
            occurrence,
            certainly_faulty: 0,
            possibly_faulty: 1,
            channel: 0,
            ratio: 1.5,
            fault_estimate: f64::NAN,
            fault_estimate_half_width: f64::NAN,
        };
        if let Some(table) = &mut self.table {
            table.raise(&transition);
        }
    }

    /// The next sample of the input.
    pub fn send_sample(&mut self) {
        self.driver.send(monotonic_ns(), &[0.25]).unwrap();
        self.input.receive(|_, _, _| ());
    }

    /// Closes the table, as a daemon does at its end.
    pub fn close_table(&mut self) {
        self.table = None;
    }
}

/// The runtime directory of an instance, removed with all that iceoryx2 has left elsewhere.
struct Place {
    instance: Instance,
    directory: TempDir,
}

impl Drop for Place {
    fn drop(&mut self) {
        transport::remove_leftovers(&self.instance).unwrap();
    }
}

fn spec(instance: &str) -> TableSpec {
    let slot = |name: &str| SlotSpec {
        name: name.into(),
        method: "chi_square".into(),
        period_ns: 10_000_000,
        phase_ns: 0,
        margin_ns: 0,
        channels: vec![ChannelSpec {
            name: "force".into(),
            unit: "N".into(),
        }],
        faults: vec!["pump".into()],
    };
    TableSpec {
        instance: instance.into(),
        slots: vec![slot("front"), slot("rear")],
        inputs: vec![InputSpec {
            name: "imu".into(),
            signals: vec!["ax".into()],
        }],
        time: DaemonTime::MONOTONIC,
        schedule_epoch_ns: 0,
        stale_after_periods: 100,
        alarm_capacity: 64,
    }
}
