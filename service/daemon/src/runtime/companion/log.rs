//! Changes of verdict and of the counters, for the log.

use residual_shared::counters::{InputCounters, ScheduleCounters};
use residual_shared::record::{StepRecord, Verdict, fault_names};
use tracing::{info, warn};

use crate::runtime::live::CounterReport;

/// Names for the log.
#[derive(Clone, Debug)]
pub struct LogNames {
    /// Diagnosers by slot, each with its fault names.
    pub diagnosers: Vec<(String, Vec<String>)>,
    /// Inputs in order.
    pub inputs: Vec<String>,
}

/// Writes what changes to the log.
pub(super) struct ChangeLog {
    names: LogNames,
    last_verdicts: Vec<Option<(Verdict, u64)>>,
}

impl ChangeLog {
    pub(super) fn new(names: LogNames) -> Self {
        Self {
            last_verdicts: vec![None; names.diagnosers.len()],
            names,
        }
    }

    /// Writes a line if the verdict of the diagnoser in `slot` has changed.
    pub(super) fn record(&mut self, slot: usize, record: &StepRecord) {
        let now = (record.verdict(), record.certainly_faulty);
        let (Some(last), Some((name, faults))) =
            (self.last_verdicts.get_mut(slot), self.names.diagnosers.get(slot))
        else {
            return;
        };
        if last.replace(now) == Some(now) {
            return;
        }
        let faulty: Vec<&str> = fault_names(faults, record.certainly_faulty).collect();
        let (step, verdict) = (record.step, now.0.name());
        match now.0 {
            Verdict::Fault | Verdict::Isolated | Verdict::GuaranteeLost => {
                let possibly: Vec<&str> = fault_names(faults, record.possibly_faulty).collect();
                warn!(diagnoser = name, step, verdict, ?faulty, ?possibly);
            }
            _ => info!(diagnoser = name, step, verdict),
        }
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
                let name = self
                    .names
                    .diagnosers
                    .get(*slot)
                    .map_or("?", |(name, _)| name.as_str());
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
