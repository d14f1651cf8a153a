//! Step records of a replay as CSV: one line a record, one group of four columns a channel.
//!
//! Numbers are written with all their digits, so two files are equal exactly when their records agree in every
//! bit. Step and time count from the start of the recording, whatever the daemon's clock says.

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

use residual_diagnosis::diagnoser::Description;
use residual_shared::alarm::AlarmTransition;
use residual_shared::record::StepRecord;

use crate::runtime::companion::fault_names;

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
    /// The record as the diagnoser's instant counts: `step` and `instant_ns` since the start of the recording.
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
            let head = [
                "run",
                "step",
                "time_ns",
                "verdict",
                "certainly_faulty",
                "possibly_faulty",
                "flags",
            ];
            let rest = [
                "skipped_instants",
                "inputs_valid",
                "fault_estimate",
                "fault_estimate_half_width",
            ];
            let channels = description.channels.iter().flat_map(|channel| {
                ["lower", "residual", "upper", "ratio"].map(|part| format!("{}.{part}", channel.name))
            });
            let columns = head
                .iter()
                .chain(&rest)
                .map(|&name| name.to_owned())
                .chain(channels);
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
        let record = &replayed.record;
        let faults = &self.faults[replayed.slot];
        let names = |set| fault_names(faults, set).collect::<Vec<_>>().join("+");
        let mut cells = vec![
            run.to_owned(),
            record.step.to_string(),
            record.instant_ns.to_string(),
            record.verdict().name().to_owned(),
            names(record.certainly_faulty),
            names(record.possibly_faulty),
            record.flags.to_string(),
            record.skipped_instants.to_string(),
            record.inputs_valid.to_string(),
            record.fault_estimate.to_string(),
            record.fault_estimate_half_width.to_string(),
        ];
        for channel in record.channels() {
            let numbers = [channel.lower, channel.residual, channel.upper, channel.ratio];
            cells.extend(numbers.map(|number| number.to_string()));
        }
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
