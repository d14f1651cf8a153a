//! The diagnoser: inputs, filter and statistics, verdict (method sheet 4).

use super::{
    alarm::{AlarmRules, AlarmState},
    channels::{ChannelLayout, reported},
    construction::{check, design},
    design::Design,
    engine::{Detectors, Engine, Outcome},
    error::ChiSquareError,
    filter::Filter,
    glr_modes::FaultMode,
    inputs::Inputs,
    model_options::Schedule,
    options::{ChiSquareOptions, OnIsolation, StatisticKind},
    plant::Plant,
    state::State,
    step_model::{SetModelError, StepModel},
};
use crate::{
    diagnoser::{Description, Diagnoser, RestoreError, StepInput, StepRecord, Verdict, flags},
    matrix::Matrix,
    state::StateFormat,
};

/// The method's name, as written in the configuration.
pub(super) const METHOD: &str = "chi_square";
/// Version of the saved state.
const STATE_VERSION: u16 = 1;

/// State and residual chi-square tests, likelihood ratio and cumulative sums on one Kalman filter.
///
/// The first step is instant 1, unless a first command u(0) has to be waited for: then it is the first step after
/// the one that brought every command, and the verdict is `Starting` until then.
#[derive(Clone)]
pub struct ChiSquareDiagnoser {
    pub(super) plant: Plant,
    pub(super) engine: Engine,
    pub(super) design: Design,
    pub(super) rules: AlarmRules,
    pub(super) layout: ChannelLayout,
    pub(super) description: Description,
    pub(super) format: StateFormat,
    pub(super) on_isolation: OnIsolation,
    pub(super) admissible: Vec<bool>,
    pub(super) input_max_hold_steps: u32,
    pub(super) max_gap_steps: u32,
    pub(super) state: State,
    /// z(k) without the excluded sensors.
    pub(super) z: Vec<f64>,
    /// A column of F, to correct the estimate by.
    pub(super) direction: Matrix,
}

impl ChiSquareDiagnoser {
    /// Checks the options, does the off-line design and takes all the room the steps need.
    ///
    /// # Errors
    /// [`ChiSquareError`]: the first condition that does not hold.
    pub fn new(options: &ChiSquareOptions) -> Result<Self, ChiSquareError> {
        let checked = check(options)?;
        let design = design(options, &checked)?;
        let plant = checked.plant;
        let [n, p, m, _] = plant.counts();
        let commands = p + usize::from(plant.schedule == Schedule::Selected);
        let external = plant.schedule == Schedule::External;
        let state = State {
            inputs: Inputs::new(p, plant.initial_input.as_deref(), commands),
            filter: Filter::new(&plant.initial_state, &plant.initial_factor),
            detectors: Detectors::new(&checked.engine),
            alarm: AlarmState::new(&checked.rules),
            excluded: 0,
            input_lost: false,
            gap: 0,
            model: plant.models.first().filter(|_| external).cloned(),
        };
        Ok(Self {
            description: Description {
                method: METHOD,
                channels: checked.layout.descriptions.clone(),
                faults: checked.components,
                measurement_count: m,
                command_count: commands,
                packets: None,
            },
            format: StateFormat::new(METHOD, STATE_VERSION, options),
            engine: Engine::new(checked.engine),
            rules: checked.rules,
            layout: checked.layout,
            on_isolation: options.alarm.on_isolation,
            admissible: checked.admissible,
            input_max_hold_steps: options.alarm.input_max_hold_steps,
            max_gap_steps: options.alarm.max_gap_steps,
            z: vec![f64::NAN; m],
            direction: Matrix::zeros(n, 1),
            design,
            plant,
            state,
        })
    }

    /// Gives the matrices of the next instants, until others are given. Neither allocates nor blocks.
    ///
    /// A measurement noise that is not positive definite makes the next step lose the guarantee and restart.
    ///
    /// # Errors
    /// [`SetModelError`]: a configured schedule, or other shapes.
    pub fn set_model(&mut self, model: &StepModel) -> Result<(), SetModelError> {
        let present = self.state.model.as_mut().ok_or(SetModelError::NotExternal)?;
        if !model.has_shapes_of(present) {
            return Err(SetModelError::Shape);
        }
        present.copy_from(model);
        Ok(())
    }

    /// What the design found: thresholds, simulation, warnings.
    pub fn design(&self) -> &Design {
        &self.design
    }

    /// The fault modes of the likelihood ratio, in order.
    pub fn modes(&self) -> &[FaultMode] {
        self.engine.design.glr.as_ref().map_or(&[], |glr| &glr.modes)
    }

    /// Every statistic of the last instant that was stepped.
    pub fn outcome(&self) -> &Outcome {
        &self.engine.outcome
    }

    /// x̂ after the last update (n).
    pub fn estimate(&self) -> &[f64] {
        &self.state.filter.estimate
    }

    /// L_P after the last update (n x n).
    pub fn covariance_factor(&self) -> &Matrix {
        &self.state.filter.covariance_factor
    }

    /// Difference β (n) and factor of its covariance (n x n) of a state test, the longest window of a bank; `None`
    /// if it is not enabled.
    pub fn difference(&self, kind: StatisticKind) -> Option<(&[f64], &Matrix)> {
        reported(kind, &self.engine.outcome, &self.state.detectors)
    }

    /// The sensors that count as missing after their isolation, as bits.
    pub fn excluded(&self) -> u64 {
        self.state.excluded
    }

    /// Takes an excluded sensor into use again, on command only.
    pub fn readmit(&mut self, sensor: usize) {
        if sensor < self.z.len() {
            self.state.excluded &= !(1 << sensor);
        }
    }
}

impl Diagnoser for ChiSquareDiagnoser {
    fn description(&self) -> &Description {
        &self.description
    }

    fn step(&mut self, input: &StepInput<'_>, record: &mut StepRecord) {
        self.state.gap = 0;
        self.advance(input.measurements, input.commands, record);
    }

    fn skip(&mut self, record: &mut StepRecord) {
        self.state.gap = self.state.gap.saturating_add(1);
        if self.state.gap <= self.max_gap_steps {
            return self.advance(&[], &[], record);
        }
        if self.state.gap == self.max_gap_steps + 1 {
            self.restart();
            record.flags |= flags::RESET;
        }
        record.flags |= flags::INPUT_MISSING;
        record.inputs_valid = 0;
        self.conclude(Verdict::NotEvaluated, record);
    }

    fn reset(&mut self) {
        self.restart();
        self.state.excluded = 0;
        self.state.gap = 0;
        if let (Some(model), Some(first)) = (&mut self.state.model, self.plant.models.first()) {
            model.copy_from(first);
        }
    }

    fn boxed_clone(&self) -> Box<dyn Diagnoser> {
        Box::new(self.clone())
    }

    fn save(&self, state: &mut Vec<u8>) {
        self.format.encode(&self.state, state);
    }

    fn state_size(&self) -> usize {
        self.format.size(&self.state)
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), RestoreError> {
        let state: State = self.format.decode(state)?;
        if !state.fits(
            &self.state,
            self.plant.models.len(),
            self.description.faults.len(),
            &self.admissible,
        ) {
            return Err(RestoreError::Damaged);
        }
        self.state = state;
        self.engine.forget();
        Ok(())
    }
}
