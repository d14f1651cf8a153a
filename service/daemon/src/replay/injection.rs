//! Faults written into a recording, so that a real recording without faults can show what would be detected.

use std::str::FromStr;

use super::recording::Recording;
use super::run::Run;

/// How a fault changes a column.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FaultKind {
    /// Adds the size.
    Offset,
    /// Multiplies by the size.
    Scale,
    /// Repeats the last value before the onset.
    Freeze,
    /// Takes the value away: no sample is sent.
    Dropout,
    /// Adds the size to the first row at or after the onset only.
    Spike,
}

/// When a fault begins: seconds after the start of the run, or a share of its length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Onset {
    /// Seconds.
    Seconds(f64),
    /// Share of the run's length, 0 to 1.
    Share(f64),
}

/// A fault in one column of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Fault {
    /// How the column changes.
    pub kind: FaultKind,
    /// The column.
    pub column: String,
    /// Size in the column's unit (factor for `scale`).
    pub size: f64,
    /// Begin.
    pub onset: Onset,
    /// End, seconds after the start of the run; none: until the run ends.
    pub end_s: Option<f64>,
}

/// Why a fault could not be understood or injected.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FaultError {
    /// The text is not of the form.
    #[error("`{text}`: {reason}; write for example `offset,column=steer_cmd,size=0.05,onset=50%,end=2.5`")]
    Syntax {
        /// What was given.
        text: String,
        /// What is wrong with it.
        reason: String,
    },
    /// The fault would begin when a run is over.
    #[error(
        "the fault begins {onset_s} s into the run `{run}`, which lasts {duration_s} s; choose an earlier onset, or a \
         share such as 50%"
    )]
    OutsideRun {
        /// The run.
        run: String,
        /// When the fault would begin, s.
        onset_s: f64,
        /// How long the run lasts, s.
        duration_s: f64,
    },
    /// The recording has no such column.
    #[error("the recording has no column `{column}` to inject a fault into; its columns are: {columns}")]
    NoColumn {
        /// The missing column.
        column: String,
        /// The columns there are.
        columns: String,
    },
}

impl FromStr for Fault {
    type Err = FaultError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let syntax = |reason: String| FaultError::Syntax {
            text: text.into(),
            reason,
        };
        let number = |key: &str, value: &str| {
            let parsed = value.parse::<f64>().ok().filter(|number| number.is_finite());
            parsed.ok_or_else(|| syntax(format!("`{key}` is not a number")))
        };
        let mut parts = text.split(',').map(str::trim);
        let kind = match parts.next().unwrap_or_default() {
            "offset" => FaultKind::Offset,
            "scale" => FaultKind::Scale,
            "freeze" => FaultKind::Freeze,
            "dropout" => FaultKind::Dropout,
            "spike" => FaultKind::Spike,
            other => {
                return Err(syntax(format!(
                    "`{other}` is none of offset, scale, freeze, dropout, spike"
                )));
            }
        };
        let (mut column, mut size, mut onset, mut end_s) = (None, None, None, None);
        for part in parts {
            let (key, value) = part
                .split_once('=')
                .ok_or_else(|| syntax(format!("`{part}` is not key=value")))?;
            match key {
                "column" => column = Some(value.to_owned()),
                "size" => size = Some(number(key, value)?),
                "end" => end_s = Some(number(key, value)?),
                "onset" => {
                    onset = Some(match value.strip_suffix('%') {
                        Some(percent) => Onset::Share(number(key, percent)? / 100.0),
                        None => Onset::Seconds(number(key, value)?),
                    });
                }
                _ => return Err(syntax(format!("`{key}` is none of column, size, onset, end"))),
            }
        }
        let needs_size = matches!(kind, FaultKind::Offset | FaultKind::Scale | FaultKind::Spike);
        let possible = match onset {
            Some(Onset::Share(share)) => (0.0..=1.0).contains(&share),
            Some(Onset::Seconds(seconds)) => seconds >= 0.0 && end_s.is_none_or(|end_s| end_s > seconds),
            None => true,
        };
        if !possible {
            return Err(syntax(
                "`onset` lies from 0 on, as a share within 100 %, and before `end`".into(),
            ));
        }
        if needs_size && size.is_none() {
            return Err(syntax("`size` is missing".into()));
        }
        Ok(Self {
            kind,
            column: column.ok_or_else(|| syntax("`column` is missing".into()))?,
            size: size.unwrap_or(0.0),
            onset: onset.ok_or_else(|| syntax("`onset` is missing".into()))?,
            end_s,
        })
    }
}

