//! A state-space structure with free entries, identified from fault-free recordings together with its covariances.
//!
//! Fixed entries are numbers; free ones are found by [maximum likelihood](super::likelihood): weighted prediction-error
//! least squares whose weights, the covariances Q and R, are found at the same time. A structure without free entries
//! leaves the covariances. Cross-validation finds the model anew without each of up to five groups of training runs and
//! predicts the group left out; a model that predicts unseen runs much worse than its own is overfitted.

mod deviations;
mod entry;
mod error;
mod figures;
mod structure;

pub use super::likelihood::filter::Plant;
pub use super::likelihood::statistics::Prediction;
pub use entry::{EntryOptions, FreeOptions};
pub use error::{ModelIdentificationError, StructureError};
pub(in crate::identify) use figures::OVERFITTED;
pub use figures::{FoundDeviation, FoundParameter, IdentifiedModel};
pub use structure::{Structure, StructureOptions};

use super::IdentifyError;
use super::likelihood::maximise::{Maximum, MaximumError};
use super::likelihood::noise::NoiseForm;
use super::likelihood::{Likelihood, Unknown};
use super::run_data::{Piece, RunData, Widths, cut};
use crate::bounds::round;
use nalgebra::DMatrix;

/// Groups of runs that are left out in turn.
const FOLDS: usize = 5;
/// Measured values needed for each unknown.
const ELEMENTS_PER_UNKNOWN: usize = 10;
/// How far below its start the standard deviation of a disturbance may sink before it counts as zero, and that of the
/// noise of a measurement, which keeps this value so that R stays positive definite.
const SMALLEST: (f64, f64) = (1e-4, 1e-5);
/// Significant digits of the parameters, and of the entries that follow from them.
const DIGITS: (usize, usize) = (6, 8);
/// Significant digits of a covariance: of a diagonal one, and of a full one, whose smallest eigenvalue may be zero and
/// must not become negative.
const COVARIANCE_DIGITS: (usize, usize) = (6, 14);

/// Identifies the free entries of `structure` and the covariances of its noise; validation runs never decide.
///
/// # Errors
/// [`ModelIdentificationError`]: runs that do not fit or tell too little, or a search without a result.
pub fn identify_model(
    structure: &Structure,
    training: &[RunData],
    validation: &[RunData],
) -> Result<IdentifiedModel, ModelIdentificationError> {
    let widths = Widths {
        commands: structure.command_count(),
        measurements: structure.output_count(),
    };
    let pieces = cut(widths, training)?;
    let held_out = cut(widths, validation)?;
    match training {
        [] => return Err(IdentifyError::NoTrainingRuns.into()),
        [only] => {
            return Err(ModelIdentificationError::SingleRun {
                run: only.name.clone(),
            });
        }
        _ => {}
    }
    let flat: Vec<&Piece> = pieces.iter().flatten().collect();
    check_signals(structure, &flat)?;

    let plant = |parameters: &[f64]| structure.discrete(structure.matrices(parameters));
    let likelihood = likelihood(structure, &plant, &flat)?;
    let elements = flat.iter().map(|piece| received(piece)).sum();
    let needed = ELEMENTS_PER_UNKNOWN * likelihood.unknowns.len();
    if elements < needed {
        let unknowns = likelihood.unknowns.len();
        return Err(ModelIdentificationError::TooFew {
            elements,
            unknowns,
            needed,
        });
    }
    let start: Vec<f64> = likelihood.unknowns.iter().map(|unknown| unknown.start).collect();
    let maximum = maximise(&likelihood, &flat, &start)?;

    let mut left_out = Vec::new();
    let folds = FOLDS.min(pieces.len());
    for fold in 0..folds {
        let (mut others, mut own) = (Vec::new(), Vec::new());
        for (run, pieces) in pieces.iter().enumerate() {
            if run % folds == fold {
                &mut own
            } else {
                &mut others
            }
            .extend(pieces);
        }
        let without = maximise(&likelihood, &others, &maximum.theta)?;
        left_out.push(predict(&likelihood, &reported(&likelihood, &without), &own)?);
    }
    let theta = reported(&likelihood, &maximum);
    let held_out: Vec<&Piece> = held_out.iter().flatten().collect();
    let held_out_prediction = if held_out.is_empty() {
        None
    } else {
        Some(predict(&likelihood, &theta, &held_out)?)
    };

    let (q, r) = covariances(&likelihood, &theta);
    let parameters: Vec<FoundParameter> = structure
        .parameters
        .iter()
        .enumerate()
        .map(|(i, parameter)| FoundParameter {
            name: parameter.name.clone(),
            value: round(maximum.theta[i], DIGITS.0),
            standard_error: maximum.standard_errors[i],
            at_limit: maximum.at_limit[i],
        })
        .collect();
    let values: Vec<f64> = parameters.iter().map(|parameter| parameter.value).collect();
    let matrices = rounded(structure.matrices(&values));
    let discrete = structure
        .discrete(matrices.clone())
        .ok_or(ModelIdentificationError::Start)?;
    Ok(IdentifiedModel {
        plant: rounded(discrete),
        matrices,
        parameters,
        noise: (likelihood.model_count..maximum.theta.len())
            .map(|i| FoundParameter {
                name: likelihood.unknowns[i].name.clone(),
                value: maximum.theta[i],
                standard_error: maximum.standard_errors[i],
                at_limit: maximum.at_limit[i],
            })
            .collect(),
        deviations: deviations::deviations(&likelihood, &maximum, (&q, &r)),
        disturbance_covariance: q,
        measurement_noise_covariance: r,
        initial_state: structure.initial.clone(),
        log_likelihood: -likelihood.value(&theta, flat.iter().copied()),
        iterations: maximum.iterations,
        runs: training.len(),
        training: predict(&likelihood, &theta, &flat)?,
        cross_validation: Prediction::pooled(&left_out),
        validation_runs: validation.len(),
        validation: held_out_prediction,
    })
}

