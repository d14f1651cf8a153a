//! `residuald explain`: what a gains file says, for people.

use std::io::Write;
use std::path::{Path, PathBuf};

use miette::{Diagnostic, IntoDiagnostic};
use residual_diagnosis::gains::SolverRun;
use residual_diagnosis::gains::file::{Entry, GainsFile};

use super::achieved::{
    conditions, delay_table, false_alarms, fault_table, isolability_matrix, norm, not_stated, number, poles,
    smallest_margin,
};
use super::lines::Lines;
use crate::configuration::gains::{parse_gains, read};

/// The file is not there or no text.
#[derive(Debug, thiserror::Error, Diagnostic)]
#[error("cannot read the gains file {}: {reason}", path.display())]
#[diagnostic(help("give the path of a file that `residuald design` has written"))]
pub struct ExplainError {
    path: PathBuf,
    reason: String,
}

/// Explains the gains file to `output`.
///
/// # Errors
/// A file that cannot be read or is damaged; a failure to write.
pub fn execute(path: &Path, output: &mut dyn Write) -> miette::Result<()> {
    let text = read(path).map_err(|reason| ExplainError {
        path: path.to_owned(),
        reason,
    })?;
    let name = path.display().to_string();
    let file = parse_gains(&name, &text)?;
    output
        .write_all(explanation(&name, &file).as_bytes())
        .into_diagnostic()
}

fn explanation(name: &str, file: &GainsFile) -> String {
    let mut lines = Lines::default();
    lines.heading(format!("gains file {name}"));
    lines.entry("written", format!("{} by {}", file.date, file.tool));
    lines.entry(
        "figures",
        "as the file states them; nothing is recomputed here. `residuald check CONFIG` and `residuald run CONFIG` \
         recompute every one from the gains and refuse the file where one does not hold",
    );
    lines.entry(
        "stated within",
        format!("{} of each figure", number(file.tolerance)),
    );
    for entry in &file.diagnoser {
        self::entry(&mut lines, entry);
    }
    lines.text
}

fn entry(lines: &mut Lines, entry: &Entry) {
    let achieved = &entry.achieved;
    lines.heading(format!("diagnoser {}", entry.name));
    lines.entry(
        "method",
        format!("{}, period {} s", entry.method, entry.sample_time_s),
    );
    lines.entry("inputs", &entry.inputs);
    if let Some(alarms) = &achieved.false_alarms {
        lines.entry("false alarms", false_alarms(alarms));
    }
    for norm in &achieved.norms {
        lines.entry("norm", self::norm(norm));
    }
    for poles in &achieved.poles {
        let what = format!("{}: {}", poles.name, self::poles(poles, entry.sample_time_s));
        lines.entry("poles (decay)", what);
    }
    if let Some(margin) = smallest_margin(achieved) {
        lines.entry("conditions", margin);
    }
    for inequality in &achieved.inequalities {
        lines.entry(
            "condition",
            format!("{}, margin {}", inequality.name, number(inequality.margin)),
        );
    }
    if let Some(faults) = fault_table(achieved) {
        lines.heading("  smallest constant faults".to_owned());
        lines.block(&faults.to_string());
        if let Some(conditions) = conditions(&achieved.faults) {
            lines.entry("provided that", conditions);
        }
    }
    for sizes in not_stated(achieved) {
        lines.entry("smallest faults", sizes);
    }
    if let Some(delays) = delay_table(&achieved.faults) {
        lines.heading("  worst delay of detection, by the size of the fault".to_owned());
        lines.block(&delays.to_string());
    }
    if let Some(matrix) = isolability_matrix(achieved) {
        lines.heading("  telling faults apart: instants that are needed".to_owned());
        lines.block(&matrix.to_string());
    }
    for threshold in &achieved.thresholds {
        let said = [
            ("never fires", &threshold.never_fires),
            ("insensitive", &threshold.insensitive),
        ];
        let said = said.into_iter();
        let said = said.filter_map(|(what, reason)| Some(format!("; {what}: {}", reason.as_ref()?)));
        let value = number(threshold.settled);
        lines.entry(
            "threshold",
            format!("{}: {value}{}", threshold.channel, said.collect::<String>()),
        );
    }
    for run in &entry.solver {
        lines.entry("solver", solver(run));
    }
    for warning in &entry.warnings {
        lines.warning(warning);
    }
}

fn solver(run: &SolverRun) -> String {
    format!(
        "{}: {} says {} after {} iterations, objective {}, dual {}, accuracy {}",
        run.problem,
        run.solver,
        run.status,
        run.iterations,
        number(run.objective),
        number(run.dual_objective),
        number(run.tolerance)
    )
}
