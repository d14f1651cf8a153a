//! One step of the ladder: bounds for given noise scales, and how far they can be trusted.

use super::report::{StepBounds, StepOutcome};
use super::run_data::{Piece, Widths, cut};
use super::trajectory::{Goal, Plant, TrajectoryError};
use super::{IdentifyError, IdentifyOptions, RunData};
use crate::bounds::{NoiseBounds, round_up};
use crate::conic::SolverError;
use crate::unknown_input_filter::floors::{FloorQuestion, solve};
use nalgebra::DVector;
use residual_diagnosis::model::LinearModel;
use residual_diagnosis::unknown_input_filter::modes::FaultMode;

/// What a factor may exceed 1 by and still count as consistent: the accuracy of the solver.
const FACTOR_TOLERANCE: f64 = 1e-7;

/// The programs get noise bounds this much smaller, so that the checked trajectory keeps the bound itself and
/// rounding does not add a digit.
const NOISE_RESERVE: f64 = 1e-7;

/// Model, recordings and options of an identification.
pub(super) struct Evaluator<'a> {
    model: &'a LinearModel,
    options: &'a IdentifyOptions,
    training: Vec<Vec<Piece>>,
    validation: Vec<Vec<Piece>>,
    training_names: Vec<&'a str>,
    validation_names: Vec<&'a str>,
    plant: Plant<'a>,
}

/// What one training run needs at given noise scales.
enum RunNeed {
    /// Its disturbance scales, and what it uses of each noise bound, relative to it.
    Scales(DVector<f64>, DVector<f64>),
    /// No disturbance explains it; the smallest common factor of the noise bounds that would.
    Infeasible(f64),
}

impl<'a> Evaluator<'a> {
    pub(super) fn new(
        model: &'a LinearModel,
        training: &'a [RunData],
        validation: &'a [RunData],
        options: &'a IdentifyOptions,
    ) -> Result<Self, IdentifyError> {
        let names = |runs: &'a [RunData]| runs.iter().map(|run| run.name.as_str()).collect();
        let widths = Widths {
            commands: model.actuator_count(),
            measurements: model.output_count(),
        };
        Ok(Self {
            model,
            options,
            training: cut(widths, training)?,
            validation: cut(widths, validation)?,
            training_names: names(training),
            validation_names: names(validation),
            plant: Plant::new(model, model.w()),
        })
    }

    /// Number of training and validation runs.
    pub(super) fn run_count(&self) -> usize {
        self.training.len() + self.validation.len()
    }

    /// Bounds and their checks for one noise scale an output; `report` gets the number of runs done.
    pub(super) fn evaluate(
        &self,
        noise_scales: &[f64],
        report: &mut dyn FnMut(usize),
    ) -> Result<StepOutcome, IdentifyError> {
        let nominal = self
            .model
            .v()
            .component_mul(&DVector::from_column_slice(noise_scales));
        let mut scales = Vec::with_capacity(self.training.len());
        let mut used = DVector::from_element(nominal.len(), 1.0 - NOISE_RESERVE);
        for (run, pieces) in self.training.iter().enumerate() {
            match self.needs(run, pieces, &nominal)? {
                RunNeed::Scales(needed, noise) => {
                    scales.push(needed);
                    used = used.sup(&noise);
                }
                RunNeed::Infeasible(factor) => {
                    let run = self.training_names[run].to_owned();
                    return Ok(StepOutcome::Infeasible { run, factor });
                }
            }
            report(run + 1);
        }
        let measurement = self.rounded(&nominal.component_mul(&used));
        let bounds = NoiseBounds {
            disturbance: self.disturbance_bound(scales.iter()),
            measurement,
        };
        let left_out_failures = self.left_out_failures(&scales, &bounds)?;
        let mut validation_factors = Vec::with_capacity(self.validation.len());
        for (run, pieces) in self.validation.iter().enumerate() {
            validation_factors.push(self.consistency(self.validation_names[run], pieces, &bounds)?);
            report(self.training.len() + run + 1);
        }
        let floors = self.floors(&bounds)?;
        let logarithms: Vec<f64> = floors.iter().flatten().map(|floor| floor.ln()).collect();
        let mean = logarithms.iter().sum::<f64>() / logarithms.len() as f64;
        Ok(StepOutcome::Bounds(StepBounds {
            deciding_runs: (0..bounds.disturbance.len())
                .map(|j| deciding_run(&scales, j))
                .collect(),
            bounds,
            left_out_failures,
            inconsistent_validation_runs: validation_factors
                .iter()
                .filter(|factor| exceeds_one(**factor))
                .count(),
            validation_factors,
            floors,
            mean_floor: mean.exp(),
        }))
    }

