//! An alarm event as a line of text, or of JSON.

use std::io::{self, Write};
use std::time::{Duration, SystemTime};

use residual_client::{Alarm, AlarmEvent, Verdict, alarm_flags, monotonic_ns};
use serde::Serialize;
use time::format_description::BorrowedFormatItem;
use time::macros::format_description;
use time::{OffsetDateTime, UtcOffset};

use crate::number::Number;

/// Writes an event as one line.
pub fn write(output: &mut impl Write, event: &AlarmEvent, json: bool) -> io::Result<()> {
    let line = Line::of(event);
    if json {
        serde_json::to_writer(&mut *output, &line)?;
        writeln!(output)
    } else {
        line.write_text(output)
    }
}

/// An event for JSON.
#[derive(Debug, Serialize)]
#[serde(tag = "event", rename_all = "snake_case")]
enum Line<'a> {
    Transition(Box<Transition<'a>>),
    Gap { first: u64, last: u64, lost: u64 },
    NewNumbering { previous: String, origin: u64 },
}

/// A transition for JSON.
#[derive(Debug, Serialize)]
struct Transition<'a> {
    /// `EPOCH.NUMBER`, as `--since` takes it.
    number: String,
    /// Wall-clock time at which it was written.
    time: String,
    written_ns: u64,
    instant_ns: u64,
    step: u64,
    /// None: the daemon has no such diagnoser any more.
    diagnoser: Option<&'a str>,
    state: &'static str,
    verdict: &'static str,
    flags: Vec<&'static str>,
    occurrence: u64,
    certainly_faulty: Vec<&'a str>,
    possibly_faulty: Vec<&'a str>,
    channel: Option<&'a str>,
    ratio: Number,
    fault_estimate: Number,
    fault_estimate_half_width: Number,
}

impl<'a> Line<'a> {
    fn of(event: &'a AlarmEvent) -> Self {
        match event {
            AlarmEvent::Transition(alarm) => Self::Transition(Box::new(Transition::of(alarm))),
            AlarmEvent::Gap { first, last } => Self::Gap {
                first: *first,
                last: *last,
                lost: last - first + 1,
            },
            AlarmEvent::NewNumbering { previous, origin } => Self::NewNumbering {
                previous: previous.to_string(),
                origin: *origin,
            },
        }
    }

    fn write_text(&self, output: &mut impl Write) -> io::Result<()> {
        match self {
            Self::Transition(transition) => transition.write_text(output),
            Self::Gap { first, last, lost } => {
                let plural = if *lost == 1 { "" } else { "s" };
                writeln!(
                    output,
                    "GAP: {lost} transition{plural} lost, numbers {first} to {last}"
                )
            }
            Self::NewNumbering { previous, origin } => writeln!(
                output,
                "GAP: numbers begin anew with {origin}.1; how many transitions are lost behind {previous} is unknown"
            ),
        }
    }
}

impl<'a> Transition<'a> {
    fn of(alarm: &'a Alarm) -> Self {
        let transition = &alarm.transition;
        let verdict = Verdict::from_number(transition.verdict).unwrap_or(Verdict::NotEvaluated);
        Self {
            number: transition.number.to_string(),
            // It fails for years above 9999 only.
            time: wall_clock(transition.written_ns).format(TIME).unwrap_or_default(),
            written_ns: transition.written_ns,
            instant_ns: transition.instant_ns,
            step: transition.step,
            diagnoser: alarm.diagnoser_name(),
            state: transition.state.name(),
            verdict: verdict.name(),
            flags: alarm_flags::names(transition.flags).collect(),
            occurrence: transition.occurrence,
            certainly_faulty: alarm.certainly_faulty().collect(),
            possibly_faulty: alarm.possibly_faulty().collect(),
            channel: alarm.channel().map(|channel| channel.name.as_str()),
            ratio: Number(transition.ratio),
            fault_estimate: Number(transition.fault_estimate),
            fault_estimate_half_width: Number(transition.fault_estimate_half_width),
        }
    }

    fn write_text(&self, output: &mut impl Write) -> io::Result<()> {
        let Self {
            number, time, state, ..
        } = self;
        let diagnoser = self.diagnoser.unwrap_or("(a diagnoser that is gone)");
        write!(output, "{number}  {time}  {diagnoser}  {state}")?;
        if !self.certainly_faulty.is_empty() {
            write!(output, "  {}", self.certainly_faulty.join(", "))?;
        } else if !self.possibly_faulty.is_empty() {
            write!(output, "  {}?", self.possibly_faulty.join("?, "))?;
        }
        if let Some(channel) = self.channel {
            write!(output, "  {channel} at {}", self.ratio.short())?;
        }
        if !self.flags.is_empty() {
            write!(output, "  [{}]", self.flags.join(", "))?;
        }
        writeln!(output)
    }
}

const TIME: &[BorrowedFormatItem<'static>] =
    format_description!("[year]-[month]-[day]T[hour]:[minute]:[second].[subsecond digits:3]Z");

/// A moment of CLOCK_MONOTONIC on the wall clock (UTC), as that goes now.
pub fn wall_clock(written_ns: u64) -> OffsetDateTime {
    let age = Duration::from_nanos(monotonic_ns().saturating_sub(written_ns));
    let moment = SystemTime::now()
        .checked_sub(age)
        .unwrap_or(SystemTime::UNIX_EPOCH);
    OffsetDateTime::from(moment).to_offset(UtcOffset::UTC)
}
