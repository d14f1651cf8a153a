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
    /// The kind changes within a run.
    #[error(
        "`{path}` line {line}: the run `{run}` was of kind `{before}` and is now `{now}`; a run has one kind"
    )]
    SeveralKinds {
        /// The file.
        path: PathBuf,
        /// Line in the file, counted from 1.
        line: u64,
        /// The run.
        run: String,
        /// Its kind so far.
        before: String,
        /// Its kind in that line.
        now: String,
    },
    /// Nothing to replay.
    #[error("`{path}` has no rows")]
    Empty {
        /// The file.
        path: PathBuf,
    },
}

/// Which columns have a meaning of their own.
#[derive(Clone, Copy, Debug, Default)]
pub struct ColumnRoles<'a> {
    /// Time, seconds.
    pub time: &'a str,
    /// Tells the runs of a file apart.
    pub run: Option<&'a str>,
    /// Names the kind of a run, for grouping.
    pub kind: Option<&'a str>,
    /// Labels real faults: 0 or empty without fault.
    pub fault: Option<&'a str>,
}

/// Rows of one run, in time order.
#[derive(Clone, Debug, Default)]
pub struct Run {
    /// What the run column says; empty without one.
    pub name: String,
    /// Position among the runs of the file, from 0.
    pub position: usize,
    /// What the kind column says; empty without one.
    pub kind: String,
    /// When the first row with a labelled fault was recorded, nanoseconds since the first row.
    pub labelled_onset_ns: Option<u64>,
    /// When each row was recorded, nanoseconds since the first row.
    pub recorded_ns: Vec<u64>,
    /// When each row is replayed, nanoseconds since the first row: as recorded, or one row a period.
    pub times_ns: Vec<u64>,
    /// Cells by row; NaN where the cell is empty.
    pub rows: Vec<Vec<f64>>,
}

impl Run {
    /// Time from the first to the last row as recorded, nanoseconds.
    pub fn duration_ns(&self) -> u64 {
        self.recorded_ns.last().copied().unwrap_or(0)
    }

    /// The recorded time of a moment of the replay: that of the last row before it, and what has passed since.
    pub fn recorded_at_ns(&self, replayed_ns: u64) -> u64 {
        let rows = self.times_ns.partition_point(|&time| time <= replayed_ns);
        let row = rows.saturating_sub(1);
        let (time, recorded) = (self.times_ns.get(row), self.recorded_ns.get(row));
        recorded.copied().unwrap_or(0) + (replayed_ns - time.copied().unwrap_or(0).min(replayed_ns))
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
    /// Reads a CSV file with a header line. Each value of the run column is a run of its own.
    pub fn read(path: &Path, roles: ColumnRoles<'_>) -> Result<Self, RecordingError> {
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
        let time_index = index_of(roles.time)?;
        let run_index = roles.run.map(index_of).transpose()?;
        let kind_index = roles.kind.map(index_of).transpose()?;
        let fault_index = roles.fault.map(index_of).transpose()?;

        let mut places: BTreeMap<String, (usize, f64)> = BTreeMap::new();
        let mut runs: Vec<Run> = Vec::new();
        for record in reader.records() {
            let record = record.map_err(failed)?;
            let line = record.position().map_or(0, csv::Position::line);
            let word = |index: Option<usize>| index.map_or("", |index| record[index].trim()).to_owned();
            let (name, kind) = (word(run_index), word(kind_index));
            let cells = record.iter().enumerate().map(|(index, text)| {
                if [run_index, kind_index].contains(&Some(index)) {
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
                    position: runs.len(),
                    kind: kind.clone(),
                    ..Run::default()
                });
                (runs.len() - 1, time)
            });
            let run = &mut runs[place];
            if run.kind != kind {
                return Err(RecordingError::SeveralKinds {
                    path: path.into(),
                    line,
                    run: run.name.clone(),
                    before: run.kind.clone(),
                    now: kind,
                });
            }
            let time_ns = ((time - start) * 1e9).round();
            let rises = time_ns >= 0.0 && run.recorded_ns.last().is_none_or(|&last| time_ns > last as f64);
            if !rises {
                return Err(RecordingError::TimeGoesBack {
                    path: path.into(),
                    line,
                    time,
                });
            }
            let labelled = fault_index.is_some_and(|index| row[index].abs() > 0.0);
            if labelled && run.labelled_onset_ns.is_none() {
                run.labelled_onset_ns = Some(time_ns as u64);
            }
            run.recorded_ns.push(time_ns as u64);
            run.times_ns.push(time_ns as u64);
            run.rows.push(row);
        }
        if runs.is_empty() {
            return Err(RecordingError::Empty { path: path.into() });
        }
        Ok(Self { columns, runs })
    }

