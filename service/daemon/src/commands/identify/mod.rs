//! `residuald identify`: models, bounds and covariances from fault-free recordings.
//!
//! | module | what |
//! |---|---|
//! | [`given`] | bounds or covariances of the model of a configuration |
//! | [`structure_file`] | a model that is not known yet, as a user writes it down |
//! | [`signals`] | a recording as the rows that such a file speaks of |
//! | [`states`] | its free entries |
//! | [`equations`] | its regressions |
//! | [`section`] | the text of a model section |

pub mod equations;
pub mod given;
pub mod section;
pub mod signals;
pub mod states;
pub mod structure_file;

use std::path::PathBuf;

use clap::Args;
use indicatif::ProgressBar;
use miette::{Diagnostic, IntoDiagnostic, WrapErr};
use residual_diagnosis::model::LinearModel;
use residual_synthesis::identify::{
    Identification, IdentifyError, IdentifyOptions, Progress, RunData, identify_bounds,
};

use super::replay::{ReplayError, progress_style};
use crate::replay::selection::RunSelection;
use section::Section;

/// What `residuald identify` takes.
#[derive(Debug, Args)]
pub struct IdentifyArguments {
    /// Configuration with the model and a `[replay]` section; its present bounds or covariances are the units and the
    /// start of the search. With --model: a structure file.
    pub configuration: PathBuf,
    /// A fault-free recording: CSV with a header line.
    pub recording: PathBuf,
    /// Identify the model as well: the first file is a structure file, which says what is known of it.
    #[arg(long, conflicts_with = "diagnoser")]
    pub model: bool,
    /// Diagnoser whose bounds or covariances are identified; the only one, if there is one.
    #[arg(long)]
    pub diagnoser: Option<String>,
    /// Runs to learn from: all, odd, even (by position), or names separated by commas. The others are for checking.
    #[arg(long, default_value = "all")]
    pub runs: RunSelection,
    /// Cut every run into parts of this length, seconds, which then count as runs: for recordings of a single run.
    #[arg(long, value_name = "SECONDS")]
    pub part_length: Option<f64>,
    /// Share added to every identified bound.
    #[arg(long, default_value_t = IdentifyOptions::default().margin)]
    pub margin: f64,
    /// Length, in steps, of the fault whose detectability decides between noise and disturbance;
    /// at most the longest run.
    #[arg(long, default_value_t = IdentifyOptions::default().window)]
    pub window: usize,
}

/// Why a request cannot be served.
#[derive(Debug, thiserror::Error, Diagnostic)]
pub enum RequestError {
    /// There are several.
    #[error("the configuration has the diagnosers {0}; choose one with --diagnoser NAME")]
    Several(String),
    /// There is none of this name.
    #[error("the configuration has no diagnoser `{name}`; it has {known}")]
    Unknown {
        /// The name.
        name: String,
        /// The diagnosers there are.
        known: String,
    },
    /// Its method is not served.
    #[error(
        "`{method}` needs {needs}, which cannot be identified; served are `unknown_input_filter` and \
         `reduced_order_observer` (bounds) and `chi_square` (covariances)"
    )]
    Method {
        /// The method.
        method: &'static str,
        /// What it would need.
        needs: &'static str,
    },
    /// Its model changes while it runs.
    #[error(
        "the diagnoser `{0}` has a schedule of models; identify the covariances of one model with \
         `schedule = \"constant\"` at a time"
    )]
    Schedule(String),
    /// A length of parts that holds no transition.
    #[error("parts of {length} s hold less than two sampling periods of {period} s; lengthen --part-length")]
    PartLength {
        /// As asked for.
        length: f64,
        /// Sampling period.
        period: f64,
    },
}

/// Runs to learn from and runs to check with.
pub struct Split<T> {
    /// To learn from.
    pub training: Vec<T>,
    /// To check with.
    pub validation: Vec<T>,
}

/// Executes the command; what was found goes to standard output.
///
/// # Errors
/// A report of what was wrong, and what to do about it.
pub fn execute(arguments: &IdentifyArguments) -> miette::Result<()> {
    let found = if arguments.model {
        let file = structure_file::StructureFile::read(&arguments.configuration)?;
        if file.model.is_some() {
            states::identify(arguments, &file)?
        } else {
            equations::identify(arguments, &file)?
        }
    } else {
        given::identify(arguments)?
    };
    println!("{found}");
    Ok(())
}

