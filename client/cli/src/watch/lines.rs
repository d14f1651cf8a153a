//! One line for each new record and each change of an alarm, for files and pipes.

use std::collections::HashMap;
use std::fmt::Write as _;
use std::io::{self, Write};
use std::thread::sleep;
use std::time::Duration;

use residual_client::{AlarmState, Monitor};

use super::WatchOptions;
use crate::error::Error;
use crate::snapshot::{AlarmView, DiagnoserView, Snapshot};
use crate::status::faults;

/// What was written last of a diagnoser.
#[derive(Clone, Copy, PartialEq)]
struct Seen {
    epoch: u64,
    record: u64,
    freshness: &'static str,
    alarm: AlarmView,
}

/// Writes lines until the count is reached or nobody reads them.
pub fn run(monitor: &mut Monitor, options: &WatchOptions) -> Result<u8, Error> {
    let mut seen: HashMap<String, Seen> = HashMap::new();
    let mut left = options.count;
    let mut output = io::stdout().lock();
    loop {
        if let Some(snapshot) = Snapshot::take(monitor)? {
            let watched = |diagnoser: &&DiagnoserView| options.is_watched(diagnoser);
            for diagnoser in snapshot.diagnosers.iter().filter(watched) {
                let now = Seen {
                    epoch: snapshot.epoch,
                    record: diagnoser.record,
                    freshness: diagnoser.freshness,
                    alarm: diagnoser.alarm,
                };
                let before = seen.insert(diagnoser.name.clone(), now);
                if before == Some(now) {
                    continue;
                }
                writeln!(
                    output,
                    "{}",
                    line(diagnoser, before.filter(|before| before.epoch == now.epoch))
                )?;
                left = left.map(|left| left - 1);
                if left == Some(0) {
                    output.flush()?;
                    return Ok(0);
                }
            }
        }
        output.flush()?;
        sleep(Duration::from_millis(options.interval));
    }
}

/// A line for a new record, or for another freshness or alarm of the known one.
fn line(diagnoser: &DiagnoserView, before: Option<Seen>) -> String {
    let DiagnoserView {
        name,
        freshness,
        record,
        verdict,
        step,
        instant_ns,
        alarm,
        ..
    } = diagnoser;
    let mut line = format!("{name} {freshness}");
    if alarm.state != AlarmState::Cleared || before.is_some_and(|before| before.alarm != *alarm) {
        line = format!("{line} | alarm {}", alarm.text());
    }
    if *record == 0 || before.is_some_and(|before| before.record == *record) {
        return line;
    }
    // Writing to a String does not fail.
    let _ = write!(
        line,
        " | step {step} at {:.6} s | {verdict}",
        *instant_ns as f64 * 1e-9
    );
    let faults = faults(diagnoser);
    if !faults.is_empty() {
        let _ = write!(line, ": {faults}");
    }
    for channel in &diagnoser.channels {
        let [lower, residual, upper, ratio] =
            [channel.lower, channel.residual, channel.upper, channel.ratio].map(|number| number.short());
        let unit = if channel.unit.is_empty() {
            String::new()
        } else {
            format!(" {}", channel.unit)
        };
        let _ = write!(
            line,
            " | {} {residual} in [{lower}, {upper}]{unit} ratio {ratio}",
            channel.name
        );
    }
    let missed = before.map_or(0, |before| record.saturating_sub(before.record + 1));
    if missed > 0 {
        let _ = write!(line, " | {missed} missed");
    }
    line
}
