//! A state-space structure with free entries as a model section.

use miette::{IntoDiagnostic, WrapErr};
use nalgebra::DMatrix;
use residual_diagnosis::model::{Discretisation, LinearModel, ModelOptions, Time};
use residual_synthesis::identify::RunData;
use residual_synthesis::identify::model::{IdentifiedModel, Plant, Structure, identify_model};
use residual_synthesis::identify::regression::SignalRun;

use super::given::observer_bounds;
use super::section::Section;
use super::structure_file::{StructureFile, Target};
use super::{IdentifyArguments, Split, bounds_of_innovations, signals};

/// Standard deviations that a bound has before its search: its unit.
const UNIT: f64 = 3.0;
/// Unit of a disturbance that the likelihood does without, as a share of the largest other one.
const SMALL_UNIT: f64 = 1e-3;

/// What was found, as text.
///
/// # Errors
/// A report of what was wrong.
pub fn identify(arguments: &IdentifyArguments, file: &StructureFile) -> miette::Result<String> {
    let Some(options) = &file.model else {
        return Ok(String::new());
    };
    let (measurements, commands) = (&file.measurements, &file.commands);
    let structure = Structure::new(options, file.sample_time_s, measurements.len(), commands.len())
        .into_diagnostic()
        .wrap_err_with(|| format!("`{}`", arguments.configuration.display()))?;
    let expressions = [measurements.as_slice(), commands].concat();
    let recorded = signals::read(arguments, file, &arguments.recording, &expressions)?;
    let as_data = |runs: Vec<SignalRun>| -> Vec<RunData> {
        let data = |run: SignalRun| {
            let rows = run.rows.iter().map(|row| row.split_at(measurements.len()));
            let (measurements, commands) = rows.map(|(y, u)| (y.to_vec(), u.to_vec())).unzip();
            RunData {
                name: run.name,
                commands,
                measurements,
            }
        };
        runs.into_iter().map(data).collect()
    };
    let runs = Split {
        training: as_data(recorded.training),
        validation: as_data(recorded.validation),
    };
    let found = identify_model(&structure, &runs.training, &runs.validation)
        .into_diagnostic()
        .wrap_err("the model cannot be identified")?;
    let mut section = Section::default();
    section.comment(format_args!(
        "Identified from {} by maximum likelihood.",
        arguments.recording.display()
    ));
    section.predictions(&found, measurements);
    match file.method {
        Target::ChiSquare => with_covariances(&mut section, &structure, &found),
        Target::ReducedOrderObserver => {
            with_bounds(
                &mut section,
                arguments,
                file,
                &runs,
                &found,
                found.plant.clone(),
                false,
            )?;
        }
        _ => {
            let (matrices, continuous) = (found.matrices.clone(), structure.is_continuous());
            with_bounds(&mut section, arguments, file, &runs, &found, matrices, continuous)?;
        }
    }
    Ok(section.to_string())
}

fn with_covariances(section: &mut Section, structure: &Structure, found: &IdentifiedModel) {
    if structure.is_continuous() {
        section
            .comment("Discretised with the sampling period; commands and disturbances are held over a step.");
    }
    section.line("[diagnoser.model]");
    let plant = &found.plant;
    section.matrix("transition", &plant.a);
    if plant.b.ncols() > 0 {
        section.matrix("input", &plant.b);
    }
    if plant.disturbance.ncols() > 0 {
        section.matrix("process_noise_input", &plant.disturbance);
        section.matrix("process_noise_covariance", &found.disturbance_covariance);
    } else {
        let states = plant.a.nrows();
        section.matrix("process_noise_covariance", &DMatrix::zeros(states, states));
    }
    section.matrix("measurement", &plant.c);
    if plant.feedthrough.iter().any(|entry| *entry != 0.0) {
        section.matrix("feedthrough", &plant.feedthrough);
    }
    section.matrix(
        "measurement_noise_covariance",
        &found.measurement_noise_covariance,
    );
    section.list("initial_state", found.initial_state.0.iter().copied());
    section.matrix("initial_covariance", &found.initial_state.1);
}

fn rows(matrix: &DMatrix<f64>) -> Vec<Vec<f64>> {
    matrix
        .row_iter()
        .map(|row| row.iter().copied().collect())
        .collect()
}