fn likelihood<'a>(
    structure: &Structure,
    plant: &'a dyn Fn(&[f64]) -> Option<Plant>,
    pieces: &[&Piece],
) -> Result<Likelihood<'a>, ModelIdentificationError> {
    let mut unknowns: Vec<Unknown> = structure
        .parameters
        .iter()
        .map(|parameter| Unknown {
            name: parameter.name.clone(),
            start: parameter.start,
            range: parameter.range,
            largest_step: f64::INFINITY,
        })
        .collect();
    let start: Vec<f64> = unknowns.iter().map(|unknown| unknown.start).collect();
    let at_start = plant(&start).ok_or(ModelIdentificationError::Start)?;
    let (disturbance_guess, measurement_guess) = noise_guess(&at_start, pieces);
    let form = |given: &Option<NoiseForm>, guess: &[f64]| {
        given.clone().unwrap_or_else(|| NoiseForm::diagonal(guess))
    };
    let disturbance = form(&structure.disturbance, &disturbance_guess);
    let measurement = form(&structure.measurement, &measurement_guess);
    let model_count = unknowns.len();
    unknowns.extend(disturbance.unknowns(SMALLEST.0, disturbance_name));
    unknowns.extend(measurement.unknowns(SMALLEST.1, measurement_name));
    Ok(Likelihood {
        plant,
        unknowns,
        model_count,
        disturbance,
        measurement,
        initial: structure.initial.clone(),
    })
}

fn disturbance_name(j: usize) -> String {
    format!("disturbance {j}")
}

fn measurement_name(i: usize) -> String {
    format!("the noise of measurement {i}")
}

/// Standard deviations to begin with: what each output changes in a step, by half as noise, by half as disturbance.
fn noise_guess(plant: &Plant, pieces: &[&Piece]) -> (Vec<f64>, Vec<f64>) {
    let change = |i: usize| {
        let mut sum = (0.0, 0_usize);
        for piece in pieces {
            let row = piece.measurements.row(i);
            for k in 1..row.len() {
                let difference = row[k] - row[k - 1];
                if difference.is_finite() {
                    sum = (sum.0 + difference * difference, sum.1 + 1);
                }
            }
        }
        (0.25 * sum.0 / sum.1.max(1) as f64).sqrt()
    };
    let measurement: Vec<f64> = (0..plant.c.nrows())
        .map(change)
        .map(|guess| guess.max(f64::MIN_POSITIVE.sqrt()))
        .collect();
    // Of a state: the change of the outputs that show it; of all outputs if none does.
    let seen = |state: usize| {
        let shown = (0..measurement.len()).map(|i| (plant.c[(i, state)].abs(), measurement[i]));
        let of_state = shown
            .filter(|(entry, _)| *entry > 0.0)
            .map(|(entry, change)| change / entry);
        of_state.reduce(f64::max)
    };
    let any = measurement.iter().copied().fold(0.0, f64::max);
    let disturbance = plant.disturbance.column_iter().map(|column| {
        let of_entry =
            |(state, entry): (usize, &f64)| (*entry != 0.0).then(|| seen(state).unwrap_or(any) / entry.abs());
        column
            .iter()
            .enumerate()
            .filter_map(of_entry)
            .reduce(f64::min)
            .unwrap_or(0.0)
    });
    (disturbance.collect(), measurement)
}

