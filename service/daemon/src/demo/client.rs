//! The client process of the demonstration: polls the bounds table and shows what it reads.
//!
//! It is an ordinary client: it needs read permission for the table and nothing else.

use std::io::{self, Write};
use std::time::Duration;

use residual_client::{Monitor, MonitorError};
use residual_shared::bounds_table::{OpenError, SlotSpec};
use residual_shared::clock::monotonic_ns;
use residual_shared::record::{Channel, StepRecord, Verdict, flags};
use serde::{Deserialize, Serialize};

use super::Part;
use super::plant::{FIRST_FAULTY_TRANSITION, PERIOD_NS, STEPS};

/// The diagnoser of the embedded configuration.
const DIAGNOSER: &str = "aircraft_actuators";

/// Time between two polls: a tenth of the sampling period, so that no record is overwritten unread.
const POLL: Duration = Duration::from_millis(1);

/// How long after the last expected record the client gives up.
const PATIENCE_NS: u64 = 2_000_000_000;

/// Every how many records the channels are shown while nothing happens.
const SHOW_EVERY: u64 = 50;

/// Why polling failed.
#[derive(Debug, thiserror::Error)]
pub enum ClientError {
    /// There is no table.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// A record could not be read.
    #[error(transparent)]
    Read(#[from] MonitorError),
    /// Nothing can be shown.
    #[error("cannot write: {0}")]
    Write(#[from] io::Error),
}

/// What the client saw.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct ClientReport {
    /// Records read.
    pub records: u64,
    /// Records overwritten before they were read.
    pub missed: u64,
    /// Records with an alarm before the fault could be seen, or of the filter that ignores the faulty actuator.
    pub false_alarms: u64,
    /// The first alarm.
    pub first_alarm: Option<Alarm>,
    /// The first isolation.
    pub isolated: Option<Isolation>,
}

/// An alarm.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Alarm {
    /// The measurement y_k that caused it.
    pub k: u64,
    /// The filters that alarmed.
    pub by: String,
}

/// An isolation.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Isolation {
    /// The measurement y_k that decided it.
    pub k: u64,
    /// Bit j: actuator j + 1.
    pub actuators: u64,
    /// Names of those actuators.
    pub names: String,
}

impl ClientReport {
    /// Begins the line that carries the report.
    pub const PREFIX: &str = "report ";
}

/// Polls until the last record of the case, shows bounds on the way, and ends with the report.
pub fn execute(part: &Part, output: &mut impl Write) -> Result<(), ClientError> {
    let instance = part.instance();
    let mut monitor = Monitor::open(&instance)?;
    let followed = monitor.follow(DIAGNOSER)?;
    let slot = monitor.table().and_then(|table| {
        table
            .directory()
            .spec
            .slots
            .iter()
            .find(|slot| slot.name == DIAGNOSER)
            .cloned()
    });
    let mut viewer = Viewer {
        slot: slot.unwrap_or_else(no_slot),
        report: ClientReport::default(),
        part,
    };
    let mut record = StepRecord::new(0);
    let mut last_number = None;
    let end_ns = part.start_ns + STEPS * PERIOD_NS;
    while monotonic_ns() < end_ns + PATIENCE_NS {
        std::thread::sleep(POLL);
        let reading = monitor.read_followed(followed, &mut record)?;
        if reading.number == 0 || last_number == Some(reading.number) || record.instant_ns < part.start_ns {
            continue;
        }
        viewer.report.missed += last_number.map_or(0, |last: u64| reading.number.saturating_sub(last + 1));
        last_number = Some(reading.number);
        viewer.take(&record, output)?;
        if record.instant_ns >= end_ns {
            break;
        }
    }
    let report = serde_json::to_string(&viewer.report).map_err(io::Error::other)?;
    writeln!(output, "{}{report}", ClientReport::PREFIX)?;
    Ok(())
}

/// Stands in when the daemon has no such diagnoser; following it has failed then already.
fn no_slot() -> SlotSpec {
    SlotSpec {
        name: String::new(),
        method: String::new(),
        period_ns: PERIOD_NS,
        phase_ns: 0,
        margin_ns: 0,
        channels: Vec::new(),
        faults: Vec::new(),
    }
}

struct Viewer<'a> {
    slot: SlotSpec,
    report: ClientReport,
    part: &'a Part,
}

/// A filter of the bank by the prefix of its channels.
struct Filter {
    prefix: &'static str,
    title: &'static str,
    /// The actuator (from 0) whose faults the filter ignores.
    ignores: Option<u8>,
}

