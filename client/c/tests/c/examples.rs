//! The examples for C, run against a table that the test writes.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, ChildStdout, Command, Stdio};

use residual_client::{Instance, RUNTIME_DIRECTORY_VARIABLE, StepRecord, Verdict, monotonic_ns};

use super::compiler::{Linked, compile};
use super::front_page;
use super::support::{daemon, instance, spec, transition};

/// A running example, ended with the test.
struct Example {
    child: Child,
    output: BufReader<ChildStdout>,
}

impl Drop for Example {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Example {
    fn start(program: &Path, instance: &Instance, arguments: &[&str]) -> Self {
        let mut child = Command::new(program)
            .arg(instance.name.to_string())
            .args(arguments)
            .env(RUNTIME_DIRECTORY_VARIABLE, &instance.runtime_directory)
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let output = BufReader::new(child.stdout.take().unwrap());
        Self { child, output }
    }

    /// Its lines up to the first one that holds `text`.
    fn lines_until(&mut self, text: &str) -> Vec<String> {
        let mut lines: Vec<String> = Vec::new();
        while lines.last().is_none_or(|line| !line.contains(text)) {
            let mut line = String::new();
            assert!(
                self.output.read_line(&mut line).unwrap() > 0,
                "`{text}` did not come: {lines:?}"
            );
            lines.push(line);
        }
        lines
    }
}

#[test]
fn poll_prints_the_newest_record_and_that_the_daemon_has_ended() {
    let folder = tempfile::tempdir().unwrap();
    let Some(program) = compile("examples/poll.c", Linked::Dynamically, &folder) else {
        return;
    };
    let (_directory, instance) = instance();
    let mut writer = daemon(&instance, &spec(&["a"], 16));
    let mut record = StepRecord::new(2);
    record.step = 41;
    record.verdict = Verdict::Fault as u32;
    record.instant_ns = monotonic_ns() + 3_600_000_000_000;
    record.channels_mut()[1].ratio = 1.25;
    writer.publish(0, &record);
    let mut example = Example::start(&program, &instance, &["a"]);
    example.lines_until("step 41: verdict 2, worst ratio 1.250");
    drop(writer);
    example.lines_until("no daemon");
}

#[test]
fn alarms_prints_transitions_gaps_and_what_comes_after_a_restart() {
    let folder = tempfile::tempdir().unwrap();
    let Some(program) = compile("examples/alarms.c", Linked::Statically, &folder) else {
        return;
    };
    let (_directory, instance) = instance();
    let mut first = daemon(&instance, &spec(&["a"], 16));
    (1..=17).for_each(|step| _ = first.raise(&transition(0, step)));
    let mut example = Example::start(&program, &instance, &[&first.epoch().to_string(), "0"]);
    let lines = example.lines_until(&format!("{}.17: a isolated [sensor 1]", first.epoch()));
    assert_eq!(
        (lines[0].as_str(), lines.len()),
        ("transitions 1 to 1 are lost\n", 17)
    );
    drop(first);
    let mut second = daemon(&instance, &spec(&["b"], 16));
    let number = second.raise(&transition(0, 1));
    example.lines_until(&format!("{number}: b isolated"));
}

#[test]
fn the_program_of_the_front_page_prints_record_and_alarms() {
    let (folder, program) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let source = folder.path().join("front_page.c");
    std::fs::write(&source, front_page::program("c")).unwrap();
    let Some(program) = compile(source.to_str().unwrap(), Linked::Dynamically, &program) else {
        return;
    };
    let output = front_page::run(&mut Command::new(program));
    assert_eq!(output, "fresh: ratio 0.25\n1: steering\n2: steering\n");
}