fn maximise(
    likelihood: &Likelihood<'_>,
    pieces: &[&Piece],
    start: &[f64],
) -> Result<Maximum, ModelIdentificationError> {
    likelihood.maximise(pieces, start).map_err(|error| match error {
        MaximumError::Start => ModelIdentificationError::Start,
        MaximumError::NotConverged {
            iterations,
            decrement,
        } => ModelIdentificationError::NotConverged {
            iterations,
            decrement,
        },
        MaximumError::Undetermined { unknowns } => ModelIdentificationError::Undetermined {
            names: unknowns
                .iter()
                .map(|&i| likelihood.unknowns[i].name.clone())
                .collect(),
        },
    })
}

fn predict(
    likelihood: &Likelihood<'_>,
    theta: &[f64],
    pieces: &[&Piece],
) -> Result<Prediction, ModelIdentificationError> {
    likelihood
        .prediction(theta, pieces.iter().copied())
        .ok_or(ModelIdentificationError::Start)
}

/// θ with the diagonal entries of the factor of Q that sank to the end of their range at zero, whose logarithm is
/// -infinity: a disturbance vanishes, or what the disturbances before it do not tell of it. R keeps its own.
fn reported(likelihood: &Likelihood<'_>, maximum: &Maximum) -> Vec<f64> {
    let mut theta = maximum.theta.clone();
    let first = likelihood.model_count;
    let of_q = first..first + likelihood.disturbance.count();
    for i in of_q.filter(|&i| maximum.at_limit[i] && maximum.theta[i] <= likelihood.unknowns[i].range.0) {
        theta[i] = f64::NEG_INFINITY;
    }
    theta
}

/// Q and R of θ, rounded.
fn covariances(likelihood: &Likelihood<'_>, theta: &[f64]) -> (DMatrix<f64>, DMatrix<f64>) {
    let (q, r) = likelihood.covariances(theta);
    let rounded = |form: &NoiseForm, covariance: DMatrix<f64>| {
        let digits = if form.is_full() {
            COVARIANCE_DIGITS.1
        } else {
            COVARIANCE_DIGITS.0
        };
        covariance.map(|entry| round(entry, digits))
    };
    (
        rounded(&likelihood.disturbance, q),
        rounded(&likelihood.measurement, r),
    )
}

fn rounded(plant: Plant) -> Plant {
    let round = |matrix: DMatrix<f64>| matrix.map(|entry| round(entry, DIGITS.1));
    Plant {
        a: round(plant.a),
        b: round(plant.b),
        c: round(plant.c),
        feedthrough: round(plant.feedthrough),
        disturbance: round(plant.disturbance),
    }
}

fn received(piece: &Piece) -> usize {
    piece
        .measurements
        .iter()
        .filter(|value| value.is_finite())
        .count()
}

/// Refuses signals that tell nothing.
fn check_signals(structure: &Structure, pieces: &[&Piece]) -> Result<(), ModelIdentificationError> {
    let constant = |values: &mut dyn Iterator<Item = f64>| {
        let mut values = values.filter(|value| value.is_finite());
        let first = values.next();
        (
            first,
            first.is_some_and(|first| values.all(|value| value == first)),
        )
    };
    for index in 0..structure.output_count() {
        let mut values = pieces
            .iter()
            .flat_map(|piece| piece.measurements.row(index).iter().copied().collect::<Vec<_>>());
        match constant(&mut values) {
            (None, _) => return Err(ModelIdentificationError::NeverReceived { index }),
            (Some(value), true) => {
                let kind = "measurement";
                return Err(ModelIdentificationError::Constant { kind, index, value });
            }
            _ => {}
        }
    }
    for index in (0..structure.command_count()).filter(|&command| structure.is_command_free(command)) {
        let mut values = pieces
            .iter()
            .flat_map(|piece| piece.commands.row(index).iter().copied().collect::<Vec<_>>());
        if let (Some(value), true) = constant(&mut values) {
            let kind = "command";
            return Err(ModelIdentificationError::Constant { kind, index, value });
        }
    }
    Ok(())
}
