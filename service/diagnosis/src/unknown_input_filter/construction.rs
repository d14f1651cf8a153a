//! Construction of a bank from a model and options (method sheet 3).

use super::{
    UnknownInputFilterBank,
    bank::{BankRules, BankState, Mode, Prior},
    certificate::ParityCertificate,
    channels::ChannelLayout,
    checks::check_modes,
    error::ConstructionError,
    filter::{CoupledFilter, CoupledOptions},
    fixed_gain::{FixedGain, Nominal},
    fixed_step::FixedFilter,
    gains::{UnknownInputFilterGains, from_rows},
    gains_check::{GainsError, check_places, fixed_gain, observer},
    gains_complete::check_tests,
    kalman::{KalmanFilter, KalmanOptions},
    mode_filter::ModeFilter,
    modes::FaultMode,
    options::{Form, GainRule, Initialisation, MissingPolicy, UnknownInputFilterOptions},
    outcome::{Outcome, TestRow},
    paper::PaperFilter,
    parity::ParityTest,
    parity_window::ParityWindow,
    plant::{Command, Measured, Plant},
    state::SetState,
    workspace::Workspace,
};
use crate::{diagnoser::Description, matrix::Matrix, model::LinearModel, state::StateFormat};
use nalgebra::DMatrix;

/// Sweeps of the off-line run that finds the fixed gain (method sheet 3.3).
const DESIGN_SWEEPS: usize = 6;

/// The method's name, as written in the configuration.
const METHOD: &str = "unknown_input_filter";

/// Version of the saved state.
const STATE_VERSION: u16 = 1;

impl UnknownInputFilterBank {
    /// Builds the bank of a model after the checks of method sheet 3.1 (see [`Self::report`] for their warnings), with
    /// the gains that can be found without a solver.
    ///
    /// # Errors
    /// [`ConstructionError`] with the entry of the configuration that is wrong.
    pub fn new(model: LinearModel, options: &UnknownInputFilterOptions) -> Result<Self, ConstructionError> {
        let gains = UnknownInputFilterGains::find(&model, options)?;
        Self::with_gains(model, options, &gains)
    }

    /// Builds the bank that runs on these gains, after checking all that it relies on. Certificates among the options
    /// do not count, those of the gains do.
    ///
    /// # Errors
    /// [`ConstructionError`] with the entry of the configuration or of the gains that is wrong.
    pub fn with_gains(
        model: LinearModel,
        options: &UnknownInputFilterOptions,
        gains: &UnknownInputFilterGains,
    ) -> Result<Self, ConstructionError> {
        options.validate(&model)?;
        let filter = &options.filter;
        let order = filter.effective_generator_order();
        let plant = Plant::of(&model, filter);
        let mode_sets = options.bank.modes(plant.nu());
        let report = check_modes(&model, options, &mode_sets)?;
        let nominal = Nominal::new(&model, &plant, filter);
        let testable = mode_sets.iter().zip(&report.testable);
        let tested: Vec<FaultMode> = testable
            .filter(|(_, testable)| **testable)
            .map(|(mode, _)| *mode)
            .collect();
        check_places(gains, &tested, filter.form)?;
        check_tests(gains, &tested, options, plant.nu())?;
        let parity_test = |(index, certificate): (usize, &ParityCertificate)| {
            ParityTest::new(certificate, &model, filter.outward_rounding)
                .map_err(|source| GainsError::Certificate { index, source })
        };
        let tests = gains.certificates.iter().enumerate().map(parity_test);
        let tests: Vec<ParityTest> = tests.collect::<Result<_, _>>()?;
        let mut modes = Vec::new();
        for (&mode, &testable) in mode_sets.iter().zip(&report.testable) {
            let mut built = Mode {
                mode,
                filter: None,
                fixed_radius: None,
                parity: tests.iter().filter(|test| test.mode() == mode).cloned().collect(),
            };
            if testable {
                let (filter, fixed_radius) = build_filter(&model, &plant, mode, options, gains, &nominal)?;
                (built.filter, built.fixed_radius) = (Some(filter), fixed_radius);
            }
            modes.push(built);
        }
        let own = mode_sets.iter().map(|mode| mode.len()).max().unwrap_or(0);
        let columns = plant.column_capacity(order, own);
        let transitions = |mode: &Mode| mode.parity.iter().map(ParityTest::transitions).max().unwrap_or(0);
        let state = BankState {
            started: false,
            command: vec![f64::NAN; plant.nu()],
            sets: vec![SetState::new(plant.nx(), columns); modes.len()],
            windows: modes
                .iter()
                .map(|mode| ParityWindow::new(&model, transitions(mode), filter.outward_rounding))
                .collect(),
            falsified: vec![false; modes.len()],
            quiet: 0,
        };
        let outcomes: Vec<Outcome> = mode_sets
            .iter()
            .map(|&mode| Outcome::new(&plant, mode, filter.form))
            .collect();
        let layout = ChannelLayout::new(&model, &modes, &outcomes, options)?;
        Ok(Self {
            rules: BankRules {
                isolation: options.bank.isolation,
                reset: options.bank.reset,
                clear_samples: options.bank.clear_samples,
                start_by_strip: match filter.initialisation {
                    Initialisation::Prior => false,
                    Initialisation::Strip => true,
                    Initialisation::Auto => plant.strip.is_some(),
                },
            },
            prior: model.initial_state().map(|prior| Prior {
                centre: prior.center.as_slice().to_vec(),
                radius: prior.radius.as_slice().to_vec(),
            }),
            description: Description {
                method: METHOD,
                channels: layout.descriptions().to_vec(),
                faults: model
                    .actuators()
                    .iter()
                    .map(|actuator| actuator.name.clone())
                    .collect(),
                measurement_count: plant.ny(),
                command_count: plant.nu(),
                packets: None,
            },
            format: StateFormat::new(METHOD, STATE_VERSION, &(&model, options, gains)),
            work: Workspace::new(&plant, order, own, filter.effective_reduction()),
            measured: Measured::new(&plant),
            outcomes,
            parity: modes
                .iter()
                .map(|mode| vec![TestRow::default(); mode.parity.len()])
                .collect(),
            hull: SetState::new(plant.nx(), columns),
            state_bound: vec![0.0; plant.nx()],
            command: Command::new(&plant),
            mode_sets,
            nominal,
            modes,
            state,
            layout,
            report,
            plant,
        })
    }
}

