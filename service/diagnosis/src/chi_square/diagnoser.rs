//! The diagnoser: inputs, filter and statistics, verdict (method sheet 4).

use super::{
    alarm::{AlarmRules, AlarmState},
    channels::{ChannelLayout, Tested, reported},
    construction::{check, design},
    design::Design,
    engine::{Detectors, Engine, Outcome},
    error::ChiSquareError,
    filter::Filter,
    glr::LikelihoodRatio,
    glr_modes::FaultMode,
    inputs::Inputs,
    model_options::Schedule,
    options::{ChiSquareOptions, OnIsolation, StatisticKind},
    plant::{Plant, StepModel},
};
use crate::{
    diagnoser::{Description, Diagnoser, RestoreError, StepInput, StepRecord, Verdict, flags, inputs_valid},
    matrix::Matrix,
    state::StateFormat,
};
use serde::{Deserialize, Serialize};

/// The method's name, as written in the configuration.
pub(super) const METHOD: &str = "chi_square";
/// Version of the saved state.
const STATE_VERSION: u16 = 1;

/// Everything that changes from instant to instant.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct State {
    inputs: Inputs,
    filter: Filter,
    detectors: Detectors,
    alarm: AlarmState,
    /// Sensors that count as missing, as bits.
    excluded: u64,
    /// Whether commands were missing for too long.
    input_lost: bool,
    /// Instants skipped in a row.
    gap: u32,
    /// The matrices in force with `schedule = "external"`.
    model: Option<StepModel>,
}

impl State {
    fn fits(&self, other: &Self, models: usize, components: usize) -> bool {
        let model = match (&self.model, &other.model) {
            (Some(model), Some(other)) => model.has_shapes_of(other),
            (None, None) => true,
            _ => false,
        };
        model
            && self.inputs.fits(&other.inputs, models)
            && self.filter.fits(&other.filter)
            && self.detectors.fits(&other.detectors)
            && self.alarm.fits(components)
    }
}

/// Why the matrices of an instant were refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SetModelError {
    /// The model is configured.
    #[error("the model is configured; set `model.schedule` to \"external\" to give one")]
    NotExternal,
    /// The shapes are not those of the configured model.
    #[error("the matrices have other shapes than those of the configured model; keep the shapes")]
    Shape,
}

/// State and residual chi-square tests, likelihood ratio and cumulative sums on one Kalman filter.
///
/// The first step is instant 1, unless a first command u(0) has to be waited for: then it is the first step after
/// the one that brought every command, and the verdict is `Starting` until then.
#[derive(Clone)]
pub struct ChiSquareDiagnoser {
    plant: Plant,
    engine: Engine,
    design: Design,
    rules: AlarmRules,
    layout: ChannelLayout,
    description: Description,
    format: StateFormat,
    on_isolation: OnIsolation,
    admissible: Vec<bool>,
    input_max_hold_steps: u32,
    max_gap_steps: u32,
    state: State,
    /// z(k) without the excluded sensors.
    z: Vec<f64>,
    /// A column of F, to correct the estimate by.
    direction: Matrix,
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

    fn models(&self) -> Option<usize> {
        (self.plant.schedule == Schedule::Selected).then_some(self.plant.models.len())
    }

    fn advance(&mut self, measurements: &[f64], commands: &[f64], record: &mut StepRecord) {
        record.inputs_valid = inputs_valid(&self.description, measurements, commands);
        let first = !self.state.inputs.started;
        let complete = self.state.inputs.receive(commands, self.models());
        self.receive(measurements);
        let arrived =
            measurements.len() == self.z.len() && measurements.iter().all(|value| value.is_finite());
        if !complete || !arrived {
            record.flags |= flags::INPUT_MISSING;
        }
        if first {
            // Instant 0 is the one of the first complete command.
            self.state.inputs.started = complete;
            return self.conclude(Verdict::Starting, record);
        }
        self.step_engine();
        if !self.state.filter.is_finite() || !self.state.detectors.is_finite() {
            self.restart();
            record.flags |= flags::RESET;
            return self.conclude(Verdict::GuaranteeLost, record);
        }
        if self.state.inputs.held_steps > self.input_max_hold_steps {
            self.state.input_lost = true;
        }
        if self.state.input_lost {
            if complete {
                self.recover_from_lost_input();
                record.flags |= flags::RESET;
            }
            return self.conclude(Verdict::GuaranteeLost, record);
        }
        self.judge(record);
    }

    /// z(k): NaN where a sensor is missing or excluded.
    fn receive(&mut self, measurements: &[f64]) {
        let complete = measurements.len() == self.z.len();
        for (row, z) in self.z.iter_mut().enumerate() {
            let excluded = self.state.excluded >> row & 1 == 1;
            *z = match measurements.get(row) {
                Some(value) if complete && !excluded => *value,
                _ => f64::NAN,
            };
        }
    }

    fn step_engine(&mut self) {
        let State {
            inputs,
            filter,
            detectors,
            model,
            ..
        } = &mut self.state;
        let model = match model {
            Some(model) => Some(&*model),
            None => self.plant.models.get(inputs.model),
        };
        if let Some(model) = model {
            self.engine.step(
                filter,
                detectors,
                model,
                &inputs.previous,
                &inputs.present,
                &self.z,
            );
        }
    }

