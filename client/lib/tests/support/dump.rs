//! What a client in another language reads, as text, and what it should read.
//!
//! The client is a program `PROGRAM INSTANCE DIRECTORY EPOCH NUMBER` that listens to the alarms behind that number and
//! obeys commands on its standard input, one a line, each answered by lines and a final `.`:
//!
//! | command | answer |
//! |---|---|
//! | `records` | daemon state and epoch, each diagnoser with channels, faults and its newest record |
//! | `alarms N` | the next N events, for each of which it waits up to 20 s |
//! | `account N` | hears events up to number N, each of which must follow on the one before: how many came, how many lie in gaps |
//!
//! Numbers with a fraction are written as the 16 hexadecimal digits of their bits.

use std::fmt::Write as _;
use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use residual_client::{Alarm, AlarmEvent, Instance, Reading, SlotSpec, StepRecord};

/// A running client, ended with the test.
pub struct Dump {
    child: Child,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
}

impl Drop for Dump {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Dump {
    /// Starts the client with `command`.
    pub fn start(command: &mut Command, instance: &Instance, epoch: u64, number: u64) -> Self {
        let mut child = command
            .arg(instance.name.to_string())
            .arg(&instance.runtime_directory)
            .args([epoch.to_string(), number.to_string()])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        Self {
            input: child.stdin.take().unwrap(),
            output: BufReader::new(child.stdout.take().unwrap()),
            child,
        }
    }

    /// The answer to a command, without its final line.
    pub fn ask(&mut self, command: &str) -> String {
        writeln!(self.input, "{command}").unwrap();
        let mut answer = String::new();
        loop {
            let mut line = String::new();
            assert!(
                self.output.read_line(&mut line).unwrap() > 0,
                "the client ended after {answer}"
            );
            if line == ".\n" {
                return answer;
            }
            answer += &line;
        }
    }
}

/// A number as its bits.
pub fn bits(number: f64) -> String {
    format!("{:016x}", number.to_bits())
}

/// What `records` says about one diagnoser.
pub fn diagnoser(slot: &SlotSpec, reading: &Reading, record: &StepRecord) -> String {
    let mut text = String::new();
    let SlotSpec {
        name,
        method,
        period_ns,
        phase_ns,
        margin_ns,
        ..
    } = slot;
    writeln!(
        text,
        "diagnoser {name} {method} {period_ns} {phase_ns} {margin_ns}"
    )
    .unwrap();
    for channel in &slot.channels {
        writeln!(text, "channel {} [{}]", channel.name, channel.unit).unwrap();
    }
    for fault in &slot.faults {
        writeln!(text, "fault {fault}").unwrap();
    }
    writeln!(
        text,
        "reading {} {} {}",
        reading.freshness.name(),
        reading.number,
        reading.epoch
    )
    .unwrap();
    if reading.number == 0 {
        return text;
    }
    let StepRecord {
        step,
        instant_ns,
        certainly_faulty,
        possibly_faulty,
        inputs_valid,
        ..
    } = record;
    writeln!(
        text,
        "record {step} {instant_ns} {certainly_faulty} {possibly_faulty} {inputs_valid}"
    )
    .unwrap();
    let (estimate, half_width) = (
        bits(record.fault_estimate),
        bits(record.fault_estimate_half_width),
    );
    let StepRecord {
        verdict,
        flags,
        skipped_instants,
        ..
    } = record;
    writeln!(
        text,
        "more {estimate} {half_width} {verdict} {flags} {skipped_instants}"
    )
    .unwrap();
    for channel in record.channels() {
        let values = [channel.lower, channel.residual, channel.upper, channel.ratio].map(bits);
        writeln!(text, "values {}", values.join(" ")).unwrap();
    }
    text
}

/// What `alarms` says about one event.
pub fn event(event: &AlarmEvent) -> String {
    match event {
        AlarmEvent::Transition(alarm) => transition(alarm),
        AlarmEvent::Gap { first, last } => format!("gap {first} {last}\n"),
        AlarmEvent::NewNumbering { previous, origin } => format!("new numbering {previous} {origin}\n"),
    }
}

fn transition(alarm: &Alarm) -> String {
    let one = &alarm.transition;
    let numbers = [
        one.written_ns,
        one.instant_ns,
        one.step,
        one.state as u64,
        u64::from(one.flags),
        u64::from(one.verdict),
        u64::from(one.channel),
        one.occurrence,
        one.certainly_faulty,
        one.possibly_faulty,
    ];
    let numbers = numbers.map(|number| number.to_string()).join(" ");
    let values = [one.ratio, one.fault_estimate, one.fault_estimate_half_width]
        .map(bits)
        .join(" ");
    let faults: String = alarm
        .certainly_faulty()
        .map(|name| format!(" <{name}>"))
        .collect();
    let diagnoser = alarm.diagnoser_name().unwrap_or_default();
    let channel = alarm.channel().map_or("", |channel| &channel.name);
    format!(
        "transition {} {numbers} {values} [{diagnoser}] [{channel}]{faults}\n",
        one.number
    )
}
