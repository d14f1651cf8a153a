//! The structure file of `residuald identify --model`: what is known of a model, and what of it is to be found.

use std::path::{Path, PathBuf};

use miette::Diagnostic;
use residual_synthesis::identify::model::StructureOptions;
use serde::Deserialize;

use super::RequestError;

/// The method whose model section is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Target {
    /// Model with bounds.
    UnknownInputFilter,
    /// Model with bounds, discrete.
    ReducedOrderObserver,
    /// Model with covariances, discrete.
    ChiSquare,
    /// Not served.
    AsyncImm,
    /// Not served.
    HinfFilter,
}

impl Target {
    /// Refuses the methods that are not served.
    ///
    /// # Errors
    /// [`RequestError::Method`].
    pub fn check(self) -> Result<(), RequestError> {
        let (method, needs) = match self {
            Self::AsyncImm => ("async_imm", ASYNC_IMM_NEEDS),
            Self::HinfFilter => ("hinf_filter", HINF_FILTER_NEEDS),
            _ => return Ok(()),
        };
        Err(RequestError::Method { method, needs })
    }
}

/// What the methods that are not served would need.
pub const ASYNC_IMM_NEEDS: &str = "the power spectral densities of a model of packets at any moment";
/// See [`ASYNC_IMM_NEEDS`].
pub const HINF_FILTER_NEEDS: &str = "amplitude and rate of a continuous disturbance";

/// How the recording is read; keys as in `[replay]`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RecordingOptions {
    /// Column with the time, seconds.
    pub time_column: String,
    /// Column that tells the runs apart.
    #[serde(default)]
    pub run_column: Option<String>,
    /// Column with the kind of each run, which is no number; not used.
    #[serde(default)]
    pub kind_column: Option<String>,
    /// Column that labels faults; rows from the first labelled one of a run on are left out.
    #[serde(default)]
    pub fault_column: Option<String>,
    /// Each row is an instant, whenever it was recorded; default: the time column decides.
    #[serde(default)]
    pub rows_are_instants: bool,
    /// Takes every so many rows. Default 1.
    #[serde(default = "one")]
    pub every_rows: usize,
}

fn one() -> usize {
    1
}

/// θ s(k - l).
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TermOptions {
    /// Expression over the columns.
    pub value: String,
    /// l: rows back. Default 0.
    #[serde(default)]
    pub lag: usize,
    /// θ, if it is known.
    #[serde(default)]
    pub coefficient: Option<f64>,
}

/// `[[equation]]`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EquationOptions {
    /// Expression over the columns.
    pub output: String,
    /// The terms.
    pub terms: Vec<TermOptions>,
    /// Whether a constant is added. Default false.
    #[serde(default)]
    pub constant: bool,
}

/// The whole file.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StructureFile {
    /// The method whose model section is written.
    pub method: Target,
    /// Sampling period, seconds.
    pub sample_time_s: f64,
    /// How the recording is read.
    pub recording: RecordingOptions,
    /// Measurements of `[model]`: expressions over the columns.
    #[serde(default)]
    pub measurements: Vec<String>,
    /// Its commands.
    #[serde(default)]
    pub commands: Vec<String>,
    /// A structure with free entries.
    #[serde(default)]
    pub model: Option<StructureOptions>,
    /// Regressions.
    #[serde(default)]
    pub equation: Vec<EquationOptions>,
}

/// What is wrong with a structure file.
#[derive(Debug, thiserror::Error, Diagnostic)]
pub enum StructureFileError {
    /// It cannot be read.
    #[error("cannot read `{path}`: {source}")]
    Read {
        /// The file.
        path: PathBuf,
        /// The reason.
        source: std::io::Error,
    },
    /// It is not what a structure file is.
    #[error("`{path}` is not a structure file: {source}")]
    Parse {
        /// The file.
        path: PathBuf,
        /// The reason, with line and column.
        source: toml::de::Error,
    },
    /// Neither or both forms.
    #[error("`{0}` needs either a [model] with free entries or [[equation]] sections, and not both")]
    Form(PathBuf),
    /// Measurements missing or misplaced.
    #[error("`{path}`: {reason}")]
    Signals {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: &'static str,
    },
    /// A period that is none.
    #[error("`{path}`: `sample_time_s` is {value}; use a number from 1e-5 to 3600")]
    SampleTime {
        /// The file.
        path: PathBuf,
        /// Its value.
        value: f64,
    },
    /// No rows are taken.
    #[error("`{0}`: `every_rows` is 0; use 1 to take every row")]
    EveryRows(PathBuf),
}

impl StructureFile {
    /// Reads and checks a file.
    ///
    /// # Errors
    /// A report of the first mistake.
    pub fn read(path: &Path) -> miette::Result<Self> {
        let text = std::fs::read_to_string(path).map_err(|source| StructureFileError::Read {
            path: path.into(),
            source,
        })?;
        let file: Self = toml::from_str(&text).map_err(|source| StructureFileError::Parse {
            path: path.into(),
            source,
        })?;
        file.check(path)?;
        file.method.check()?;
        Ok(file)
    }

    fn check(&self, path: &Path) -> Result<(), StructureFileError> {
        let path = path.to_path_buf();
        if self.model.is_some() != self.equation.is_empty() {
            return Err(StructureFileError::Form(path));
        }
        let reason = match &self.model {
            Some(_) if self.measurements.is_empty() => {
                Some("[model] needs `measurements`: one expression for each row of C")
            }
            None if !(self.measurements.is_empty() && self.commands.is_empty()) => {
                Some("`measurements` and `commands` belong to [model]; equations name their own expressions")
            }
            _ => None,
        };
        if let Some(reason) = reason {
            return Err(StructureFileError::Signals { path, reason });
        }
        if !(1e-5..=3600.0).contains(&self.sample_time_s) {
            let value = self.sample_time_s;
            return Err(StructureFileError::SampleTime { path, value });
        }
        if self.recording.every_rows == 0 {
            return Err(StructureFileError::EveryRows(path));
        }
        Ok(())
    }
}
