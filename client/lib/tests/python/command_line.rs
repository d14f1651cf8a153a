//! `python3 -m residual_client`, and waiting in Python.

use std::io::{BufRead, BufReader};
use std::process::{Output, Stdio};
use std::thread;
use std::time::Duration;

use residual_client::{Instance, StepRecord, Verdict, monotonic_ns};

use super::front_page;
use super::support::{daemon, instance, spec, transition};

/// Runs `python3 -m residual_client`: all that it wrote, and its exit code.
fn run(instance: &Instance, arguments: &[&str]) -> (String, i32) {
    let Output {
        stdout,
        stderr,
        status,
    } = super::python()
        .unwrap()
        .args(["-m", "residual_client"])
        .args(arguments)
        .args(["--instance", "test", "--runtime-directory"])
        .arg(&instance.runtime_directory)
        .output()
        .unwrap();
    let text = String::from_utf8(stdout).unwrap() + &String::from_utf8(stderr).unwrap();
    (text, status.code().unwrap())
}

#[test]
fn status_and_alarms_show_what_there_is_and_tell_it_by_the_exit_code() {
    if super::python().is_none() {
        return;
    }
    let (_directory, instance) = instance();
    let (text, code) = run(&instance, &["status"]);
    assert!(
        code == 3 && text.contains("is the daemon running"),
        "{code}: {text}"
    );
    let mut writer = daemon(&instance, &spec(&["a"], 16));
    assert_eq!(run(&instance, &["status"]).1, 5);
    let mut record = StepRecord::new(2);
    record.instant_ns = monotonic_ns() + 3_600_000_000_000;
    record.certainly_faulty = 0b10;
    for (verdict, code) in [
        (Verdict::Nominal, 0),
        (Verdict::Isolated, 4),
        (Verdict::GuaranteeLost, 5),
    ] {
        record.verdict = verdict as u32;
        writer.publish(0, &record);
        let (text, found) = run(&instance, &["status"]);
        assert_eq!(found, code, "{text}");
        assert!(text.contains(verdict.name()), "{text}");
    }
    (0..17).for_each(|step| _ = writer.raise(&transition(0, step)));
    let epoch = writer.epoch();
    let (text, code) = run(&instance, &["alarms", "--since", &format!("{epoch}.0")]);
    assert_eq!(code, 0);
    assert!(text.starts_with("GAP: 1 lost, numbers 1 to 1\n"), "{text}");
    assert!(
        text.ends_with(&format!("{epoch}.17  a  isolated  sensor 1\n")),
        "{text}"
    );
    assert_eq!(run(&instance, &["alarms", "--since", "x"]).1, 2);
    writer.close();
    assert_eq!(run(&instance, &["alarms"]).1, 3);
}

#[test]
fn a_sleeping_python_is_woken_by_a_transition_and_waits_no_longer_than_told() {
    let Some(mut python) = super::python() else { return };
    let (_directory, instance) = instance();
    let mut writer = daemon(&instance, &spec(&["a"], 16));
    let script = "
import sys, time
from residual_client import AlarmListener
listener = AlarmListener('test', sys.argv[1], start='now')
for timeout in (0.0, 0.03, 0.25):
    begin = time.monotonic()
    assert listener.wait(timeout) is None
    assert timeout <= time.monotonic() - begin < timeout + 2
print('ready', flush=True)
begin = time.monotonic()
event = listener.wait(20.0)
assert event.step == 9, event
print(time.monotonic() - begin)
";
    let mut child = python
        .args(["-c", script])
        .arg(&instance.runtime_directory)
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap())
        .lines()
        .map(Result::unwrap);
    assert_eq!(lines.next().as_deref(), Some("ready"));
    // Long enough for Python to fall asleep; if it is slower, it hears the transition all the same.
    thread::sleep(Duration::from_millis(50));
    writer.raise(&transition(0, 9));
    let waited: f64 = lines.next().unwrap().parse().unwrap();
    assert!(waited < 10.0, "{waited}");
    assert!(child.wait().unwrap().success());
}

#[test]
fn the_program_of_the_front_page_prints_record_and_alarms() {
    let Some(mut python) = super::python() else { return };
    let output = front_page::run(python.args(["-c", &front_page::program("python")]));
    assert!(
        output.starts_with("fresh: (0, Channel(lower=-1.0, residual=0.25, upper=1.0, ratio=0.25))\n"),
        "{output}"
    );
    assert_eq!(output.matches("\nTransition(").count(), 2, "{output}");
}
