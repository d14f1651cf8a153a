//! A CSV recording in memory.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Why a recording could not be read.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// The file cannot be read, or is not CSV.
    #[error("cannot read the recording `{path}`: {source}")]
    Read {
        /// The file.
        path: PathBuf,
        /// The reason.
        source: csv::Error,
    },
    /// A column that the configuration names is not there.
    #[error("`{path}` has no column `{column}`; its columns are: {columns}")]
    NoColumn {
        /// The file.
        path: PathBuf,
        /// The missing column.
        column: String,
        /// The columns there are.
        columns: String,
    },
    /// A cell is not a number.
    #[error(
        "`{path}` line {line}, column `{column}`: `{text}` is not a number; leave the cell empty if there is no value"
    )]
    NotANumber {
        /// The file.
        path: PathBuf,
        /// Line in the file, counted from 1.
        line: u64,
        /// The column.
        column: String,
        /// What stands there.
        text: String,
    },
    /// Time does not rise within a run.
    #[error(
        "`{path}` line {line}: the time {time} s is not later than the line before; sort the recording or name a `run_column`"
    )]
    TimeGoesBack {
        /// The file.
        path: PathBuf,
        /// Line in the file, counted from 1.
        line: u64,
        /// The time in that line.
        time: f64,
    },
    /// Nothing to replay.
    #[error("`{path}` has no rows")]
    Empty {
        /// The file.
        path: PathBuf,
    },
}

/// Rows of one run, in time order.
#[derive(Clone, Debug)]
pub struct Run {
    /// What the run column says; empty without one.
    pub name: String,
    /// Time of each row since the first row, nanoseconds.
    pub times_ns: Vec<u64>,
    /// Cells by row; NaN where the cell is empty.
    pub rows: Vec<Vec<f64>>,
}

impl Run {
    /// Time from the first to the last row, nanoseconds.
    pub fn duration_ns(&self) -> u64 {
        self.times_ns.last().copied().unwrap_or(0)
    }
}

/// A recording: named columns and one or more runs.
#[derive(Clone, Debug)]
pub struct Recording {
    /// Names of the columns.
    pub columns: Vec<String>,
    /// The runs in the order of the file.
    pub runs: Vec<Run>,
}

impl Recording {
    /// Reads a CSV file with a header line. Each value of `run_column` is a run of its own.
    pub fn read(path: &Path, time_column: &str, run_column: Option<&str>) -> Result<Self, RecordingError> {
        let failed = |source| RecordingError::Read {
            path: path.into(),
            source,
        };
        let mut reader = csv::Reader::from_path(path).map_err(failed)?;
        let columns: Vec<String> = reader
            .headers()
            .map_err(failed)?
            .iter()
            .map(|name| name.trim().into())
            .collect();
        let index_of = |column: &str| {
            columns
                .iter()
                .position(|name| name == column)
                .ok_or_else(|| RecordingError::NoColumn {
                    path: path.into(),
                    column: column.into(),
                    columns: columns.join(", "),
                })
        };
        let time_index = index_of(time_column)?;
        let run_index = run_column.map(index_of).transpose()?;

        let mut places: BTreeMap<String, (usize, f64)> = BTreeMap::new();
        let mut runs: Vec<Run> = Vec::new();
        for record in reader.records() {
            let record = record.map_err(failed)?;
            let line = record.position().map_or(0, csv::Position::line);
            let name = run_index.map_or("", |index| record[index].trim()).to_owned();
            let cells = record.iter().enumerate().map(|(index, text)| {
                if Some(index) == run_index {
                    return Ok(f64::NAN);
                }
                parse_cell(text).ok_or_else(|| RecordingError::NotANumber {
                    path: path.into(),
                    line,
                    column: columns[index].clone(),
                    text: text.into(),
                })
            });
            let row = cells.collect::<Result<Vec<f64>, _>>()?;
            let time = row[time_index];
            let &mut (place, start) = places.entry(name.clone()).or_insert_with(|| {
                runs.push(Run {
                    name,
                    times_ns: Vec::new(),
                    rows: Vec::new(),
                });
                (runs.len() - 1, time)
            });
            let time_ns = ((time - start) * 1e9).round();
            let rises = time_ns >= 0.0
                && runs[place]
                    .times_ns
                    .last()
                    .is_none_or(|&last| time_ns > last as f64);
            if !rises {
                return Err(RecordingError::TimeGoesBack {
                    path: path.into(),
                    line,
                    time,
                });
            }
            runs[place].times_ns.push(time_ns as u64);
            runs[place].rows.push(row);
        }
        if runs.is_empty() {
            return Err(RecordingError::Empty { path: path.into() });
        }
        Ok(Self { columns, runs })
    }
}

