//! Construction of a bank from a model and options (method sheet 3).

use super::{
    UnknownInputFilterBank,
    bank::{BankRules, BankState, Mode, Prior},
    channels::ChannelLayout,
    checks::check_modes,
    error::ConstructionError,
    filter::{CoupledFilter, CoupledOptions},
    fixed_gain::{FixedGain, Nominal},
    fixed_step::FixedFilter,
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
    /// Builds the bank of a model after the checks of method sheet 3.1; see [`Self::report`] for their warnings.
    ///
    /// # Errors
    /// [`ConstructionError`] with the entry of the configuration that is wrong.
    pub fn new(model: LinearModel, options: &UnknownInputFilterOptions) -> Result<Self, ConstructionError> {
        options.validate(&model)?;
        let filter = &options.filter;
        let order = filter.effective_generator_order();
        let plant = Plant::new(
            &model,
            order,
            filter.outward_rounding && filter.form == Form::Coupled,
        );
        let mode_sets = options.bank.modes(plant.nu());
        let report = check_modes(&model, options, &mode_sets)?;
        let nominal = Nominal::new(&model, &plant, filter);
        let mut modes = Vec::new();
        for (&mode, &testable) in mode_sets.iter().zip(&report.testable) {
            let filter = match testable {
                true => Some(build_filter(&model, &plant, mode, options, &nominal)?),
                false => None,
            };
            modes.push(Mode {
                mode,
                filter,
                parity: Vec::new(),
            });
        }
        for certificate in options.parity.certificates.iter().flatten() {
            let test = ParityTest::new(certificate, &model, filter.outward_rounding)?;
            if let Some(target) = modes.iter_mut().find(|target| target.mode == certificate.mode) {
                target.parity.push(test);
            }
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
            format: StateFormat::new(METHOD, STATE_VERSION, &(&model, options)),
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

    /// Replaces the fixed gain L_fix of a mode (nx x ny) by one designed elsewhere. It is projected on LCF = F
    /// before use. Call it before the first step.
    ///
    /// # Errors
    /// [`ConstructionError`] if the mode has no filter, if the shape is wrong, or if the filter is not stable with
    /// this gain.
    pub fn load_fixed_gain(&mut self, mode: FaultMode, gain: &DMatrix<f64>) -> Result<(), ConstructionError> {
        let shape = (self.plant.nx(), self.plant.ny());
        let target = self.modes.iter_mut().find(|target| target.mode == mode);
        let Some(filter) = target.and_then(|target| target.filter.as_mut()) else {
            return Err(ConstructionError::FixedGainWithoutMode { mode });
        };
        if gain.shape() != shape {
            return Err(ConstructionError::FixedGainShape {
                mode,
                actual: gain.shape(),
                expected: shape,
            });
        }
        let gain = Matrix::from(gain);
        let check = |coupled: &CoupledFilter| {
            FixedGain::check(&self.plant, coupled, &gain, &self.nominal)
                .ok_or(ConstructionError::NoStableFixedGain { mode })
        };
        match filter {
            ModeFilter::Coupled(coupled) => {
                let fixed = check(coupled)?;
                coupled.set_fixed_candidate(&self.plant, &fixed.gain);
            }
            ModeFilter::Fixed(fixed) => {
                let coupled = fixed.coupled().clone();
                *fixed = FixedFilter::new(&self.plant, coupled.clone(), &check(&coupled)?);
            }
            ModeFilter::Paper(_) | ModeFilter::Kalman(_) => {
                return Err(ConstructionError::FixedGainWithoutMode { mode });
            }
        }
        self.format.extend(&(mode, &gain));
        Ok(())
    }
}

/// The filter of one mode in the configured form.
fn build_filter(
    model: &LinearModel,
    plant: &Plant,
    mode: FaultMode,
    options: &UnknownInputFilterOptions,
    nominal: &Nominal,
) -> Result<ModeFilter, ConstructionError> {
    let filter = &options.filter;
    let order = filter.effective_generator_order();
    let s = filter
        .s
        .as_ref()
        .map(|s| DMatrix::from_fn(plant.nx(), plant.ny(), |i, j| s[i][j]));
    match filter.form {
        Form::Paper => Ok(ModeFilter::Paper(PaperFilter::new(
            plant,
            mode,
            s.as_ref(),
            filter.test,
            order,
        ))),
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
            Ok(ModeFilter::Kalman(KalmanFilter::new(
                plant,
                mode,
                s.as_ref(),
                start,
            )))
        }
        Form::Coupled => {
            let shaping =
                s.map(|s| Matrix::from(&(DMatrix::identity(plant.ny(), plant.ny()) - model.c() * s)));
            let bounded = options.missing.policy == MissingPolicy::BoundedFault;
            let coupled = CoupledOptions {
                shaping: shaping.as_ref(),
                fault_bound: options.missing.fault_bound.as_deref().filter(|_| bounded),
                row_wise: filter.gain != GainRule::Frobenius,
                sweeps: filter.gain_sweeps,
                order,
            };
            let mut coupled_filter = CoupledFilter::new(plant, mode, &coupled);
            if filter.gain == GainRule::Frobenius {
                return Ok(ModeFilter::Coupled(coupled_filter));
            }
            let design = CoupledOptions {
                row_wise: true,
                sweeps: DESIGN_SWEEPS,
                ..coupled
            };
            let fixed = FixedGain::design(plant, &CoupledFilter::new(plant, mode, &design), nominal);
            match (fixed, filter.gain) {
                (Some(fixed), GainRule::Fixed) => {
                    Ok(ModeFilter::Fixed(FixedFilter::new(plant, coupled_filter, &fixed)))
                }
                (None, GainRule::Fixed) => Err(ConstructionError::NoStableFixedGain { mode }),
                (fixed, _) => {
                    if let Some(fixed) = fixed {
                        coupled_filter.set_fixed_candidate(plant, &fixed.gain);
                    }
                    Ok(ModeFilter::Coupled(coupled_filter))
                }
            }
        }
    }
}
