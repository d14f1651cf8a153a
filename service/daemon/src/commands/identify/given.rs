//! Bounds or covariances of the model of a configuration, as its method needs them.

use miette::{IntoDiagnostic, WrapErr};
use nalgebra::{DMatrix, DVector};
use residual_diagnosis::chi_square::{ChiSquareOptions, Schedule};
use residual_diagnosis::model::{LinearModel, ModelOptions};
use residual_diagnosis::reduced_order_observer::options::ReducedOrderObserverOptions;
use residual_synthesis::identify::model::{EntryOptions, Structure, StructureOptions, identify_model};
use residual_synthesis::identify::{Identification, RunData};

use super::section::Section;
use super::structure_file::{ASYNC_IMM_NEEDS, HINF_FILTER_NEEDS};
use super::{IdentifyArguments, RequestError, Split, bounds_of, part_instants, part_name, split};
use crate::commands::replay::Replay;
use crate::configuration::{DiagnoserConfiguration, MethodConfiguration};
use crate::replay::selection::RunSelection;
use crate::replay::sequences::sequences;

/// What was found, as text.
///
/// # Errors
/// A report of what was wrong.
pub fn identify(arguments: &IdentifyArguments) -> miette::Result<String> {
    let replay = Replay::load(
        &arguments.configuration,
        &arguments.recording,
        &RunSelection::All,
        &[],
        None,
    )?;
    let diagnoser = choose(
        &replay.loaded.configuration.diagnosers,
        arguments.diagnoser.as_deref(),
    )?;
    let runs = runs(arguments, &replay, diagnoser)?;
    let period = diagnoser.sample_time_s();
    let failed = || format!("nothing can be identified for `{}`", diagnoser.name);
    match &diagnoser.method {
        MethodConfiguration::UnknownInputFilter(tables) => {
            let model = LinearModel::new(&tables.model, period).into_diagnostic()?;
            Ok(bounds_of(arguments, &model, &runs)
                .wrap_err_with(failed)?
                .to_string())
        }
        MethodConfiguration::ReducedOrderObserver(tables) => {
            let model = LinearModel::new(&symmetric(tables), period).into_diagnostic()?;
            let found = bounds_of(arguments, &model, &runs).wrap_err_with(failed)?;
            let mut section = Section::default();
            observer_bounds(&mut section, &found);
            Ok(format!("{}\n{section}\n", found.figures()))
        }
        MethodConfiguration::ChiSquare(tables) => {
            if tables.model.schedule != Schedule::Constant {
                return Err(RequestError::Schedule(diagnoser.name.clone()).into());
            }
            covariances(diagnoser, tables, &runs).wrap_err_with(failed)
        }
        MethodConfiguration::AsyncImm(_) => Err(refusal(diagnoser, ASYNC_IMM_NEEDS)),
        MethodConfiguration::HinfFilter(_) => Err(refusal(diagnoser, HINF_FILTER_NEEDS)),
    }
}

fn refusal(diagnoser: &DiagnoserConfiguration, needs: &'static str) -> miette::Report {
    RequestError::Method {
        method: diagnoser.method.name(),
        needs,
    }
    .into()
}

/// What the diagnoser sees of every run before its first labelled fault.
fn runs(
    arguments: &IdentifyArguments,
    replay: &Replay,
    diagnoser: &DiagnoserConfiguration,
) -> miette::Result<Split<RunData>> {
    let instants = part_instants(arguments.part_length, diagnoser.sample_time_s())?;
    let mut runs = Vec::with_capacity(replay.runs().len());
    for run in replay.runs() {
        let mut samples = replay.samples(run);
        if let Some(onset_ns) = run.labelled_onset_ns {
            samples.retain(|sample| run.recorded_at_ns(sample.time_ns) < onset_ns);
        }
        if samples.is_empty() {
            runs.push((run.name.clone(), Vec::new()));
            continue;
        }
        let seen = sequences(&replay.loaded.configuration, diagnoser, &samples);
        let length = instants.min(seen.commands.len().max(1));
        let count = seen.commands.len().div_ceil(length);
        let parts = seen.commands.chunks(length).zip(seen.measurements.chunks(length));
        let parts = parts.enumerate().map(|(part, (commands, measurements))| RunData {
            name: part_name(&run.name, part, count),
            commands: commands.to_vec(),
            measurements: measurements.to_vec(),
        });
        runs.push((run.name.clone(), parts.collect()));
    }
    Ok(split(&arguments.runs, runs)?)
}

