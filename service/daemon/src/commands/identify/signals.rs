//! A recording as rows of values at evenly spaced instants.

use std::path::Path;

use miette::Diagnostic;
use residual_synthesis::identify::regression::SignalRun;

use super::structure_file::StructureFile;
use super::{IdentifyArguments, Split, part_instants, part_name, split};
use crate::replay::mapping::{MappingError, Value};
use crate::replay::recording::{ColumnRoles, Recording};
use crate::replay::run::Run;

/// How far the time between two rows may be from a multiple of the period, as a share of it.
const UNEVEN: f64 = 0.25;
/// Longest gap that is filled with empty rows; longer than any lag or memory of a model.
const LONGEST_GAP: f64 = 10_000.0;

/// Why the rows of a recording are no instants.
#[derive(Debug, thiserror::Error, Diagnostic)]
pub enum SignalsError {
    /// An expression that does not fit the recording.
    #[error(transparent)]
    Value(#[from] MappingError),
    /// Rows at the wrong time.
    #[error(
        "run {run}: two rows at {time} s are {apart} s apart, which is no multiple of the sampling period of {period} s; \
         correct `sample_time_s` or `every_rows`, or write `rows_are_instants = true` if every row is an instant"
    )]
    Uneven {
        /// The run.
        run: String,
        /// Time of the later row since the start of the run, seconds.
        time: f64,
        /// Time between the rows, seconds.
        apart: f64,
        /// The period, seconds.
        period: f64,
    },
}

/// The values of `expressions` in all runs, at the instants of the file; empty rows where time was skipped.
///
/// # Errors
/// A report of what does not fit the recording.
pub fn read(
    arguments: &IdentifyArguments,
    file: &StructureFile,
    path: &Path,
    expressions: &[String],
) -> miette::Result<Split<SignalRun>> {
    use miette::IntoDiagnostic;
    let roles = ColumnRoles {
        time: &file.recording.time_column,
        run: file.recording.run_column.as_deref(),
        kind: file.recording.kind_column.as_deref(),
        fault: file.recording.fault_column.as_deref(),
    };
    let recording = Recording::read(path, roles).into_diagnostic()?;
    let owner = "the structure file";
    let values = expressions.iter().map(|text| Value::new(owner, text, &recording));
    let values = values
        .collect::<Result<Vec<_>, _>>()
        .map_err(SignalsError::from)?;
    let instants = part_instants(arguments.part_length, file.sample_time_s)?;
    let mut runs = Vec::with_capacity(recording.runs.len());
    for run in &recording.runs {
        let rows = rows_of(run, file, &values)?;
        let count = rows.len().div_ceil(instants);
        let parts = rows
            .chunks(instants.min(rows.len().max(1)))
            .enumerate()
            .map(|(part, rows)| SignalRun {
                name: part_name(&run.name, part, count),
                rows: rows.to_vec(),
            });
        runs.push((run.name.clone(), parts.collect()));
    }
    Ok(split(&arguments.runs, runs)?)
}

fn rows_of(run: &Run, file: &StructureFile, values: &[Value]) -> Result<Vec<Vec<f64>>, SignalsError> {
    let period = file.sample_time_s;
    let mut rows: Vec<Vec<f64>> = Vec::with_capacity(run.rows.len());
    let mut variables = Vec::new();
    let mut last: Option<u64> = None;
    for (&time_ns, row) in run
        .times_ns
        .iter()
        .zip(&run.rows)
        .step_by(file.recording.every_rows)
    {
        if run.labelled_onset_ns.is_some_and(|onset_ns| time_ns >= onset_ns) {
            break;
        }
        if let Some(last) = last.filter(|_| !file.recording.rows_are_instants) {
            let apart = (time_ns - last) as f64 * 1e-9;
            let periods = (apart / period).round();
            if periods < 1.0 || (apart - periods * period).abs() > UNEVEN * period {
                let (run, time) = (run.name.clone(), time_ns as f64 * 1e-9);
                return Err(SignalsError::Uneven {
                    run,
                    time,
                    apart,
                    period,
                });
            }
            let skipped = (periods - 1.0).min(LONGEST_GAP) as usize;
            rows.extend(std::iter::repeat_n(vec![f64::NAN; values.len()], skipped));
        }
        last = Some(time_ns);
        // An infinite value, such as of a division by zero, is no value.
        let value = |value: &Value| Some(value.of(row, &mut variables)).filter(|value| value.is_finite());
        rows.push(
            values
                .iter()
                .map(value)
                .map(|value| value.unwrap_or(f64::NAN))
                .collect(),
        );
    }
    Ok(rows)
}
