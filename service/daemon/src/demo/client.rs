//! The client process of the demonstration: polls the bounds table, shows and reports what it reads.
//!
//! It is an ordinary client: it needs read permission for the table and nothing else.

use std::io::{self, Write};
use std::time::Duration;

use residual_client::{Followed, Monitor, MonitorError};
use residual_shared::bounds_table::{OpenError, SlotSpec};
use residual_shared::clock::monotonic_ns;
use residual_shared::record::{StepRecord, Verdict, flags};
use serde::{Deserialize, Serialize};

use super::Part;
use super::scenario::{self, Expectation, Scenario};
use super::view;

/// Time between two polls: a tenth of the shortest sampling period, so that no record is overwritten unread.
const POLL: Duration = Duration::from_micros(500);

/// How long after the last expected record the client gives up.
const PATIENCE_NS: u64 = 2_000_000_000;

/// How often a diagnoser is shown while nothing happens.
const SHOWN_TIMES: u64 = 8;

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

/// What the client saw of one diagnoser. Times are nanoseconds since the start of the scenario.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Seen {
    /// The diagnoser.
    pub diagnoser: String,
    /// Its sampling period, nanoseconds.
    pub period_ns: u64,
    /// Records read.
    pub records: u64,
    /// Records overwritten before they were read.
    pub missed: u64,
    /// Records with an alarm before the fault could be seen.
    pub false_alarms: u64,
    /// The first alarm since then, and the channels that showed it.
    pub detected: Option<(u64, Vec<String>)>,
    /// The first isolation since then, and the faults isolated.
    pub isolated: Option<(u64, Vec<String>)>,
    /// The last estimate of the isolated fault and its half width.
    pub estimate: Option<(f64, f64)>,
}

/// Begins the line that carries the report, a list of [`Seen`].
pub const REPORT: &str = "report ";

/// Polls until the last record of every scenario, shows records on the way, and ends with the report.
pub fn execute(part: &Part, output: &mut impl Write) -> Result<(), ClientError> {
    let mut monitor = Monitor::open(&part.instance())?;
    let time = monitor.table().map(|table| table.directory().spec.time);
    let scenarios = part.scenarios.iter().filter_map(|name| scenario::named(name));
    let mut viewers = Vec::new();
    for scenario in scenarios {
        for expectation in scenario.expectations {
            let followed = monitor.follow(expectation.diagnoser)?;
            let slots = monitor.table().map(|table| &table.directory().spec.slots);
            let slot = slots.and_then(|slots| slots.iter().find(|slot| slot.name == expectation.diagnoser));
            viewers.extend(
                slot.map(|slot| Viewer::new(followed, slot.clone(), scenario, expectation, part.start_ns)),
            );
        }
    }
    let end_ns = viewers
        .iter()
        .map(|viewer| viewer.end_ns)
        .max()
        .unwrap_or(part.start_ns);
    let limit_ns = time.map_or(0, |time| time.to_monotonic(end_ns)) + PATIENCE_NS;
    let mut record = StepRecord::new(0);
    while monotonic_ns() < limit_ns && viewers.iter().any(|viewer| !viewer.finished) {
        std::thread::sleep(POLL);
        for viewer in &mut viewers {
            let number = monitor.read_followed(viewer.followed, &mut record)?.number;
            viewer.take(number, &record, output)?;
        }
    }
    let report: Vec<Seen> = viewers.into_iter().map(|viewer| viewer.seen).collect();
    let report = serde_json::to_string(&report).map_err(io::Error::other)?;
    writeln!(output, "{REPORT}{report}")?;
    Ok(())
}

/// Follows one diagnoser.
struct Viewer {
    followed: Followed,
    slot: SlotSpec,
    start_ns: u64,
    onset_ns: u64,
    end_ns: u64,
    last_number: u64,
    next_shown_ns: u64,
    finished: bool,
    seen: Seen,
}

impl Viewer {
    fn new(
        followed: Followed,
        slot: SlotSpec,
        scenario: &Scenario,
        expectation: &Expectation,
        start_ns: u64,
    ) -> Self {
        let after_start = |seconds: f64| start_ns + (seconds * 1e9).round() as u64;
        Self {
            followed,
            start_ns,
            onset_ns: after_start(expectation.onset_s),
            end_ns: after_start(scenario.duration_s),
            last_number: 0,
            next_shown_ns: start_ns,
            finished: false,
            seen: Seen {
                diagnoser: slot.name.clone(),
                period_ns: slot.period_ns,
                ..Seen::default()
            },
            slot,
        }
    }

    /// Takes the record with this number, unless it was seen before.
    fn take(&mut self, number: u64, record: &StepRecord, output: &mut impl Write) -> io::Result<()> {
        if number == 0 || number == self.last_number || record.instant_ns < self.start_ns || self.finished {
            return Ok(());
        }
        if self.last_number > 0 {
            self.seen.missed += number.saturating_sub(self.last_number + 1);
        }
        self.last_number = number;
        self.seen.records += 1;
        self.finished = record.instant_ns + self.slot.period_ns > self.end_ns;
        let news = self.note(record);
        if news || record.instant_ns >= self.next_shown_ns {
            self.next_shown_ns = record.instant_ns + (self.end_ns - self.start_ns) / SHOWN_TIMES;
            let since_start_ns = record.instant_ns - self.start_ns;
            writeln!(output, "{}", view::line(&self.slot, since_start_ns, record))?;
        }
        Ok(())
    }

    /// Notes alarms and isolations; true if the record has something new.
    fn note(&mut self, record: &StepRecord) -> bool {
        let since_start_ns = record.instant_ns - self.start_ns;
        let alarm = record.flags & flags::ALARM_NOW != 0;
        if record.instant_ns < self.onset_ns {
            self.seen.false_alarms += u64::from(alarm);
            return alarm;
        }
        let mut news = false;
        let isolated = record.verdict() == Verdict::Isolated;
        if (alarm || isolated) && self.seen.detected.is_none() {
            self.seen.detected = Some((since_start_ns, view::violated(&self.slot, record)));
            news = true;
        }
        if isolated {
            if self.seen.isolated.is_none() {
                self.seen.isolated =
                    Some((since_start_ns, view::faults(&self.slot, record.certainly_faulty)));
                news = true;
            }
            if record.fault_estimate.is_finite() {
                self.seen.estimate = Some((record.fault_estimate, record.fault_estimate_half_width));
            }
        }
        news
    }
}