    /// Channels, alarm, isolation and verdict of an instant that was stepped.
    fn judge(&mut self, record: &mut StepRecord) {
        let outcome = &self.engine.outcome;
        let tested = if outcome.available_rows() > 0 {
            self.layout
                .write(outcome, &self.state.detectors, &self.design.thresholds, record)
        } else {
            self.layout.write_nothing(record);
            Tested::default()
        };
        let warming_up = self.state.alarm.warmup > 0;
        if tested.evaluated && self.state.alarm.judge(&self.rules, tested.alarm) {
            record.flags |= flags::ALARM_NOW;
            let components = self.description.faults.len();
            let found = self
                .state
                .alarm
                .isolate(&self.rules, &self.engine.outcome, components);
            if let Some((component, found)) = found {
                self.exclude(component, &found, record);
            }
        }
        let state = &self.state;
        let verdict = match (&state.alarm.isolated, state.alarm.fault) {
            _ if warming_up => Verdict::Starting,
            (Some(_), true) => Verdict::Isolated,
            (None, true) => Verdict::Fault,
            _ if state.excluded != 0 => Verdict::Isolated,
            _ if tested.evaluated => Verdict::Nominal,
            _ => Verdict::NotEvaluated,
        };
        self.name_faults(verdict, record);
    }

    /// The isolated sensor counts as missing from now on, if the others can do without it.
    fn exclude(&mut self, component: usize, found: &LikelihoodRatio, record: &mut StepRecord) {
        let with_it = match 1_u64.checked_shl(component as u32) {
            Some(bit) if component < self.z.len() => self.state.excluded | bit,
            _ => return,
        };
        let admissible = self.admissible.get(with_it as usize).copied().unwrap_or(false);
        if self.on_isolation == OnIsolation::Continue || !admissible {
            return;
        }
        let State {
            filter, detectors, ..
        } = &mut self.state;
        if let (OnIsolation::ExcludeAndCompensate, Some(glr)) = (self.on_isolation, &detectors.glr) {
            // x̂ ← x̂ - F f̂, L_P ← tri[L_P, F/sqrt(E)].
            for (i, estimate) in filter.estimate.iter_mut().enumerate() {
                let sensitivity = glr.sensitivity[(i, found.column)];
                *estimate -= sensitivity * found.size;
                self.direction[(i, 0)] = sensitivity * found.standard_deviation;
            }
            filter.inflate(&self.direction, &mut self.engine.filter_work);
        }
        detectors.clear();
        self.state.excluded = with_it;
        record.flags |= flags::RESET;
    }

    /// Verdict, fault sets and the estimate of the isolated fault.
    fn name_faults(&self, verdict: Verdict, record: &mut StepRecord) {
        record.verdict = verdict as u32;
        (record.certainly_faulty, record.possibly_faulty) = (0, 0);
        (record.fault_estimate, record.fault_estimate_half_width) = (f64::NAN, f64::NAN);
        let all = u64::MAX >> (64 - self.description.faults.len().clamp(1, 64));
        let isolated = self.state.alarm.isolated;
        match verdict {
            Verdict::Fault => {
                record.certainly_faulty = self.state.excluded;
                record.possibly_faulty = all;
            }
            Verdict::Isolated => {
                let bit = isolated.map_or(0, |isolated| 1 << isolated.component);
                record.certainly_faulty = self.state.excluded | bit;
                let doubtful = isolated.is_some_and(|isolated| isolated.at_window_edge);
                record.possibly_faulty = if doubtful { all } else { record.certainly_faulty };
            }
            _ => {}
        }
        let found = isolated.and_then(|isolated| self.engine.outcome.likelihood_ratio_of(isolated.component));
        if let (Verdict::Isolated, Some(found)) = (verdict, found)
            && let Some(mode) = self.modes().get(found.mode)
        {
            let amplitude = mode.profile.amplitude(found.age);
            record.fault_estimate = found.size * amplitude;
            record.fault_estimate_half_width = found.standard_deviation * amplitude;
        }
    }

    /// A verdict without any test.
    fn conclude(&mut self, verdict: Verdict, record: &mut StepRecord) {
        self.layout.write_nothing(record);
        self.name_faults(verdict, record);
    }

    /// The command returned after too long: x̂ stays, P grows by P_0, the detectors start anew.
    fn recover_from_lost_input(&mut self) {
        self.state.input_lost = false;
        self.state
            .filter
            .inflate(&self.plant.initial_factor, &mut self.engine.filter_work);
        self.state.detectors.clear();
        self.state.alarm.clear(&self.rules);
    }

    /// Starts again from x(0); excluded sensors stay excluded.
    fn restart(&mut self) {
        let state = &mut self.state;
        state.inputs.restart(
            self.plant.initial_input.as_deref(),
            self.description.command_count,
        );
        state.filter.estimate.copy_from_slice(&self.plant.initial_state);
        state
            .filter
            .covariance_factor
            .copy_from(&self.plant.initial_factor);
        state.detectors.clear();
        state.alarm.clear(&self.rules);
        state.input_lost = false;
        self.engine.forget();
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

    fn restore(&mut self, state: &[u8]) -> Result<(), RestoreError> {
        let state: State = self.format.decode(state)?;
        if !state.fits(
            &self.state,
            self.plant.models.len(),
            self.description.faults.len(),
        ) {
            return Err(RestoreError::Damaged);
        }
        self.state = state;
        self.engine.forget();
        Ok(())
    }
}
