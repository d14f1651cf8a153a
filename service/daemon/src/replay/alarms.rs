//! Alarm transitions of a replay as CSV: one line a transition, all diagnosers in one file.

use std::fs::File;
use std::path::{Path, PathBuf};

use residual_diagnosis::diagnoser::Description;
use residual_shared::alarm::AlarmTransition;
use residual_shared::record::{Verdict, fault_names};

use super::records::WriteError;

const COLUMNS: [&str; 14] = [
    "run",
    "diagnoser",
    "step",
    "time_ns",
    "alarm",
    "occurrence",
    "flags",
    "verdict",
    "certainly_faulty",
    "possibly_faulty",
    "channel",
    "ratio",
    "fault_estimate",
    "fault_estimate_half_width",
];

/// Writes the transitions of all runs into one file.
pub struct AlarmWriter {
    file: csv::Writer<File>,
    path: PathBuf,
}

impl AlarmWriter {
    /// Creates the file at `path`.
    pub fn create(path: &Path) -> Result<Self, WriteError> {
        let failed = |source| WriteError {
            path: path.into(),
            source,
        };
        let mut file = csv::Writer::from_writer(File::create(path).map_err(failed)?);
        file.write_record(COLUMNS).map_err(|error| failed(error.into()))?;
        let path = path.into();
        Ok(Self { file, path })
    }

    /// Writes one transition of a run; `diagnosers` in the order of their slots.
    pub fn write(
        &mut self,
        run: &str,
        diagnosers: &[(String, Description)],
        transition: &AlarmTransition,
    ) -> Result<(), WriteError> {
        let Some((name, description)) = diagnosers.get(transition.slot as usize) else {
            return Ok(());
        };
        let faults = |set| {
            fault_names(&description.faults, set)
                .collect::<Vec<_>>()
                .join("+")
        };
        let channel = description.channels.get(transition.channel as usize);
        let cells = [
            run.to_owned(),
            name.clone(),
            transition.step.to_string(),
            transition.instant_ns.to_string(),
            transition.state.name().to_owned(),
            transition.occurrence.to_string(),
            transition.flags.to_string(),
            Verdict::from_number(transition.verdict)
                .map_or("", Verdict::name)
                .to_owned(),
            faults(transition.certainly_faulty),
            faults(transition.possibly_faulty),
            channel.map_or(String::new(), |channel| channel.name.clone()),
            transition.ratio.to_string(),
            transition.fault_estimate.to_string(),
            transition.fault_estimate_half_width.to_string(),
        ];
        self.file.write_record(cells).map_err(|error| WriteError {
            path: self.path.clone(),
            source: error.into(),
        })
    }

    /// Writes out what is still buffered.
    pub fn finish(mut self) -> Result<(), WriteError> {
        let path = self.path;
        self.file.flush().map_err(|source| WriteError { path, source })
    }
}