/// The filters of the bank, counted from 1 as in the paper.
const FILTERS: [Filter; 3] = [
    Filter {
        prefix: "mode_fault_free_",
        title: "fault-free filter",
        ignores: None,
    },
    Filter {
        prefix: "mode_0_",
        title: "filter 1",
        ignores: Some(0),
    },
    Filter {
        prefix: "mode_1_",
        title: "filter 2",
        ignores: Some(1),
    },
];

impl Viewer<'_> {
    fn take(&mut self, record: &StepRecord, output: &mut impl Write) -> io::Result<()> {
        let k = (record.instant_ns - self.part.start_ns) / PERIOD_NS;
        self.report.records += 1;
        let alarming: Vec<&Filter> = FILTERS
            .iter()
            .filter(|filter| self.alarms(filter, record))
            .collect();
        let faulty = self.part.case - 1;
        let impossible = alarming.iter().any(|filter| filter.ignores == Some(faulty));
        let alarm = record.flags & flags::ALARM_NOW != 0;
        self.report.false_alarms += u64::from(alarm && (k <= FIRST_FAULTY_TRANSITION || impossible));

        let mut show = k.is_multiple_of(SHOW_EVERY);
        if alarm && self.report.first_alarm.is_none() {
            let by = alarming
                .iter()
                .rev()
                .map(|filter| filter.title)
                .collect::<Vec<_>>()
                .join(" and ");
            self.report.first_alarm = Some(Alarm { k, by });
            show = true;
        }
        if record.verdict() == Verdict::Isolated && self.report.isolated.is_none() {
            let names = self.slot.faults.iter().enumerate();
            let names = names.filter(|(bit, _)| record.certainly_faulty >> bit & 1 == 1);
            let names = names.map(|(_, name)| name.as_str()).collect::<Vec<_>>().join("+");
            self.report.isolated = Some(Isolation {
                k,
                actuators: record.certainly_faulty,
                names,
            });
            show = true;
        }
        if show {
            self.show(k, record, output)
        } else {
            Ok(())
        }
    }

    fn alarms(&self, filter: &Filter, record: &StepRecord) -> bool {
        self.rows(filter, record).any(|(_, channel)| channel.ratio > 1.0)
    }

    /// The rows of one filter that were tested at this instant.
    fn rows<'a>(
        &'a self,
        filter: &'a Filter,
        record: &'a StepRecord,
    ) -> impl Iterator<Item = (&'a str, &'a Channel)> {
        self.slot
            .channels
            .iter()
            .zip(record.channels())
            .filter_map(|(description, channel)| {
                let row = description.name.strip_prefix(filter.prefix)?;
                (channel.is_evaluated() && !row.starts_with("fault_estimate")).then_some((row, channel))
            })
    }

    fn show(&self, k: u64, record: &StepRecord, output: &mut impl Write) -> io::Result<()> {
        let t = k as f64 * PERIOD_NS as f64 * 1e-9;
        writeln!(output, "k = {k:3}  t = {t:.2} s  {}", record.verdict().name())?;
        for filter in &FILTERS {
            write!(output, "  {:18}", filter.title)?;
            let (windows, rows): (Vec<_>, Vec<_>) = self
                .rows(filter, record)
                .partition(|(name, _)| name.starts_with("parity_"));
            for (name, channel) in rows {
                let mark = if channel.ratio > 1.0 { '!' } else { ' ' };
                let name = paper_name(name);
                write!(
                    output,
                    " {name} {:+.3} in ±{:.3}{mark}",
                    channel.residual, channel.upper
                )?;
            }
            // The tests over several samples have no unit that says much: the one closest to its bound stands for all.
            if let Some(ratio) = windows.iter().map(|(_, channel)| channel.ratio).reduce(f64::max) {
                let mark = if ratio > 1.0 { '!' } else { ' ' };
                write!(output, " windows {:3.0} % of bound{mark}", 100.0 * ratio)?;
            }
            writeln!(output)?;
        }
        Ok(())
    }
}

/// The short name of a row, outputs and actuators counted from 1 as in the paper: `y1`, `m2`.
fn paper_name(row: &str) -> String {
    let short = |prefix, letter| {
        let number: u32 = row.strip_prefix(prefix)?.parse().ok()?;
        Some(format!("{letter}{}", number + 1))
    };
    short("output_", 'y')
        .or_else(|| short("matched_", 'm'))
        .unwrap_or_else(|| row.into())
}