/// The observer's plant with its boxes as symmetric bounds, which are the units of the search.
fn symmetric(tables: &ReducedOrderObserverOptions) -> ModelOptions {
    let model = &tables.model;
    let pairs = model.disturbance_lower.iter().zip(&model.disturbance_upper);
    ModelOptions {
        a: model.a.clone(),
        b: model.b.clone(),
        c: model.c.clone(),
        d: model.d.clone(),
        disturbance_bound: pairs.map(|(lower, upper)| lower.abs().max(upper.abs())).collect(),
        measurement_noise_bound: if model.measurement_noise_bound.is_empty() {
            vec![0.0; model.c.len()]
        } else {
            model.measurement_noise_bound.clone()
        },
        actuator_names: model.actuator_names.clone(),
        actuator_units: model.actuator_units.clone(),
        output_names: model.output_names.clone(),
        output_units: model.output_units.clone(),
        ..ModelOptions::default()
    }
}

/// The bounds with the keys of the observer.
pub(super) fn observer_bounds(section: &mut Section, found: &Identification) {
    let bounds = &found.best.bounds;
    if !bounds.disturbance.is_empty() {
        section.list("disturbance_lower", bounds.disturbance.iter().map(|bound| -bound));
        section.list("disturbance_upper", bounds.disturbance.iter().copied());
    }
    section.list("measurement_noise_bound", bounds.measurement.iter().copied());
}

/// Q and R of the configured model; the configured ones are the start, and their zeros stay.
fn covariances(
    diagnoser: &DiagnoserConfiguration,
    tables: &ChiSquareOptions,
    runs: &Split<RunData>,
) -> miette::Result<String> {
    let model = &tables.model;
    let states = model.transition.len();
    let fixed = |rows: &[Vec<f64>]| -> Vec<Vec<EntryOptions>> {
        let row = |row: &Vec<f64>| row.iter().copied().map(EntryOptions::Number).collect();
        rows.iter().map(row).collect()
    };
    let unit: Vec<Vec<f64>> = (0..states)
        .map(|i| (0..states).map(|j| f64::from(u8::from(i == j))).collect())
        .collect();
    let options = StructureOptions {
        a: fixed(&model.transition),
        b: fixed(&model.input),
        c: fixed(&model.measurement),
        feedthrough: fixed(&model.feedthrough),
        d: fixed(if model.process_noise_input.is_empty() {
            &unit
        } else {
            &model.process_noise_input
        }),
        disturbance_covariance: Some(model.process_noise_covariance.clone()),
        measurement_noise_covariance: Some(model.measurement_noise_covariance.clone()),
        initial_state_radius: vec![1.0; states],
        ..StructureOptions::default()
    };
    let (outputs, commands) = (diagnoser.measurements.len(), diagnoser.commands.len());
    let mean = model.initial_state.clone().unwrap_or_else(|| vec![0.0; states]);
    let entry = |i: usize, j: usize| {
        model
            .initial_covariance
            .get(i)
            .and_then(|row| row.get(j))
            .copied()
    };
    let covariance = DMatrix::from_fn(states, states, |i, j| entry(i, j).unwrap_or(0.0));
    let structure = Structure::new(&options, diagnoser.sample_time_s(), outputs, commands)
        .into_diagnostic()?
        .with_initial_state(DVector::from_vec(mean), covariance);
    let found = identify_model(&structure, &runs.training, &runs.validation).into_diagnostic()?;
    let names: Vec<String> = (0..outputs)
        .map(|i| {
            let named = model
                .measurement_names
                .as_ref()
                .and_then(|names| names.get(i).cloned());
            named.unwrap_or_else(|| format!("measurement {i}"))
        })
        .collect();
    let mut section = Section::default();
    section.comment(format_args!(
        "Covariances of `{}` by maximum likelihood.",
        diagnoser.name
    ));
    section.predictions(&found, &names);
    section.matrix("process_noise_covariance", &found.disturbance_covariance);
    section.matrix(
        "measurement_noise_covariance",
        &found.measurement_noise_covariance,
    );
    Ok(section.to_string())
}

fn choose<'a>(
    diagnosers: &'a [DiagnoserConfiguration],
    name: Option<&str>,
) -> Result<&'a DiagnoserConfiguration, RequestError> {
    let known = || {
        diagnosers
            .iter()
            .map(|diagnoser| format!("`{}`", diagnoser.name))
            .collect::<Vec<_>>()
            .join(", ")
    };
    match (name, diagnosers) {
        (None, [only]) => Ok(only),
        (None, _) => Err(RequestError::Several(known())),
        (Some(name), _) => diagnosers
            .iter()
            .find(|diagnoser| diagnoser.name == name)
            .ok_or_else(|| RequestError::Unknown {
                name: name.into(),
                known: known(),
            }),
    }
}
