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
    epoch: u64,
    records: RecordPublisher,
    input: SampleSubscriber,
    driver: SamplePublisher,
    steps: [u64; 2],
    node: Node,
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
        let table = table(&instance, ["front", "rear"]);
        Self {
            place: Place {
                instance: instance.clone(),
                directory,
            },
            instance,
            epoch: table.epoch(),
            table: Some(table),
            records,
            input,
            driver,
            steps: [0; 2],
            node,
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
        let step = self.steps[slot];
        self.steps[slot] += 1;
        self.send_record_of(slot, step);
    }

    /// The record of a diagnoser for this step, in the table and in the stream.
    pub fn send_record_of(&mut self, slot: usize, step: u64) {
        let mut record = StepRecord::new(1);
        record.step = step;
        record.instant_ns = monotonic_ns();
        record.verdict = Verdict::Nominal as u32;
        record.channels_mut()[0] = Channel {
            lower: -2.0,
            residual: 0.5,
            upper: 2.0,
            ratio: 0.25,
        };
        if let Some(table) = &mut self.table {
            table.publish(slot, &record);
            table.heartbeat(monotonic_ns());
        }
        self.records.send(self.epoch, slot, &record).unwrap();
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

    /// Goes on with another table, as a daemon does when it reads its configuration again.
    pub fn reload(&mut self, diagnosers: [&str; 2]) {
        let table = table(&self.instance, diagnosers);
        self.epoch = table.epoch();
        self.table = Some(table);
    }

    /// Ends and starts anew at once, with another table and another publisher.
    pub fn restart(&mut self, diagnosers: [&str; 2]) {
        self.close_table();
        self.records = RecordPublisher::create(&self.node, &self.instance).unwrap();
        self.reload(diagnosers);
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

fn table(instance: &Instance, diagnosers: [&str; 2]) -> TableWriter {
    let access = Access {
        group: None,
        mode: 0o600,
    };
    let spec = spec(&instance.name.to_string(), diagnosers);
    let table = TableWriter::create(&instance.bounds_path(), &spec, &access).unwrap();
    table.heartbeat(monotonic_ns());
    table
}

fn spec(instance: &str, diagnosers: [&str; 2]) -> TableSpec {
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
        slots: diagnosers.map(slot).into(),
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
