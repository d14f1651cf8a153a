//! Step records of a replay as CSV, with the [columns] that `residual export csv` writes as well.
//!
//! Step and time count from the start of a CSV recording, whatever the daemon's clock says; those of an MCAP
//! recording are the recorded ones.

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

use residual_diagnosis::diagnoser::Description;
use residual_recording::columns;
use residual_shared::alarm::AlarmTransition;
use residual_shared::record::StepRecord;

/// Why a CSV file cannot be written.
#[derive(Debug, thiserror::Error)]
#[error("cannot write `{path}`: {source}")]
pub struct WriteError {
    /// The file.
    pub path: PathBuf,
    /// The reason.
    pub source: io::Error,
}

/// A record with its place in a replay.
#[derive(Clone, Copy)]
pub struct ReplayRecord {
    /// The diagnoser's slot.
    pub slot: usize,
    /// The record, with `step` and `instant_ns` since the start of a CSV recording.
    pub record: StepRecord,
}

/// What a replay gives, in the order in which it comes into being.
#[derive(Clone, Copy)]
#[expect(clippy::large_enum_variant, reason = "each is looked at once and not kept")]
pub enum Replayed {
    /// A record.
    Record(ReplayRecord),
    /// A transition of an alarm, its step and instant as those of the records.
    Alarm(AlarmTransition),
}

/// Writes the records of each diagnoser into a CSV file of its own.
pub struct RecordWriter {
    files: Vec<csv::Writer<File>>,
    faults: Vec<Vec<String>>,
    path: PathBuf,
}

impl RecordWriter {
    /// Creates `path` for a single diagnoser, or `NAME.DIAGNOSER.csv` beside it for several.
    pub fn create(path: &Path, diagnosers: &[(String, Description)]) -> Result<Self, WriteError> {
        let mut files = Vec::new();
        for (name, description) in diagnosers {
            let own = match diagnosers {
                [_] => path.to_path_buf(),
                _ => path.with_extension(format!("{name}.csv")),
            };
            let failed = |source| WriteError {
                path: own.clone(),
                source,
            };
            let mut file = csv::Writer::from_writer(File::create(&own).map_err(failed)?);
            let channels = description.channels.iter().map(|channel| channel.name.as_str());
            let columns = columns::names(channels);
            file.write_record(columns).map_err(|error| failed(error.into()))?;
            files.push(file);
        }
        let faults = diagnosers
            .iter()
            .map(|(_, description)| description.faults.clone())
            .collect();
        Ok(Self {
            files,
            faults,
            path: path.into(),
        })
    }

    /// Writes one record of a run.
    pub fn write(&mut self, run: &str, replayed: &ReplayRecord) -> Result<(), WriteError> {
        let cells = columns::cells(run, &replayed.record, &self.faults[replayed.slot]);
        let failed = |error: csv::Error| WriteError {
            path: self.path.clone(),
            source: error.into(),
        };
        self.files[replayed.slot].write_record(cells).map_err(failed)
    }

    /// Writes out what is still buffered.
    pub fn finish(mut self) -> Result<(), WriteError> {
        let path = self.path;
        self.files.iter_mut().try_for_each(|file| {
            file.flush().map_err(|source| WriteError {
                path: path.clone(),
                source,
            })
        })
    }
}
