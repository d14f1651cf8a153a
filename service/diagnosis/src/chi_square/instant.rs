//! One instant: inputs, filter and statistics, alarm, isolation, verdict (method sheet 4).

use super::{
    ChiSquareDiagnoser, channel_writer::Tested, glr::LikelihoodRatio, model_options::Schedule,
    options::OnIsolation, state::State,
};
use crate::diagnoser::{StepRecord, Verdict, flags, inputs_valid};

impl ChiSquareDiagnoser {
    fn models(&self) -> Option<usize> {
        (self.plant.schedule == Schedule::Selected).then_some(self.plant.models.len())
    }

    pub(super) fn advance(&mut self, measurements: &[f64], commands: &[f64], record: &mut StepRecord) {
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
    pub(super) fn exclude(&mut self, component: usize, found: &LikelihoodRatio, record: &mut StepRecord) {
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
    pub(super) fn conclude(&mut self, verdict: Verdict, record: &mut StepRecord) {
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
    pub(super) fn restart(&mut self) {
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