    /// The smallest disturbance scales of one training run.
    fn needs(&self, run: usize, pieces: &[Piece], noise: &DVector<f64>) -> Result<RunNeed, IdentifyError> {
        let reduced = noise * (1.0 - NOISE_RESERVE);
        let mut scales = DVector::zeros(self.model.disturbance_count());
        let mut used = DVector::zeros(noise.len());
        for piece in pieces {
            let failure = |error| trajectory_failure(self.training_names[run], error);
            match self.plant.explain(piece, &Goal::SmallestDisturbances(&reduced)) {
                Ok(need) => {
                    scales = scales.sup(&need.disturbances);
                    used = used.sup(&(need.noise * (1.0 - NOISE_RESERVE)));
                }
                Err(TrajectoryError::Solver(error @ SolverError::Infeasible { .. })) => {
                    let need = self
                        .plant
                        .explain(piece, &Goal::NoiseFactor(noise))
                        .map_err(failure)?;
                    let factor = need.noise.max();
                    if factor <= 1.0 {
                        return Err(failure(TrajectoryError::Solver(error)));
                    }
                    return Ok(RunNeed::Infeasible(factor));
                }
                Err(error) => return Err(failure(error)),
            }
        }
        Ok(RunNeed::Scales(scales, used))
    }

    /// The bound that follows from the scales of some runs.
    fn disturbance_bound<'s>(&self, scales: impl Iterator<Item = &'s DVector<f64>>) -> DVector<f64> {
        let none = DVector::zeros(self.model.disturbance_count());
        let largest = scales.fold(none, |largest, scale| largest.sup(scale));
        self.rounded(&(largest.component_mul(self.model.w()) * (1.0 + self.options.margin)))
    }

    fn rounded(&self, bound: &DVector<f64>) -> DVector<f64> {
        bound.map(|value| round_up(value, self.options.significant_digits))
    }

    /// Number of training runs that contradict the bounds found from the other ones; `None` for a single run.
    fn left_out_failures(
        &self,
        scales: &[DVector<f64>],
        bounds: &NoiseBounds,
    ) -> Result<Option<usize>, IdentifyError> {
        if scales.len() < 2 {
            return Ok(None);
        }
        let mut failures = 0;
        for (run, own) in scales.iter().enumerate() {
            let others = scales
                .iter()
                .enumerate()
                .filter(|(other, _)| *other != run)
                .map(|(_, scale)| scale);
            let disturbance = self.disturbance_bound(others);
            let needed = own.component_mul(self.model.w());
            if needed
                .iter()
                .zip(&disturbance)
                .any(|(needed, bound)| needed > bound)
            {
                let bounds = NoiseBounds {
                    disturbance,
                    measurement: bounds.measurement.clone(),
                };
                let factor = self.consistency(self.training_names[run], &self.training[run], &bounds)?;
                failures += usize::from(exceeds_one(factor));
            }
        }
        Ok(Some(failures))
    }

    /// t: by what both bounds have to be multiplied to explain a run.
    fn consistency(&self, name: &str, pieces: &[Piece], bounds: &NoiseBounds) -> Result<f64, IdentifyError> {
        let plant = Plant::new(self.model, &bounds.disturbance);
        let mut factor: f64 = 0.0;
        for piece in pieces {
            let need = plant
                .explain(piece, &Goal::CommonFactor(&bounds.measurement))
                .map_err(|error| trajectory_failure(name, error))?;
            factor = need
                .disturbances
                .iter()
                .chain(&need.noise)
                .copied()
                .fold(factor, f64::max);
        }
        Ok(factor)
    }

    /// The smallest detectable constant fault of every actuator; `None` where the window does not show it.
    fn floors(&self, bounds: &NoiseBounds) -> Result<Vec<Option<f64>>, IdentifyError> {
        let nominal_state = DVector::zeros(self.model.state_count());
        let strip_available = self.model.strip_gain().is_some();
        let mut floors = Vec::with_capacity(self.model.actuator_count());
        for actuator in 0..self.model.actuator_count() {
            let question = FloorQuestion {
                mode: FaultMode::FAULT_FREE,
                actuator,
                length: self.options.window,
                pre_samples: self.options.pre_samples.count(strip_available),
            };
            let solution = solve(self.model, bounds, &nominal_state, question)?;
            floors.push(solution.map(|solution| solution.floor()));
        }
        match floors.iter().flatten().next() {
            Some(_) => Ok(floors),
            None => Err(IdentifyError::NothingDetectable {
                window: self.options.window,
            }),
        }
    }
}

/// Whether a consistency factor says that a run contradicts the bounds.
pub(super) fn exceeds_one(factor: f64) -> bool {
    factor > 1.0 + FACTOR_TOLERANCE
}

/// The run that needs the largest scale of disturbance j; `None` if no run needs any.
fn deciding_run(scales: &[DVector<f64>], j: usize) -> Option<usize> {
    let largest = (0..scales.len()).max_by(|&a, &b| scales[a][j].total_cmp(&scales[b][j]));
    largest.filter(|&run| scales[run][j] > 0.0)
}

fn trajectory_failure(run: &str, error: TrajectoryError) -> IdentifyError {
    let run = run.to_owned();
    match error {
        TrajectoryError::Solver(source) => IdentifyError::Solver { run, source },
        TrajectoryError::Unverified { residual, status } => IdentifyError::Unverified {
            run,
            residual,
            status,
        },
    }
}
