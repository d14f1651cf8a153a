//! Daemons, publishers and clients as real processes, each instance in a directory of its own.
#![allow(dead_code)] // Every test file compiles this module for itself and uses a part of it.

pub mod daemon;
pub mod helper;
pub mod publisher;
pub mod scalar;

use std::fs;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

use residual_shared::bounds_table::TableReader;
use residual_shared::counters::{InputCounters, ScheduleCounters};
use residual_shared::names::Instance;
use tempfile::TempDir;
use toml::{Table, Value};

/// The configuration that users start from.
const VTOL: &str = include_str!("../../../../deploy/config/vtol.toml");

/// The diagnoser of [`VTOL`].
pub const DIAGNOSER: &str = "aircraft_actuators";
/// The inputs of [`VTOL`].
pub const INPUTS: [&str; 2] = ["aircraft_sensors", "aircraft_commands"];
/// The sampling period of [`VTOL`], nanoseconds.
pub const PERIOD_NS: u64 = 10_000_000;

/// What may take this long fails the test; generous, because tests share a machine with others.
pub const PATIENCE: Duration = Duration::from_secs(20);

/// An instance that nobody else uses; everything of it disappears with this value.
pub struct Stage {
    /// The instance's runtime directory.
    pub directory: TempDir,
    /// Files of the test itself.
    pub files: TempDir,
    /// The instance.
    pub instance: Instance,
    /// The daemon's configuration: that of the aircraft, to be changed by the test.
    pub configuration: Table,
}

impl Stage {
    /// An instance with the aircraft's configuration.
    pub fn new() -> Self {
        static NEXT: AtomicU32 = AtomicU32::new(0);
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        let name = format!("test{}-{number}", std::process::id());
        let directory = tempfile::Builder::new()
            .prefix("rt-")
            .tempdir_in("/dev/shm")
            .unwrap();
        let mut stage = Self {
            instance: Instance::new(name.parse().unwrap(), directory.path()),
            directory,
            files: tempfile::tempdir().unwrap(),
            configuration: VTOL.parse().unwrap(),
        };
        stage.set("daemon", "instance", name);
        // Tests change the model: the example's gains do not belong to it then.
        stage.configuration["daemon"]
            .as_table_mut()
            .unwrap()
            .remove("gains_file");
        let path = stage.instance.runtime_directory.display().to_string();
        stage.set("daemon", "runtime_directory", path);
        stage
    }

    /// Sets a key of a section.
    pub fn set(&mut self, section: &str, key: &str, value: impl Into<Value>) {
        self.configuration[section]
            .as_table_mut()
            .unwrap()
            .insert(key.into(), value.into());
    }

    /// Sets a key of the first diagnoser.
    pub fn set_diagnoser(&mut self, key: &str, value: impl Into<Value>) {
        self.diagnosers()[0]
            .as_table_mut()
            .unwrap()
            .insert(key.into(), value.into());
    }

    /// The diagnosers of the configuration.
    pub fn diagnosers(&mut self) -> &mut Vec<Value> {
        self.configuration["diagnoser"].as_array_mut().unwrap()
    }

    /// The configuration as a file.
    pub fn configuration_file(&self) -> PathBuf {
        let path = self.files.path().join("configuration.toml");
        fs::write(&path, self.configuration.to_string()).unwrap();
        path
    }

    /// The table of the latest life of the daemon.
    pub fn table(&self) -> TableReader {
        TableReader::open(&self.instance.bounds_path()).unwrap()
    }

    /// Counters of an input.
    pub fn input_counters(&self, input: usize) -> InputCounters {
        self.table().read_input_counters(input).unwrap()
    }

    /// Counters of the first diagnoser.
    pub fn schedule_counters(&self) -> ScheduleCounters {
        self.table().read_schedule_counters(0).unwrap()
    }

    /// Names of the files in the runtime directory, sorted.
    pub fn runtime_files(&self) -> Vec<String> {
        let entries = fs::read_dir(self.directory.path()).unwrap();
        let mut names: Vec<String> = entries
            .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }

    /// iceoryx2's shared memory of the instance.
    pub fn shared_memory_files(&self) -> Vec<PathBuf> {
        files_with_prefix(&self.instance.iceoryx_prefix())
    }

    /// What an instance leaves after a clean stop: the closed table, so that clients can tell the end, and the
    /// lock file, which no process holds.
    pub fn assert_only_table_and_lock_are_left(&self) {
        let name = &self.instance.name;
        let expected = [
            format!("residuald.{name}.bounds"),
            format!("residuald.{name}.lock"),
        ];
        assert_eq!(self.runtime_files(), expected);
        assert_eq!(self.shared_memory_files(), Vec::<PathBuf>::new());
    }
}

impl Drop for Stage {
    fn drop(&mut self) {
        for path in self.shared_memory_files() {
            let _ = fs::remove_file(path);
        }
    }
}

/// Files in /dev/shm that begin with `prefix`.
pub fn files_with_prefix(prefix: &str) -> Vec<PathBuf> {
    let entries = fs::read_dir("/dev/shm").unwrap().flatten();
    entries
        .filter(|entry| entry.file_name().to_string_lossy().starts_with(prefix))
        .map(|entry| entry.path())
        .collect()
}

/// Waits until `condition` gives a value.
pub fn wait_for<T>(what: &str, mut condition: impl FnMut() -> Option<T>) -> T {
    let begin = Instant::now();
    loop {
        if let Some(value) = condition() {
            return value;
        }
        assert!(begin.elapsed() < PATIENCE, "waited in vain: {what}");
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// Waits until `condition` holds.
pub fn wait_until(what: &str, mut condition: impl FnMut() -> bool) {
    wait_for(what, || condition().then_some(()));
}

/// Whether the tests run as root; says that a test was skipped if not.
pub fn is_root() -> bool {
    let root = nix::unistd::Uid::effective().is_root();
    if !root {
        eprintln!("SKIPPED: only root can act as other users and mount file systems");
    }
    root
}
