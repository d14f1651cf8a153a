//! Changes of the counters, for the log.

use residual_shared::counters::{InputCounters, ScheduleCounters};
use tracing::warn;

use crate::runtime::live::CounterReport;

/// Names for the log.
#[derive(Clone, Debug)]
pub struct LogNames {
    /// Diagnosers by slot.
    pub diagnosers: Vec<String>,
    /// Inputs in order.
    pub inputs: Vec<String>,
}

/// Writes what changes to the log.
pub(super) struct ChangeLog {
    names: LogNames,
}

impl ChangeLog {
    pub(super) fn new(names: LogNames) -> Self {
        Self { names }
    }

    /// Writes a line for each counter that tells of a loss or a delay.
    pub(super) fn counters(&self, report: &CounterReport) {
        match report {
            CounterReport::Input { input, before, now } => {
                let name = self.names.inputs.get(*input).map_or("?", String::as_str);
                for (counter, from, to) in changes(InputCounters::NAMES, &before.to_words(), &now.to_words())
                {
                    if counter != "accepted" {
                        warn!(input = name, counter, added = to - from, total = to);
                    }
                }
            }
            CounterReport::Schedule { slot, before, now } => {
                let name = self.names.diagnosers.get(*slot).map_or("?", String::as_str);
                for (counter, from, to) in
                    changes(ScheduleCounters::NAMES, &before.to_words(), &now.to_words())
                {
                    if matches!(counter, "overruns" | "skipped" | "records_dropped") {
                        warn!(diagnoser = name, counter, added = to - from, total = to);
                    }
                }
            }
        }
    }
}

fn changes<'a>(
    names: &'a [&'static str],
    before: &'a [u64],
    now: &'a [u64],
) -> impl Iterator<Item = (&'static str, u64, u64)> + 'a {
    names
        .iter()
        .zip(before.iter().zip(now))
        .filter(|(_, (from, to))| from != to)
        .map(|(&name, (&from, &to))| (name, from, to))
}
