//! Regressions as a model section.

use miette::{IntoDiagnostic, WrapErr};
use nalgebra::{DMatrix, DVector};
use residual_synthesis::bounds::round;
use residual_synthesis::identify::RunData;
use residual_synthesis::identify::model::Plant;
use residual_synthesis::identify::regression::{
    Equation, FoundEquation, Regression, SignalRun, Term, identify_regression,
};

use super::section::{Section, number};
use super::states::Bounded;
use super::structure_file::{StructureFile, Target};
use super::{IdentifyArguments, Split, signals};

/// Significant digits of what is written.
const DIGITS: usize = 6;
/// Standard deviations of a residual that a bound has before its search: its unit.
const UNIT: f64 = 3.0;

/// What was found, as text.
///
/// # Errors
/// A report of what was wrong.
pub fn identify(arguments: &IdentifyArguments, file: &StructureFile) -> miette::Result<String> {
    let mut names: Vec<String> = Vec::new();
    let mut place = |text: &str| {
        names.iter().position(|name| name == text).unwrap_or_else(|| {
            names.push(text.to_owned());
            names.len() - 1
        })
    };
    let mut equations = Vec::with_capacity(file.equation.len());
    for equation in &file.equation {
        let output = place(&equation.output);
        let term = |term: &super::structure_file::TermOptions| Term {
            signal: place(&term.value),
            lag: term.lag,
            coefficient: term.coefficient,
        };
        equations.push(Equation {
            output,
            terms: equation.terms.iter().map(term).collect(),
            constant: equation.constant,
        });
    }
    let runs = signals::read(arguments, file, &arguments.recording, &names)?;
    let found = identify_regression(&names, &equations, &runs.training, &runs.validation)
        .into_diagnostic()
        .wrap_err("the coefficients cannot be identified")?;
    let mut section = Section::default();
    section.comment(format_args!(
        "Identified from {} by least squares; {} runs, {} held out.",
        arguments.recording.display(),
        runs.training.len(),
        runs.validation.len()
    ));
    for (equation, found) in found.equations.iter().zip(&found.found) {
        figures(&mut section, &names, equation, found);
    }
    match file.method {
        Target::ChiSquare => innovations(&mut section, &names, &found),
        _ => with_bounds(&mut section, arguments, file, &names, &found, &runs)?,
    }
    Ok(section.to_string())
}

fn figures(section: &mut Section, names: &[String], equation: &Equation, found: &FoundEquation) {
    section.comment(format_args!("{}:", names[equation.output]));
    let terms = equation.terms.iter().map(|term| match term.lag {
        0 => names[term.signal].clone(),
        lag => format!("{} ({lag} back)", names[term.signal]),
    });
    let terms = terms.chain(equation.constant.then(|| "the constant".to_owned()));
    for (name, (value, error)) in terms.zip(found.coefficients.iter().zip(&found.standard_errors)) {
        let error = error.map_or("given".to_owned(), |error| {
            format!("+- {error:.2e} (standard error)")
        });
        section.comment(format_args!(
            "  {} * {name}  {error}",
            number(round(*value, DIGITS))
        ));
    }
    let mut fits = vec![
        ("training", &found.training),
        ("cross-validation", &found.cross_validation),
    ];
    fits.extend(found.validation.as_ref().map(|fit| ("held out", fit)));
    for (name, fit) in fits {
        section.comment(format_args!(
            "  {name}: rms {:.4e}, R2 {:.4}, {} rows",
            fit.rms, fit.r_squared, fit.rows
        ));
    }
    section.comment(format_args!(
        "  condition number {:.1}, correlation of successive residuals {:.2}, {} rows left out for want of a value",
        found.condition, found.correlation, found.skipped
    ));
    if found.is_overfitted() {
        section.overfitted(found.cross_validation.rms / found.training.rms);
    }
}

