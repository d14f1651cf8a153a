//! The examples, run against a table that the test writes.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod support;

use std::io::{BufRead, BufReader};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};

use residual_client::{Instance, RUNTIME_DIRECTORY_VARIABLE, StepRecord, Verdict, monotonic_ns};
use support::{daemon, instance, spec, transition};

/// A running example, ended with the test.
struct Example(Child);

impl Drop for Example {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Example {
    /// Starts an example; cargo has built it beside the tests.
    fn start(name: &str, instance: &Instance, arguments: &[&str]) -> Self {
        let test = std::env::current_exe().unwrap();
        let directory: PathBuf = test.ancestors().nth(2).unwrap().join("examples");
        let child = Command::new(directory.join(name))
            .arg(instance.name.to_string())
            .args(arguments)
            .env(RUNTIME_DIRECTORY_VARIABLE, &instance.runtime_directory)
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        Self(child)
    }

    /// Its lines up to the first one that holds `text`.
    fn lines_until(&mut self, text: &str) -> Vec<String> {
        let mut lines = Vec::new();
        for line in BufReader::new(self.0.stdout.as_mut().unwrap()).lines() {
            lines.push(line.unwrap());
            if lines.last().unwrap().contains(text) {
                return lines;
            }
        }
        panic!("`{text}` did not come: {lines:?}");
    }
}

#[test]
fn poll_prints_the_newest_record_and_that_the_daemon_has_ended() {
    let (_directory, instance) = instance();
    let mut writer = daemon(&instance, &spec(&["a"], 16));
    let mut record = StepRecord::new(2);
    record.step = 41;
    record.verdict = Verdict::Fault as u32;
    record.instant_ns = monotonic_ns() + 3_600_000_000_000;
    writer.publish(0, &record);
    let mut example = Example::start("poll", &instance, &["a"]);
    example.lines_until("step 41: fault, worst ratio 0.000");
    drop(writer);
    example.lines_until("no daemon: Closed");
}

#[test]
fn alarms_prints_transitions_gaps_and_what_comes_after_a_restart() {
    let (_directory, instance) = instance();
    let mut first = daemon(&instance, &spec(&["a"], 16));
    (1..=17).for_each(|step| _ = first.raise(&transition(0, step)));
    let since = format!("{}.0", first.epoch());
    let mut example = Example::start("alarms", &instance, &[&since]);
    let lines = example.lines_until(&format!("{}.17: a isolated [\"sensor 1\"]", first.epoch()));
    assert_eq!(lines[0], "transitions 1 to 1 are lost");
    assert_eq!(lines.len(), 17);
    drop(first);
    let mut second = daemon(&instance, &spec(&["b"], 16));
    let number = second.raise(&transition(0, 1));
    example.lines_until(&format!("{number}: b isolated"));
}

#[cfg(feature = "transport")]
#[test]
fn records_prints_every_record() {
    use residual_shared::transport::{RecordPublisher, open_node, remove_leftovers};

    let directory = tempfile::Builder::new()
        .prefix("rsd")
        .tempdir_in("/dev/shm")
        .unwrap();
    let name = format!("example-{}", std::process::id());
    let instance = Instance::new(name.parse().unwrap(), directory.path());
    {
        let node = open_node(&instance).unwrap();
        let mut daemon = RecordPublisher::create(&node, &instance).unwrap();
        let mut example = Example::start("records", &instance, &[]);
        // Whether it has subscribed already shows by the first record that it prints.
        let is_sending = std::sync::atomic::AtomicBool::new(true);
        std::thread::scope(|scope| {
            let reader = scope.spawn(|| {
                let lines = example.lines_until("epoch 4, diagnoser 2, step 7: starting");
                is_sending.store(false, std::sync::atomic::Ordering::Relaxed);
                lines
            });
            let mut record = StepRecord::new(0);
            record.step = 7;
            while is_sending.load(std::sync::atomic::Ordering::Relaxed) && !reader.is_finished() {
                daemon.send(4, 2, &record).unwrap();
                std::thread::sleep(std::time::Duration::from_millis(10));
            }
            reader.join().unwrap();
        });
    }
    remove_leftovers(&instance).unwrap();
}
