//! What the runs of a replay showed, in words.

use std::fmt::Write as _;

use residual_diagnosis::diagnoser::Description;
use residual_shared::alarm::AlarmTransition;

use super::outcome::{Outcome, RunOutcome, median};
use super::records::ReplayRecord;
use super::run::Run;
use residual_shared::record::fault_names;

/// Collects the outcomes of the runs and puts them into words.
pub struct Report {
    diagnosers: Vec<(String, Description)>,
    runs: Vec<RunOutcome>,
}

impl Report {
    /// A report without runs on these diagnosers, in the order of their slots.
    pub fn new(diagnosers: Vec<(String, Description)>) -> Self {
        Self {
            diagnosers,
            runs: Vec::new(),
        }
    }

    /// The diagnosers.
    pub fn diagnosers(&self) -> &[(String, Description)] {
        &self.diagnosers
    }

    /// The runs so far.
    pub fn runs(&self) -> &[RunOutcome] {
        &self.runs
    }

    /// Begins a run whose fault begins at `onset_ns`, if it has one.
    pub fn begin(&mut self, run: &Run, onset_ns: Option<u64>) {
        self.runs.push(RunOutcome {
            run: run.name.clone(),
            kind: run.kind.clone(),
            onset_ns,
            outcomes: vec![Outcome::default(); self.diagnosers.len()],
        });
    }

    /// Takes the next record of the run that was begun last.
    pub fn take(&mut self, run: &Run, replayed: &ReplayRecord) {
        if let Some(current) = self.runs.last_mut() {
            let at_ns = run.recorded_at_ns(replayed.record.instant_ns);
            current.outcomes[replayed.slot].take(&replayed.record, at_ns, current.onset_ns);
        }
    }

    /// Takes the next transition of an alarm in the run that was begun last.
    pub fn take_alarm(&mut self, run: &Run, transition: &AlarmTransition) {
        if let Some(current) = self.runs.last_mut() {
            let at_ns = run.recorded_at_ns(transition.instant_ns);
            if let Some(outcome) = current.outcomes.get_mut(transition.slot as usize) {
                outcome.take_alarm(transition, at_ns, current.onset_ns);
            }
        }
    }

    /// The lines about the last run, one a diagnoser.
    pub fn last_run(&self) -> String {
        let mut text = String::new();
        let Some(last) = self.runs.last() else {
            return text;
        };
        for ((name, description), outcome) in self.diagnosers.iter().zip(&last.outcomes) {
            if !last.run.is_empty() {
                let _ = write!(text, "run {} · ", last.run);
            }
            let _ = writeln!(text, "{name}: {}", describe(description, outcome, last.onset_ns));
        }
        text
    }

    /// The lines about all runs together.
    pub fn totals(&self) -> String {
        let mut text = String::new();
        for (slot, (name, description)) in self.diagnosers.iter().enumerate() {
            // Writing to a text cannot fail.
            let _ = self.total(&mut text, slot, name, description);
        }
        text
    }

    fn total(
        &self,
        text: &mut String,
        slot: usize,
        name: &str,
        description: &Description,
    ) -> std::fmt::Result {
        let outcomes = || self.runs.iter().map(|run| (&run.outcomes[slot], run.onset_ns));
        let sum = |of: fn(&Outcome) -> u64| outcomes().map(|(outcome, _)| of(outcome)).sum::<u64>();
        let count = |of: &dyn Fn(&Outcome) -> bool| outcomes().filter(|(outcome, _)| of(outcome)).count();
        let runs = self.runs.len();
        writeln!(
            text,
            "{name}: {runs} runs, {} steps, {} evaluated, {} false alarms in {} runs",
            sum(|outcome| outcome.steps),
            sum(|outcome| outcome.evaluated),
            sum(|outcome| outcome.false_alarms),
            count(&|outcome| outcome.false_alarms > 0),
        )?;
        writeln!(
            text,
            "{name}: alarm raised {} times and cleared {} times",
            sum(|outcome| outcome.raised),
            sum(|outcome| outcome.cleared),
        )?;
        let faulty = outcomes().filter(|(_, onset_ns)| onset_ns.is_some()).count();
        if faulty == 0 {
            return Ok(());
        }
        let delays: Vec<u64> = outcomes()
            .filter_map(|(outcome, onset_ns)| Some(outcome.detected_ns? - onset_ns?))
            .collect();
        let detected = delays.len();
        let delay = median(delays).map_or("-".into(), |delay| format!("{:.3} s", seconds(delay)));
        writeln!(
            text,
            "{name}: fault detected in {detected} of {faulty} runs, median delay {delay}"
        )?;
        let delays: Vec<u64> = outcomes()
            .filter_map(|(outcome, onset_ns)| Some(outcome.raised_ns? - onset_ns?))
            .collect();
        let raised = delays.len();
        let delay = median(delays).map_or("-".into(), |delay| format!("{:.3} s", seconds(delay)));
        writeln!(
            text,
            "{name}: alarm raised by the fault in {raised} of {faulty} runs, median delay {delay}"
        )?;
        for (bit, fault) in description.faults.iter().enumerate() {
            let isolated = count(&|outcome| outcome.isolated.is_some_and(|(_, set)| set >> bit & 1 == 1));
            writeln!(text, "{name}: isolated {fault} in {isolated} of {faulty} runs")?;
        }
        Ok(())
    }
}

fn describe(description: &Description, outcome: &Outcome, onset_ns: Option<u64>) -> String {
    let mut text = format!(
        "{} steps, {} evaluated, {} false alarms",
        outcome.steps, outcome.evaluated, outcome.false_alarms
    );
    if let Some(onset_ns) = onset_ns {
        text += &match outcome.detected_ns {
            Some(at) => format!(
                ", fault at {:.3} s detected after {:.3} s",
                seconds(onset_ns),
                seconds(at - onset_ns)
            ),
            None => format!(", fault at {:.3} s not detected", seconds(onset_ns)),
        };
    }
    if let Some((at, faults)) = outcome.isolated {
        let names: Vec<&str> = fault_names(&description.faults, faults).collect();
        text += &format!(", isolated {} at {:.3} s", names.join("+"), seconds(at));
    }
    text += &format!(
        "; alarm raised {} times, cleared {} times",
        outcome.raised, outcome.cleared
    );
    if let (Some(onset_ns), Some(at)) = (onset_ns, outcome.raised_ns) {
        text += &format!(", raised {:.3} s after the fault", seconds(at - onset_ns));
    }
    text
}

fn seconds(nanoseconds: u64) -> f64 {
    nanoseconds as f64 * 1e-9
}