/// Distributes runs by their positions and names.
///
/// # Errors
/// [`ReplayError::UnknownRun`].
pub fn split<T>(selection: &RunSelection, runs: Vec<(String, Vec<T>)>) -> Result<Split<T>, ReplayError> {
    let known: Vec<&str> = runs.iter().map(|(name, _)| name.as_str()).collect();
    if let Some(name) = selection.unknown(&known) {
        return Err(ReplayError::UnknownRun {
            name: name.to_owned(),
            runs: known.join(", "),
        });
    }
    let mut split = Split {
        training: Vec::new(),
        validation: Vec::new(),
    };
    for (position, (name, parts)) in runs.into_iter().enumerate() {
        if selection.takes(position, &name) {
            split.training.extend(parts);
        } else {
            split.validation.extend(parts);
        }
    }
    Ok(split)
}

/// Instants of a part; all without `--part-length`.
///
/// # Errors
/// [`RequestError::PartLength`].
pub fn part_instants(length: Option<f64>, period: f64) -> Result<usize, RequestError> {
    let Some(length) = length else {
        return Ok(usize::MAX);
    };
    let instants = (length / period).round();
    if instants >= 2.0 && instants.is_finite() {
        Ok(instants as usize)
    } else {
        Err(RequestError::PartLength { length, period })
    }
}

/// The name of part `part` of a run that was cut into `parts`.
pub fn part_name(run: &str, part: usize, parts: usize) -> String {
    if parts == 1 {
        return run.to_owned();
    }
    format!("{run} part {}", part + 1).trim_start().to_owned()
}

/// Noise scales of a model whose unit of noise is what its predictions miss: noise is no larger than that.
const NOISE_SCALES: [f64; 5] = [0.25, 0.35, 0.5, 0.7, 1.0];

/// The bounds of a model whose unit of noise is three standard deviations of its innovations. Recordings that contradict
/// every such bound get the wider search of a model of unknown units, and `section` says so.
fn bounds_of_innovations(
    section: &mut Section,
    arguments: &IdentifyArguments,
    model: &LinearModel,
    runs: &Split<RunData>,
) -> miette::Result<Identification> {
    match search_bounds(arguments, model, runs, NOISE_SCALES.to_vec()) {
        Err(IdentifyError::Infeasible { .. }) => {
            let wide = IdentifyOptions::default().noise_scales;
            let largest = wide.iter().copied().fold(0.0, f64::max);
            section.comment(format_args!(
                "No noise bound up to three standard deviations of the innovations explains all training runs; bounds \
                 up to {largest} times these were tried."
            ));
            bounds_of(arguments, model, runs)
        }
        found => found.into_diagnostic().wrap_err(NO_BOUNDS),
    }
}

/// The bounds of a model in the units of its present ones.
fn bounds_of(
    arguments: &IdentifyArguments,
    model: &LinearModel,
    runs: &Split<RunData>,
) -> miette::Result<Identification> {
    let scales = IdentifyOptions::default().noise_scales;
    search_bounds(arguments, model, runs, scales)
        .into_diagnostic()
        .wrap_err(NO_BOUNDS)
}

const NO_BOUNDS: &str = "the bounds cannot be identified";

fn search_bounds(
    arguments: &IdentifyArguments,
    model: &LinearModel,
    runs: &Split<RunData>,
    noise_scales: Vec<f64>,
) -> Result<Identification, IdentifyError> {
    let options = IdentifyOptions {
        margin: arguments.margin,
        window: arguments.window,
        noise_scales,
        ..Default::default()
    };
    let bar = ProgressBar::new(0).with_style(progress_style());
    let mut progress = |progress: Progress| {
        bar.set_length(progress.runs as u64);
        bar.set_position(progress.runs_done as u64);
        bar.set_message(format!("noise scales {:?}", progress.noise_scales));
    };
    let found = identify_bounds(model, &runs.training, &runs.validation, &options, &mut progress);
    bar.finish_and_clear();
    found
}
