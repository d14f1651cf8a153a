//! What was detected in each run, and how much of each kind of run.

use residual_diagnosis::diagnoser::Description;
use serde::Serialize;

use super::outcome::{Outcome, RunOutcome, median};
use residual_shared::record::fault_names;

/// Stands for all diagnosers together in the totals: what the first of them detects is detected.
const ANY_DIAGNOSER: &str = "(any)";

/// Stands for all kinds of runs together in the totals.
const EVERY_KIND: &str = "(all)";

/// What one diagnoser made of one run. Times in seconds of the recording.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// The run.
    pub run: String,
    /// Its kind.
    pub kind: String,
    /// The diagnoser.
    pub diagnoser: String,
    /// When the fault begins, since the start of the run.
    pub onset_s: Option<f64>,
    /// Time from the onset to the alarm.
    pub detected_after_s: Option<f64>,
    /// Time from the onset to the isolation.
    pub isolated_after_s: Option<f64>,
    /// The faults isolated, joined by `+`.
    pub isolated: Option<String>,
    /// Steps with an alarm before the onset; all of a run without fault.
    pub false_alarms: u64,
}

/// What one diagnoser made of all runs of one kind.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Total {
    /// The kind of run.
    pub kind: String,
    /// The diagnoser.
    pub diagnoser: String,
    /// Runs of this kind.
    pub runs: usize,
    /// Those with a fault.
    pub faulty: usize,
    /// Faults detected.
    pub detected: usize,
    /// The median of the delays.
    pub median_delay_s: Option<f64>,
    /// Faults isolated, rightly or not.
    pub isolated: usize,
    /// Runs with an alarm before the onset, or with any alarm without fault.
    pub runs_with_false_alarms: usize,
}

/// The outcomes of all runs.
pub struct Detections<'a> {
    pub(super) diagnosers: &'a [(String, Description)],
    pub(super) runs: &'a [RunOutcome],
}

impl<'a> Detections<'a> {
    /// The detections in these runs; their outcomes are in the order of the diagnosers.
    pub fn new(diagnosers: &'a [(String, Description)], runs: &'a [RunOutcome]) -> Self {
        Self { diagnosers, runs }
    }

    /// A row for each run and diagnoser.
    pub fn rows(&self) -> Vec<Row> {
        let rows_of = |run: &'a RunOutcome| {
            let diagnosers = self.diagnosers.iter().zip(&run.outcomes);
            diagnosers.map(move |((name, description), outcome)| {
                let after = |at_ns: u64| run.onset_ns.map(|onset_ns| seconds(at_ns - onset_ns));
                let isolated = outcome.isolated.map(|(at_ns, faults)| {
                    let names: Vec<_> = fault_names(&description.faults, faults).collect();
                    (after(at_ns), names.join("+"))
                });
                Row {
                    run: run.run.clone(),
                    kind: run.kind.clone(),
                    diagnoser: name.clone(),
                    onset_s: run.onset_ns.map(seconds),
                    detected_after_s: outcome.detected_ns.and_then(after),
                    isolated_after_s: isolated.as_ref().and_then(|(after_s, _)| *after_s),
                    isolated: isolated.map(|(_, names)| names),
                    false_alarms: outcome.false_alarms,
                }
            })
        };
        self.runs.iter().flat_map(rows_of).collect()
    }

    /// The totals of each kind, in the order of their first runs, and of all kinds; diagnoser by diagnoser, and of
    /// all diagnosers together.
    pub fn totals(&self) -> Vec<Total> {
        let mut kinds: Vec<&str> = Vec::new();
        for run in self.runs {
            if !kinds.contains(&run.kind.as_str()) {
                kinds.push(&run.kind);
            }
        }
        let mut groups: Vec<(&str, Vec<&RunOutcome>)> = kinds
            .iter()
            .map(|kind| (*kind, self.runs.iter().filter(|run| run.kind == *kind).collect()))
            .collect();
        if groups.len() > 1 {
            groups.push((EVERY_KIND, self.runs.iter().collect()));
        }
        let mut totals = Vec::new();
        for (kind, runs) in &groups {
            let slots = self.diagnosers.iter().enumerate();
            totals.extend(slots.map(|(slot, (name, _))| total(kind, name, runs, slot..slot + 1)));
            if self.diagnosers.len() > 1 {
                totals.push(total(kind, ANY_DIAGNOSER, runs, 0..self.diagnosers.len()));
            }
        }
        totals
    }
}