/// The shift register whose innovations are the residuals.
fn innovations(section: &mut Section, names: &[String], found: &Regression) {
    let model = found.shift_register();
    let short = |matrix: &DMatrix<f64>| matrix.map(|entry| round(entry, DIGITS));
    let list = |signals: &mut dyn Iterator<Item = usize>| {
        let texts: Vec<String> = signals.map(|signal| names[signal].clone()).collect();
        texts.join(", ")
    };
    section.comment(format_args!(
        "measurements: {}",
        list(&mut found.equations.iter().map(|equation| equation.output))
    ));
    section.comment(format_args!(
        "commands (past values of measurements among them): {}",
        list(&mut model.commands.iter().copied())
    ));
    let states = model.transition.nrows();
    section.line("[diagnoser.model]");
    section.matrix("transition", &model.transition);
    section.matrix("input", &short(&model.input));
    section.matrix("measurement", &short(&model.measurement));
    section.matrix("feedthrough", &short(&model.feedthrough));
    section.comment("All that a measurement depends on has been measured; the residual is its only noise.");
    section.matrix("process_noise_covariance", &DMatrix::zeros(states, states));
    section.matrix("measurement_noise_covariance", &short(&found.residual_covariance));
    // Past commands are unknown at the start: what they contribute is at most of the size of the outputs.
    let mut start = DMatrix::zeros(states, states);
    let past = states - usize::from(model.has_constant);
    let size = output_square(found);
    start.view_mut((0, 0), (past, past)).fill_with_identity();
    start *= round(size, 2);
    let mut mean = DVector::zeros(states);
    if model.has_constant {
        mean[past] = 1.0;
        section.comment("The last state stays 1: it carries the constants.");
    }
    section.list("initial_state", mean.iter().copied());
    section.matrix("initial_covariance", &start);
}

/// Ten times the largest mean square of an output about its mean: rms² / (1 - R²).
fn output_square(found: &Regression) -> f64 {
    let square = |fit: &FoundEquation| fit.training.rms.powi(2) / (1.0 - fit.training.r_squared).max(1e-12);
    10.0 * found.found.iter().map(square).fold(0.0, f64::max)
}

/// The outputs as states, with bounds.
fn with_bounds(
    section: &mut Section,
    arguments: &IdentifyArguments,
    file: &StructureFile,
    names: &[String],
    found: &Regression,
    runs: &Split<SignalRun>,
) -> miette::Result<()> {
    let model = found.first_order().into_diagnostic()?;
    let outputs: Vec<usize> = found.equations.iter().map(|equation| equation.output).collect();
    let as_data = |runs: &[SignalRun]| -> Vec<RunData> {
        let pick = |row: &Vec<f64>, signals: &[usize]| signals.iter().map(|&signal| row[signal]).collect();
        let data = |run: &SignalRun| RunData {
            name: run.name.clone(),
            commands: run.rows.iter().map(|row| pick(row, &model.commands)).collect(),
            measurements: run.rows.iter().map(|row| pick(row, &outputs)).collect(),
        };
        runs.iter().map(data).collect()
    };
    let data = Split {
        training: as_data(&runs.training),
        validation: as_data(&runs.validation),
    };
    let size = outputs.len();
    let unit: Vec<f64> = found.found.iter().map(|fit| UNIT * fit.training.rms).collect();
    let largest = |output: usize| {
        let values = data
            .training
            .iter()
            .flat_map(|run| &run.measurements)
            .map(|y| y[output].abs());
        values.filter(|value| value.is_finite()).fold(0.0, f64::max)
    };
    let list: Vec<&str> = model
        .commands
        .iter()
        .map(|&signal| names[signal].as_str())
        .collect();
    section.comment(format_args!("commands: {}", list.join(", ")));
    Bounded {
        plant: Plant {
            a: model.a.map(|entry| round(entry, DIGITS)),
            b: model.b.map(|entry| round(entry, DIGITS)),
            c: DMatrix::identity(size, size),
            feedthrough: DMatrix::zeros(size, model.commands.len()),
            disturbance: DMatrix::identity(size, size),
        },
        continuous: false,
        disturbance: unit.clone(),
        measurement: unit,
        center: vec![0.0; size],
        radius: (0..size).map(|output| round(2.0 * largest(output), 2)).collect(),
    }
    .write(section, arguments, file, &data)
}