    /// Replays one row a period, whenever it was recorded: for recordings whose rows are the sampling instants but
    /// come irregularly.
    pub fn replay_rows_every(&mut self, period_ns: u64) {
        for run in &mut self.runs {
            run.times_ns = (0..run.rows.len() as u64).map(|row| row * period_ns).collect();
        }
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

    fn read(text: &str, roles: ColumnRoles<'_>) -> Result<Recording, RecordingError> {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        file.write_all(text.as_bytes()).unwrap();
        Recording::read(file.path(), roles)
    }

    const TIME: ColumnRoles<'_> = ColumnRoles {
        time: "t",
        run: None,
        kind: None,
        fault: None,
    };
    const ALL: ColumnRoles<'_> = ColumnRoles {
        time: "t",
        run: Some("run"),
        kind: Some("kind"),
        fault: Some("fault"),
    };

    #[test]
    fn runs_start_at_their_own_zero_and_keep_their_rows() {
        let roles = ColumnRoles {
            run: Some("run"),
            ..TIME
        };
        let recording = read("run,t,v\na,5.0,1\nb,0.0,2\na,5.025,3\nb,0.5,\n", roles).unwrap();
        assert_eq!(recording.runs[0].name, "a");
        assert_eq!(recording.runs[0].times_ns, [0, 25_000_000]);
        assert_eq!(recording.runs[1].duration_ns(), 500_000_000);
        assert!(recording.runs[1].rows[1][2].is_nan());
        assert_eq!(recording.runs[1].position, 1);
    }

    #[test]
    fn a_labelled_fault_begins_at_its_first_row_in_the_time_of_the_recording() {
        let text = "run,t,kind,fault\na,1,stuck,0\na,1.3,stuck,\na,1.8,stuck,2\na,2,stuck,0\nb,0,none,0\n";
        let mut recording = read(text, ALL).unwrap();
        assert_eq!(recording.runs[0].labelled_onset_ns, Some(800_000_000));
        assert_eq!(recording.runs[1].labelled_onset_ns, None);
        assert_eq!(
            (&*recording.runs[0].kind, &*recording.runs[1].kind),
            ("stuck", "none")
        );

        recording.replay_rows_every(400_000_000);
        let run = &recording.runs[0];
        assert_eq!(run.times_ns, [0, 400_000_000, 800_000_000, 1_200_000_000]);
        assert_eq!(run.duration_ns(), 1_000_000_000);
        assert_eq!(run.recorded_at_ns(800_000_000), 800_000_000);
        assert_eq!(run.recorded_at_ns(1_200_000_000), 1_000_000_000);
        assert_eq!(run.recorded_at_ns(410_000_000), 310_000_000);
    }

    #[test]
    fn without_a_row_period_the_times_are_those_of_the_recording() {
        let recording = read("t,v\n5,1\n5.3,2\n", TIME).unwrap();
        for moment in [0, 1, 299_999_999, 300_000_000, 400_000_000] {
            assert_eq!(recording.runs[0].recorded_at_ns(moment), moment);
        }
    }

    #[test]
    fn bad_files_are_refused_with_the_place() {
        let message = |text: &str| read(text, TIME).unwrap_err().to_string();
        assert!(message("x,v\n0,1\n").contains("no column `t`"));
        assert!(message("t,v\n0,1\n1,two\n").contains("line 3, column `v`: `two`"));
        assert!(message("t,v\n0,nan\n").contains("not a number"));
        assert!(message("t,v\n1,1\n1,2\n").contains("line 3"));
        assert!(message("t,v\n").contains("no rows"));
        assert!(message("t,v\n0\n").contains("cannot read"));
        let labelled = |text: &str| read(text, ALL).unwrap_err().to_string();
        assert!(labelled("run,t,kind\n").contains("no column `fault`"));
        let kinds = labelled("run,t,kind,fault\na,1,x,0\na,2,y,0\n");
        assert!(kinds.contains("line 3") && kinds.contains("kind `x`") && kinds.contains("`y`"));
    }

    #[test]
    fn a_selection_takes_by_position_or_name() {
        let odd: RunSelection = "odd".parse().unwrap();
        assert!(odd.takes(0, "1") && !odd.takes(1, "2"));
        let named: RunSelection = "3, x".parse().unwrap();
        assert!(named.takes(9, "x") && !named.takes(0, "1"));
    }
}