/// The totals of some runs by the diagnosers in some slots together.
fn total(kind: &str, diagnoser: &str, runs: &[&RunOutcome], slots: std::ops::Range<usize>) -> Total {
    let outcomes = |run: &'_ RunOutcome| -> Vec<Outcome> {
        let of = run.outcomes.get(slots.clone());
        of.map(<[Outcome]>::to_vec).unwrap_or_default()
    };
    let delay_ns = |run: &RunOutcome| {
        let first = outcomes(run)
            .iter()
            .filter_map(|outcome| outcome.detected_ns)
            .min();
        Some(first? - run.onset_ns?)
    };
    let count = |holds: &dyn Fn(&Outcome) -> bool| {
        let runs = runs.iter();
        runs.filter(|run| outcomes(run).iter().any(holds)).count()
    };
    let delays: Vec<u64> = runs.iter().filter_map(|run| delay_ns(run)).collect();
    Total {
        kind: kind.into(),
        diagnoser: diagnoser.into(),
        runs: runs.len(),
        faulty: runs.iter().filter(|run| run.onset_ns.is_some()).count(),
        detected: delays.len(),
        median_delay_s: median(delays).map(seconds),
        isolated: count(&|outcome| outcome.isolated.is_some()),
        runs_with_false_alarms: count(&|outcome| outcome.false_alarms > 0),
    }
}

fn seconds(nanoseconds: u64) -> f64 {
    nanoseconds as f64 / 1e9
}

#[cfg(test)]
mod tests {
    use super::*;

    fn description(faults: &[&str]) -> Description {
        Description {
            method: "test",
            channels: Vec::new(),
            faults: faults.iter().map(|&fault| fault.into()).collect(),
            measurement_count: 0,
            command_count: 0,
            packets: None,
        }
    }

    fn outcome(detected_s: Option<u64>, isolated: Option<u64>, false_alarms: u64) -> Outcome {
        let detected_ns = detected_s.map(|at| at * 1_000_000_000);
        Outcome {
            detected_ns,
            isolated: isolated.and_then(|faults| Some((detected_ns?, faults))),
            false_alarms,
            ..Outcome::default()
        }
    }

    fn run(run: &str, kind: &str, onset_s: Option<u64>, outcomes: [Outcome; 2]) -> RunOutcome {
        RunOutcome {
            run: run.into(),
            kind: kind.into(),
            onset_ns: onset_s.map(|at| at * 1_000_000_000),
            outcomes: outcomes.into(),
        }
    }

    #[test]
    fn totals_count_what_each_and_what_any_diagnoser_found() {
        let diagnosers = [
            ("roll".to_owned(), description(&["aileron", "rudder"])),
            ("climb".into(), description(&[])),
        ];
        let runs = [
            run(
                "1",
                "stuck",
                Some(10),
                [outcome(Some(14), Some(0b10), 0), outcome(Some(12), None, 0)],
            ),
            run(
                "2",
                "stuck",
                Some(10),
                [outcome(None, None, 0), outcome(Some(15), None, 3)],
            ),
            run(
                "3",
                "none",
                None,
                [outcome(None, None, 1), outcome(None, None, 0)],
            ),
        ];
        let detections = Detections::new(&diagnosers, &runs);
        let totals = detections.totals();
        let of = |kind: &str, diagnoser: &str| {
            let mut totals = totals.iter();
            let found = totals.find(|total| total.kind == kind && total.diagnoser == diagnoser);
            let total = found.unwrap();
            (
                total.detected,
                total.median_delay_s,
                total.isolated,
                total.runs_with_false_alarms,
            )
        };
        assert_eq!(of("stuck", "roll"), (1, Some(4.0), 1, 0));
        assert_eq!(of("stuck", "climb"), (2, Some(2.0), 0, 1));
        assert_eq!(of("stuck", ANY_DIAGNOSER), (2, Some(2.0), 1, 1));
        assert_eq!(of("none", ANY_DIAGNOSER), (0, None, 0, 1));
        assert_eq!(of(EVERY_KIND, ANY_DIAGNOSER), (2, Some(2.0), 1, 2));
        assert_eq!(detections.rows()[0].isolated.as_deref(), Some("rudder"));
    }
}