impl Fault {
    /// When the fault begins in a run, nanoseconds of the recording after its start.
    pub fn onset_ns(&self, run: &Run) -> u64 {
        match self.onset {
            Onset::Seconds(seconds) => (seconds * 1e9).max(0.0) as u64,
            Onset::Share(share) => (share * run.duration_ns() as f64).max(0.0) as u64,
        }
    }

    /// Writes the fault into every run of a recording.
    pub fn inject(&self, recording: &mut Recording) -> Result<(), FaultError> {
        let column = recording
            .columns
            .iter()
            .position(|name| *name == self.column)
            .ok_or_else(|| FaultError::NoColumn {
                column: self.column.clone(),
                columns: recording.columns.join(", "),
            })?;
        for run in &mut recording.runs {
            let onset_ns = self.onset_ns(run);
            if run.recorded_ns.last().is_none_or(|&last_ns| last_ns < onset_ns) {
                return Err(FaultError::OutsideRun {
                    run: run.name.clone(),
                    onset_s: onset_ns as f64 * 1e-9,
                    duration_s: run.duration_ns() as f64 * 1e-9,
                });
            }
            self.inject_into(run, column);
        }
        Ok(())
    }

    fn inject_into(&self, run: &mut Run, column: usize) {
        let onset_ns = self.onset_ns(run);
        let end_ns = self
            .end_s
            .map_or(u64::MAX, |seconds| (seconds * 1e9).max(0.0) as u64);
        let first = run.recorded_ns.partition_point(|&time| time < onset_ns);
        let end = match self.kind {
            FaultKind::Spike => first + 1,
            _ => run.recorded_ns.partition_point(|&time| time < end_ns),
        };
        let frozen = run.rows[first.saturating_sub(1).min(run.rows.len() - 1)][column];
        for row in run.rows.iter_mut().take(end).skip(first) {
            let value = &mut row[column];
            *value = match self.kind {
                FaultKind::Offset | FaultKind::Spike => *value + self.size,
                FaultKind::Scale => *value * self.size,
                FaultKind::Freeze => frozen,
                FaultKind::Dropout => f64::NAN,
            };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn injected(fault: &str) -> Vec<f64> {
        inject(fault).unwrap()
    }

    fn inject(fault: &str) -> Result<Vec<f64>, FaultError> {
        let run = Run {
            recorded_ns: (0..5).map(|row| row * 1_000_000_000).collect(),
            rows: (1..6).map(|value| vec![f64::from(value)]).collect(),
            ..Run::default()
        };
        let mut recording = Recording {
            columns: vec!["v".into()],
            runs: vec![run],
        };
        fault.parse::<Fault>()?.inject(&mut recording)?;
        Ok(recording.runs[0].rows.iter().map(|row| row[0]).collect())
    }

    #[test]
    fn each_kind_changes_its_rows_and_no_others() {
        assert_eq!(
            injected("offset,column=v,size=10,onset=2,end=4"),
            [1.0, 2.0, 13.0, 14.0, 5.0]
        );
        assert_eq!(
            injected("scale,column=v,size=0,onset=50%"),
            [1.0, 2.0, 0.0, 0.0, 0.0]
        );
        assert_eq!(injected("freeze,column=v,onset=2"), [1.0, 2.0, 2.0, 2.0, 2.0]);
        assert_eq!(
            injected("spike,column=v,size=1,onset=1.5"),
            [1.0, 2.0, 4.0, 4.0, 5.0]
        );
        assert!(injected("dropout,column=v,onset=3,end=4")[3].is_nan());
    }

    #[test]
    fn mistakes_are_named() {
        let message = |text: &str| text.parse::<Fault>().unwrap_err().to_string();
        assert!(message("shift,column=v").contains("none of offset"));
        assert!(message("offset,column=v,onset=1").contains("`size` is missing"));
        assert!(message("offset,size=1,onset=1").contains("`column` is missing"));
        assert!(message("offset,column=v,size=x,onset=1").contains("`size` is not a number"));
        assert!(message("offset,kolumn=v").contains("`kolumn` is none of"));
        for wrong in ["onset=150%", "onset=-1", "onset=3,end=2"] {
            assert!(message(&format!("offset,column=v,size=1,{wrong}")).contains("`onset` lies"));
        }
        let late = inject("offset,column=v,size=1,onset=9").unwrap_err();
        assert!(
            matches!(late, FaultError::OutsideRun { onset_s: 9.0, .. }),
            "{late}"
        );
    }
}
