//! Fault-free recordings: what is checked of them, and the pieces that missing commands leave.

use super::IdentifyError;
use nalgebra::DMatrix;

/// One recording without interruption, aligned at the model's sampling instants 0, 1, ..., K.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RunData {
    /// What the run is called in messages.
    pub name: String,
    /// u_k, each of length nu, units of u: the command applied from instant k to k+1. A run with a missing (NaN)
    /// command is continued behind it as a run of its own. The last command is not used.
    pub commands: Vec<Vec<f64>>,
    /// y_k, each of length ny, units of y; NaN = not received.
    pub measurements: Vec<Vec<f64>>,
}

/// A stretch of a run without a missing command, with at least one transition and one received measurement.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Piece {
    /// Index of the run in its list, from 0.
    pub run: usize,
    /// u_0 .. u_{K-1}, nu x K.
    pub commands: DMatrix<f64>,
    /// y_0 .. y_K, ny x (K + 1).
    pub measurements: DMatrix<f64>,
}

impl Piece {
    /// K: number of transitions.
    pub(super) fn transitions(&self) -> usize {
        self.commands.ncols()
    }
}

/// How many commands and measurements an instant has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Widths {
    pub commands: usize,
    pub measurements: usize,
}

/// Checks the runs and cuts each into its pieces, one list a run.
pub(super) fn cut(widths: Widths, runs: &[RunData]) -> Result<Vec<Vec<Piece>>, IdentifyError> {
    runs.iter()
        .enumerate()
        .map(|(index, run)| cut_run(widths, index, run))
        .collect()
}

fn cut_run(widths: Widths, index: usize, run: &RunData) -> Result<Vec<Piece>, IdentifyError> {
    let (commands, measurements) = (run.commands.len(), run.measurements.len());
    if commands != measurements {
        return Err(IdentifyError::LengthMismatch {
            run: run.name.clone(),
            commands,
            measurements,
        });
    }
    check_rows(run, "commands", &run.commands, widths.commands)?;
    check_rows(run, "measurements", &run.measurements, widths.measurements)?;
    let mut pieces = Vec::new();
    let mut start = 0;
    for instant in 0..measurements {
        let interrupted = run.commands[instant].iter().any(|value| value.is_nan());
        if interrupted || instant + 1 == measurements {
            pieces.extend(piece(index, run, start, instant));
            start = instant + 1;
        }
    }
    if pieces.is_empty() {
        return Err(IdentifyError::NothingToFit {
            run: run.name.clone(),
        });
    }
    Ok(pieces)
}

/// The samples first..=last, if they hold a transition and a measurement.
fn piece(index: usize, run: &RunData, first: usize, last: usize) -> Option<Piece> {
    let measurements = &run.measurements[first..=last];
    let received = measurements.iter().flatten().any(|value| value.is_finite());
    (last > first && received).then(|| Piece {
        run: index,
        commands: columns(&run.commands[first..last]),
        measurements: columns(measurements),
    })
}

fn columns(rows: &[Vec<f64>]) -> DMatrix<f64> {
    let height = rows.first().map_or(0, Vec::len);
    DMatrix::from_fn(height, rows.len(), |i, k| rows[k][i])
}

fn check_rows(
    run: &RunData,
    what: &'static str,
    rows: &[Vec<f64>],
    expected: usize,
) -> Result<(), IdentifyError> {
    for (instant, row) in rows.iter().enumerate() {
        if row.len() != expected {
            let actual = row.len();
            return Err(IdentifyError::WrongWidth {
                run: run.name.clone(),
                what,
                instant,
                actual,
                expected,
            });
        }
        if let Some(element) = row.iter().position(|value| value.is_infinite()) {
            return Err(IdentifyError::Infinite {
                run: run.name.clone(),
                what,
                instant,
                element,
            });
        }
    }
    Ok(())
}
