//! `residuald identify`: disturbance and noise bounds of a model from fault-free recordings.

use std::path::PathBuf;

use clap::Args;
use indicatif::ProgressBar;
use miette::{Diagnostic, IntoDiagnostic, WrapErr};
use residual_diagnosis::model::LinearModel;
use residual_synthesis::identify::{IdentifyOptions, Progress, RunData, identify_bounds};

use super::replay::{Replay, ReplayError, progress_style};
use crate::configuration::{DiagnoserConfiguration, MethodConfiguration};
use crate::replay::selection::RunSelection;
use crate::replay::sequences::sequences;

/// What `residuald identify` takes.
#[derive(Debug, Args)]
pub struct IdentifyArguments {
    /// Configuration with the model and a `[replay]` section; its present bounds are the units of the search.
    pub configuration: PathBuf,
    /// A fault-free recording: CSV with a header line.
    pub recording: PathBuf,
    /// Diagnoser whose bounds are identified; the only one, if there is one.
    #[arg(long)]
    pub diagnoser: Option<String>,
    /// Runs to learn from: all, odd, even (by position), or names separated by commas. The others are for checking.
    #[arg(long, default_value = "all")]
    pub runs: RunSelection,
    /// Share added to every identified bound.
    #[arg(long, default_value_t = IdentifyOptions::default().margin)]
    pub margin: f64,
    /// Length, in steps, of the fault whose detectability decides between noise and disturbance.
    #[arg(long, default_value_t = IdentifyOptions::default().window)]
    pub window: usize,
}

/// Why no diagnoser could be chosen.
#[derive(Debug, thiserror::Error, Diagnostic)]
pub enum ChoiceError {
    /// There are several.
    #[error("the configuration has the diagnosers {0}; choose one with --diagnoser NAME")]
    Several(String),
    /// Its method has no bounds that could be identified.
    #[error(
        "the diagnoser `{name}` runs `{method}`, which has no disturbance and noise bounds; choose one that runs \
         `unknown_input_filter` with --diagnoser NAME"
    )]
    NoBounds {
        /// The diagnoser.
        name: String,
        /// Its method.
        method: &'static str,
    },
    /// There is none of this name.
    #[error("the configuration has no diagnoser `{name}`; it has {known}")]
    Unknown {
        /// The name.
        name: String,
        /// The diagnosers there are.
        known: String,
    },
}

/// Executes the command; the bounds go to standard output.
pub fn execute(arguments: &IdentifyArguments) -> miette::Result<()> {
    let replay = Replay::load(
        &arguments.configuration,
        &arguments.recording,
        &RunSelection::All,
        &[],
        None,
    )?;
    let configuration = &replay.loaded.configuration;
    let diagnoser = choose(&configuration.diagnosers, arguments.diagnoser.as_deref())?;
    let MethodConfiguration::UnknownInputFilter(tables) = &diagnoser.method else {
        return Err(ChoiceError::NoBounds {
            name: diagnoser.name.clone(),
            method: diagnoser.method.name(),
        }
        .into());
    };
    let model = LinearModel::new(&tables.model, diagnoser.sample_time_s()).into_diagnostic()?;

    let known: Vec<&str> = replay.runs().iter().map(|run| run.name.as_str()).collect();
    if let Some(name) = arguments.runs.unknown(&known) {
        return Err(ReplayError::UnknownRun {
            name: name.to_owned(),
            runs: known.join(", "),
        }
        .into());
    }
    let (mut training, mut validation) = (Vec::new(), Vec::new());
    for (position, run) in replay.runs().iter().enumerate() {
        let seen = sequences(configuration, diagnoser, &replay.samples(run));
        let data = RunData {
            name: run.name.clone(),
            commands: seen.commands,
            measurements: seen.measurements,
        };
        let chosen = arguments.runs.takes(position, &run.name);
        if chosen { &mut training } else { &mut validation }.push(data);
    }
    let options = IdentifyOptions {
        margin: arguments.margin,
        window: arguments.window,
        ..Default::default()
    };
    let bar = ProgressBar::new(0).with_style(progress_style());
    let mut progress = |progress: Progress| {
        bar.set_length(progress.runs as u64);
        bar.set_position(progress.runs_done as u64);
        bar.set_message(format!("noise scales {:?}", progress.noise_scales));
    };
    let identification = identify_bounds(&model, &training, &validation, &options, &mut progress)
        .into_diagnostic()
        .wrap_err_with(|| format!("the bounds of `{}` cannot be identified", diagnoser.name))?;
    bar.finish_and_clear();
    println!("{identification}");
    Ok(())
}

fn choose<'a>(
    diagnosers: &'a [DiagnoserConfiguration],
    name: Option<&str>,
) -> Result<&'a DiagnoserConfiguration, ChoiceError> {
    let known = || {
        diagnosers
            .iter()
            .map(|diagnoser| format!("`{}`", diagnoser.name))
            .collect::<Vec<_>>()
            .join(", ")
    };
    match (name, diagnosers) {
        (None, [only]) => Ok(only),
        (None, _) => Err(ChoiceError::Several(known())),
        (Some(name), _) => diagnosers
            .iter()
            .find(|diagnoser| diagnoser.name == name)
            .ok_or_else(|| ChoiceError::Unknown {
                name: name.into(),
                known: known(),
            }),
    }
}