/// Why a model with bounds cannot be written.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
enum BoundsError {
    #[error(
        "this method's model has no feedthrough, but the structure has; let the command act through a state, or use \
         `method = \"chi_square\"`"
    )]
    Feedthrough,
}

fn with_bounds(
    section: &mut Section,
    arguments: &IdentifyArguments,
    file: &StructureFile,
    runs: &Split<RunData>,
    found: &IdentifiedModel,
    matrices: Plant,
    continuous: bool,
) -> miette::Result<()> {
    if matrices.feedthrough.iter().any(|entry| *entry != 0.0) {
        return Err(BoundsError::Feedthrough.into());
    }
    let deviations = |covariance: &DMatrix<f64>| covariance.diagonal().map(|variance| UNIT * variance.sqrt());
    let disturbance = deviations(&found.disturbance_covariance);
    let smallest = SMALL_UNIT
        * if disturbance.amax() > 0.0 {
            disturbance.amax()
        } else {
            1.0
        };
    let model = Bounded {
        disturbance: disturbance.iter().map(|unit| unit.max(smallest)).collect(),
        measurement: found.training.rms.iter().map(|rms| UNIT * rms).collect(),
        center: found.initial_state.0.iter().copied().collect(),
        // The likelihood takes the state as spread evenly over the box: variance r²/3.
        radius: found
            .initial_state
            .1
            .diagonal()
            .iter()
            .map(|variance| (3.0 * variance).sqrt())
            .collect(),
        plant: matrices,
        continuous,
    };
    model.write(section, arguments, file, runs)
}

/// A model whose bounds are to be found.
pub(super) struct Bounded {
    pub plant: Plant,
    /// Whether the matrices are per second.
    pub continuous: bool,
    /// Units of the bounds.
    pub disturbance: Vec<f64>,
    pub measurement: Vec<f64>,
    /// Box of the first state.
    pub center: Vec<f64>,
    pub radius: Vec<f64>,
}

impl Bounded {
    /// Finds the bounds and writes the section.
    pub(super) fn write(
        self,
        section: &mut Section,
        arguments: &IdentifyArguments,
        file: &StructureFile,
        runs: &Split<RunData>,
    ) -> miette::Result<()> {
        let plant = &self.plant;
        let options = ModelOptions {
            time: if self.continuous {
                Time::Continuous
            } else {
                Time::Discrete
            },
            discretisation: self.continuous.then_some(Discretisation::ZeroOrderHold),
            a: rows(&plant.a),
            b: rows(&plant.b),
            c: rows(&plant.c),
            d: if plant.disturbance.ncols() > 0 {
                rows(&plant.disturbance)
            } else {
                Vec::new()
            },
            disturbance_bound: self.disturbance,
            measurement_noise_bound: self.measurement,
            ..ModelOptions::default()
        };
        let model = LinearModel::new(&options, file.sample_time_s).into_diagnostic()?;
        let bounds = bounds_of_innovations(section, arguments, &model, runs)?;
        section.comment(bounds.figures());
        section.line("[diagnoser.model]");
        if self.continuous {
            section.line("time = \"continuous\"\ndiscretisation = \"zero_order_hold\"");
        }
        section.matrix("A", &plant.a);
        section.matrix("B", &plant.b);
        section.matrix("C", &plant.c);
        if plant.disturbance.ncols() > 0 {
            section.matrix("D", &plant.disturbance);
        }
        let edges = |sign: f64| {
            self.center
                .iter()
                .zip(&self.radius)
                .map(move |(center, radius)| center + sign * radius)
        };
        if file.method == Target::ReducedOrderObserver {
            observer_bounds(section, &bounds);
            section.list("initial_state_lower", edges(-1.0));
            section.list("initial_state_upper", edges(1.0));
        } else {
            if plant.disturbance.ncols() > 0 {
                section.list(
                    "disturbance_bound",
                    bounds.best.bounds.disturbance.iter().copied(),
                );
            }
            section.list(
                "measurement_noise_bound",
                bounds.best.bounds.measurement.iter().copied(),
            );
            section.list("initial_state_center", self.center.iter().copied());
            section.list("initial_state_radius", self.radius.iter().copied());
        }
        Ok(())
    }
}