/// A number, or NaN for an empty cell; none for anything else (`nan` and `inf` included).
fn parse_cell(text: &str) -> Option<f64> {
    let text = text.trim();
    if text.is_empty() {
        return Some(f64::NAN);
    }
    text.parse().ok().filter(|value: &f64| value.is_finite())
}

/// Which runs of a recording to take: `all`, `odd`, `even` (by position, counted from 1), or names separated by
/// commas.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RunSelection {
    /// Every run.
    All,
    /// The first, third, fifth … run.
    Odd,
    /// The second, fourth, sixth … run.
    Even,
    /// The runs with these names.
    Named(Vec<String>),
}

impl std::str::FromStr for RunSelection {
    type Err = std::convert::Infallible;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        Ok(match text {
            "all" => Self::All,
            "odd" => Self::Odd,
            "even" => Self::Even,
            names => Self::Named(names.split(',').map(|name| name.trim().into()).collect()),
        })
    }
}

impl RunSelection {
    /// Whether the run at `position` (from 0) with this name is taken.
    pub fn takes(&self, position: usize, name: &str) -> bool {
        match self {
            Self::All => true,
            Self::Odd => position.is_multiple_of(2),
            Self::Even => !position.is_multiple_of(2),
            Self::Named(names) => names.iter().any(|wanted| wanted == name),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write as _;

    use super::*;

    fn read(text: &str, run_column: Option<&str>) -> Result<Recording, RecordingError> {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        file.write_all(text.as_bytes()).unwrap();
        Recording::read(file.path(), "t", run_column)
    }

    #[test]
    fn runs_start_at_their_own_zero_and_keep_their_rows() {
        let recording = read("run,t,v\na,5.0,1\nb,0.0,2\na,5.025,3\nb,0.5,\n", Some("run")).unwrap();
        assert_eq!(recording.runs[0].name, "a");
        assert_eq!(recording.runs[0].times_ns, [0, 25_000_000]);
        assert_eq!(recording.runs[1].duration_ns(), 500_000_000);
        assert!(recording.runs[1].rows[1][2].is_nan());
    }

    #[test]
    fn bad_files_are_refused_with_the_place() {
        let message = |text: &str| read(text, None).unwrap_err().to_string();
        assert!(message("x,v\n0,1\n").contains("no column `t`"));
        assert!(message("t,v\n0,1\n1,two\n").contains("line 3, column `v`: `two`"));
        assert!(message("t,v\n0,nan\n").contains("not a number"));
        assert!(message("t,v\n1,1\n1,2\n").contains("line 3"));
        assert!(message("t,v\n").contains("no rows"));
        assert!(message("t,v\n0\n").contains("cannot read"));
    }

    #[test]
    fn a_selection_takes_by_position_or_name() {
        let odd: RunSelection = "odd".parse().unwrap();
        assert!(odd.takes(0, "1") && !odd.takes(1, "2"));
        let named: RunSelection = "3, x".parse().unwrap();
        assert!(named.takes(9, "x") && !named.takes(0, "1"));
    }
}