/// The filter of one mode in the configured form, with the settled radius of its set under L_fix alone.
fn build_filter(
    model: &LinearModel,
    plant: &Plant,
    mode: FaultMode,
    options: &UnknownInputFilterOptions,
    gains: &UnknownInputFilterGains,
    nominal: &Nominal,
) -> Result<(ModeFilter, Option<Vec<f64>>), ConstructionError> {
    let filter = &options.filter;
    match filter.form {
        Form::Paper => {
            let observer = observer(plant, mode, gains)?;
            let order = filter.effective_generator_order();
            let paper = PaperFilter::new(plant, observer, filter.test, order);
            Ok((ModeFilter::Paper(paper), None))
        }
        Form::Kalman3Sigma => {
            let covariance = filter.initial_covariance.iter().flatten().flatten().copied();
            let covariance = DMatrix::from_row_iterator(plant.nx(), plant.nx(), covariance);
            let start = KalmanOptions {
                initial_state: match model.initial_state() {
                    Some(initial) => initial.center.as_slice().to_vec(),
                    None => vec![0.0; plant.nx()],
                },
                initial_covariance: Matrix::from(&covariance),
                norm_threshold: filter.residual_norm_threshold.unwrap_or(f64::INFINITY),
            };
            let kalman = KalmanFilter::new(plant, observer(plant, mode, gains)?, start);
            Ok((ModeFilter::Kalman(kalman), None))
        }
        Form::Coupled => {
            let shaping = shaping_matrix(model, options);
            let mut coupled = CoupledFilter::new(plant, mode, &coupled_options(options, shaping.as_ref()));
            let fixed = fixed_gain(plant, &coupled, gains, options, nominal)?;
            if fixed.is_none() && filter.gain == GainRule::RowWise {
                // As a candidate for rows it may be missing only where the design finds none.
                let found = FixedGain::design(plant, &design_filter(model, plant, mode, options), nominal);
                if found.is_some() {
                    let matrix = "L_fix";
                    return Err(GainsError::Missing { mode, matrix }.into());
                }
            }
            let radius = fixed.as_ref().map(|fixed| fixed.radius.clone());
            let filter = match (fixed, filter.gain) {
                (Some(fixed), GainRule::Fixed) => {
                    ModeFilter::Fixed(Box::new(FixedFilter::new(plant, coupled, &fixed)))
                }
                (Some(fixed), _) => {
                    coupled.set_fixed_candidate(plant, &fixed.gain);
                    ModeFilter::Coupled(coupled)
                }
                (None, _) => ModeFilter::Coupled(coupled),
            };
            Ok((filter, radius))
        }
    }
}

/// The filter of a mode whose run finds its fixed gain.
pub(super) fn design_filter(
    model: &LinearModel,
    plant: &Plant,
    mode: FaultMode,
    options: &UnknownInputFilterOptions,
) -> CoupledFilter {
    let shaping = shaping_matrix(model, options);
    let options = CoupledOptions {
        row_wise: true,
        sweeps: DESIGN_SWEEPS,
        ..coupled_options(options, shaping.as_ref())
    };
    CoupledFilter::new(plant, mode, &options)
}

fn coupled_options<'a>(
    options: &'a UnknownInputFilterOptions,
    shaping: Option<&'a Matrix>,
) -> CoupledOptions<'a> {
    let bounded = options.missing.policy == MissingPolicy::BoundedFault;
    CoupledOptions {
        shaping,
        fault_bound: options.missing.fault_bound.as_deref().filter(|_| bounded),
        row_wise: options.filter.gain != GainRule::Frobenius,
        sweeps: options.filter.gain_sweeps,
        order: options.filter.effective_generator_order(),
    }
}

/// I - CS where S is configured.
fn shaping_matrix(model: &LinearModel, options: &UnknownInputFilterOptions) -> Option<Matrix> {
    let s = from_rows(
        options.filter.s.as_ref()?,
        (model.state_count(), model.output_count()),
    );
    let ny = model.output_count();
    Some(Matrix::from(&(DMatrix::identity(ny, ny) - model.c() * s)))
}
