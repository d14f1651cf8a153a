//! The bank: one filter per fault mode, their common verdict, resets and episodes (method sheet 4.5, 4.6, 4.12).

use super::{
    channels::ChannelLayout,
    checks::CheckReport,
    decision::{Conclusion, Decision, decide},
    filter::state_bound,
    fixed_gain::Nominal,
    mode_filter::ModeFilter,
    modes::FaultMode,
    options::{Isolation, ResetRule},
    outcome::{Outcome, TestRow},
    parity::ParityTest,
    parity_window::ParityWindow,
    plant::{Command, Measured, Plant},
    state::SetState,
    strip_reset::reset_by_strip,
    workspace::Workspace,
};
use crate::diagnoser::{
    Description, Diagnoser, RestoreError, StepInput, StepRecord, Verdict, flags, inputs_valid,
};
use crate::state::StateFormat;
use serde::{Deserialize, Serialize};

/// One fault mode: its filter and its parity tests.
#[derive(Clone)]
pub(super) struct Mode {
    pub mode: FaultMode,
    /// `None` for an untestable mode that was allowed: it is never falsified.
    pub filter: Option<ModeFilter>,
    /// Settled radius of its set with the fixed gain alone, at the nominal state; `None` without such a gain.
    pub fixed_radius: Option<Vec<f64>>,
    pub parity: Vec<ParityTest>,
}

/// Everything that changes from instant to instant.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct BankState {
    /// Whether the first complete packet has arrived.
    pub started: bool,
    /// Command received at the last instant, NaN where it is missing.
    pub command: Vec<f64>,
    pub sets: Vec<SetState>,
    pub windows: Vec<ParityWindow>,
    pub falsified: Vec<bool>,
    /// Tested instants since the last alarm.
    pub quiet: u32,
}

impl BankState {
    /// Whether a state has the lengths of another.
    fn fits(&self, other: &Self) -> bool {
        self.command.len() == other.command.len()
            && self.falsified.len() == other.falsified.len()
            && self.sets.len() == other.sets.len()
            && self.windows.len() == other.windows.len()
            && self
                .sets
                .iter()
                .zip(&other.sets)
                .all(|(set, other)| set.fits(other))
            && self
                .windows
                .iter()
                .zip(&other.windows)
                .all(|(window, other)| window.fits(other))
    }
}

/// Rules of the bank that do not change.
#[derive(Clone, Copy, Debug)]
pub(super) struct BankRules {
    pub isolation: Isolation,
    pub reset: ResetRule,
    pub clear_samples: u32,
    pub start_by_strip: bool,
}

/// Where a filter that starts from the prior begins.
#[derive(Clone)]
pub(super) struct Prior {
    pub centre: Vec<f64>,
    pub radius: Vec<f64>,
}

/// A bank of zonotopic unknown-input set-membership filters.
///
/// The command of an instant acts until the next one, so that the first test is one instant after the first
/// complete packet (every measurement and every command); until then the verdict is `Starting`. Once a mode is
/// falsified the verdict stays `Isolated` or `Fault` until the episode ends, also at instants without a test.
#[derive(Clone)]
pub struct UnknownInputFilterBank {
    pub(super) plant: Plant,
    pub(super) modes: Vec<Mode>,
    pub(super) rules: BankRules,
    pub(super) state: BankState,
    pub(super) work: Workspace,
    pub(super) measured: Measured,
    pub(super) outcomes: Vec<Outcome>,
    pub(super) parity: Vec<Vec<TestRow>>,
    pub(super) hull: SetState,
    pub(super) state_bound: Vec<f64>,
    pub(super) mode_sets: Vec<FaultMode>,
    pub(super) command: Command,
    pub(super) prior: Option<Prior>,
    pub(super) nominal: Nominal,
    pub(super) layout: ChannelLayout,
    pub(super) description: Description,
    pub(super) report: CheckReport,
    pub(super) format: StateFormat,
}

impl UnknownInputFilterBank {
    /// The modes of the bank, in the order of their channels.
    pub fn modes(&self) -> &[FaultMode] {
        &self.mode_sets
    }

    /// Which modes are falsified, in the order of [`Self::modes`].
    pub fn falsified(&self) -> &[bool] {
        &self.state.falsified
    }

    /// What the off-line checks found: isolability and warnings.
    pub fn report(&self) -> &CheckReport {
        &self.report
    }

    /// What the falsified modes prove at present.
    pub fn conclusion(&self) -> Conclusion {
        decide(&self.mode_sets, &self.state.falsified)
    }

    /// Centre and radius of the set of the mode number `mode`; infinite radii where it is unbounded.
    ///
    /// For inspection; it allocates. `None` while the bank has not started, while the set is lost, and for a mode that is not there.
    pub fn state_set(&self, mode: usize) -> Option<(Vec<f64>, Vec<f64>)> {
        let set = self
            .state
            .sets
            .get(mode)
            .filter(|set| self.state.started && !set.void)?;
        Some((
            set.centre.clone(),
            (0..set.centre.len()).map(|i| set.extent(i)).collect(),
        ))
    }

    fn advance(&mut self, y: &[f64], u: &[f64], record: &mut StepRecord) {
        self.measured.receive(&self.plant, y);
        let commands_complete = u.len() == self.plant.nu() && u.iter().all(|value| value.is_finite());
        let complete = self.measured.is_complete(&self.plant) && commands_complete;
        let first = !self.state.started;
        let mut events = 0;
        if first && complete {
            self.start();
        } else if !first {
            self.command.receive(&self.plant, &self.state.command);
            self.step_filters();
            self.step_parity(y);
            events = self.judge();
        }
        self.store_command(u);
        record.flags |= events | if complete { 0 } else { flags::INPUT_MISSING };
        record.inputs_valid = inputs_valid(&self.description, y, u);
        let tested = !first && (0..self.modes.len()).any(|i| self.tested(i));
        let conclusion = self.conclusion();
        record.verdict = self.verdict(first, tested, &conclusion) as u32;
        record.certainly_faulty = conclusion.certainly_faulty;
        record.possibly_faulty = conclusion.possibly_faulty;
        self.layout
            .write(&self.outcomes, &self.parity, &self.modes, &conclusion, record);
    }

    /// Instant 0: the first sets.
    fn start(&mut self) {
        self.state.started = true;
        for i in 0..self.modes.len() {
            if self.modes[i].filter.is_none() {
                continue;
            }
            let set = &mut self.state.sets[i];
            if let Some(ModeFilter::Kalman(filter)) = &self.modes[i].filter {
                filter.start(set);
                continue;
            }
            match (&self.plant.strip, &self.prior) {
                (Some(strip), _) if self.rules.start_by_strip => {
                    reset_by_strip(&self.plant, strip, &self.measured.y, set, &mut self.work);
                }
                (_, Some(prior)) => set.set_box(&prior.centre, &prior.radius),
                _ => {}
            }
            state_bound(&self.plant, &self.state.sets[i], &mut self.state_bound);
            self.state.windows[i].push(&self.measured.y, &self.state.command, &self.state_bound);
        }
    }

    fn step_filters(&mut self) {
        let sets = self.state.sets.iter_mut().zip(&mut self.outcomes);
        for (mode, (set, outcome)) in self.modes.iter().zip(sets) {
            if let Some(filter) = &mode.filter {
                filter.step(
                    &self.plant,
                    &self.command,
                    &self.measured,
                    set,
                    &mut self.work,
                    outcome,
                );
            }
        }
    }

    /// The windows and their tests (method sheet 4.4).
    fn step_parity(&mut self, y: &[f64]) {
        for (i, mode) in self.modes.iter().enumerate() {
            if mode.parity.is_empty() {
                continue;
            }
            state_bound(&self.plant, &self.state.sets[i], &mut self.state_bound);
            self.state.windows[i].push(y, &self.state.command, &self.state_bound);
            for (test, row) in mode.parity.iter().zip(&mut self.parity[i]) {
                *row = match test.evaluate(&self.state.windows[i]) {
                    Some((residual, half_width)) => TestRow {
                        residual,
                        half_width,
                        evaluated: true,
                    },
                    None => TestRow::default(),
                };
                if row.evaluated {
                    let floor = &mut self.outcomes[i].floors[test.fault()];
                    *floor = floor.min(2.0 * row.half_width / test.gain());
                }
            }
        }
    }

    /// Falsification, resets and the end of an episode; returns the flags of the events.
    fn judge(&mut self) -> u32 {
        let mut alarmed = false;
        for i in 0..self.modes.len() {
            let alarm = self.alarm(i);
            alarmed |= alarm;
            self.state.falsified[i] =
                alarm || self.state.falsified[i] && self.rules.isolation == Isolation::Latched;
        }
        let mut reset = self.reset_lost_sets();
        if alarmed {
            self.state.quiet = 0;
        } else if (0..self.modes.len()).any(|i| self.tested(i)) {
            self.state.quiet = self.state.quiet.saturating_add(1);
        }
        let over = self.rules.clear_samples > 0 && self.state.quiet >= self.rules.clear_samples;
        if over && self.state.falsified.contains(&true) {
            reset |= self.end_episode();
        }
        (if alarmed { flags::ALARM_NOW } else { 0 }) | if reset { flags::RESET } else { 0 }
    }

    /// Whether any row or window of mode `i` alarms at this instant.
    pub(super) fn alarm(&self, i: usize) -> bool {
        self.outcomes[i].alarm() || self.parity[i].iter().any(TestRow::alarm)
    }

    fn tested(&self, i: usize) -> bool {
        self.outcomes[i].tested() || self.parity[i].iter().any(|row| row.evaluated)
    }

    /// Whether mode `i` may be the truth: neither falsified nor, once anything is, fault-free.
    pub(super) fn survives(&self, i: usize) -> bool {
        let outdated = self.mode_sets[i].is_empty() && self.state.falsified.contains(&true);
        !self.state.falsified[i] && !outdated
    }

    fn verdict(&self, first: bool, tested: bool, conclusion: &Conclusion) -> Verdict {
        let mut guarded =
            (0..self.modes.len()).filter(|&i| self.survives(i) && self.modes[i].filter.is_some());
        if first {
            return Verdict::Starting;
        }
        let any = guarded.clone().next().is_some();
        if any && guarded.all(|i| self.state.sets[i].void && !self.restarts_by_itself(i)) {
            return Verdict::GuaranteeLost;
        }
        match conclusion.decision {
            Decision::Isolated => Verdict::Isolated,
            Decision::Ambiguous | Decision::OutsideModel => Verdict::Fault,
            Decision::None if tested => Verdict::Nominal,
            Decision::None => Verdict::NotEvaluated,
        }
    }

    /// A filter in the paper's form has no set between a loss and the next complete packet, by design.
    fn restarts_by_itself(&self, i: usize) -> bool {
        let known = self.plant.strip.is_some() || self.plant.state_box.is_some();
        known && matches!(self.modes[i].filter, Some(ModeFilter::Paper(_)))
    }

    /// Clears what the last instant left for its record.
    fn forget_outcomes(&mut self) {
        self.outcomes.iter_mut().for_each(Outcome::clear);
        self.parity
            .iter_mut()
            .for_each(|rows| rows.fill(TestRow::default()));
    }

    fn store_command(&mut self, u: &[f64]) {
        if u.len() == self.plant.nu() {
            self.state.command.copy_from_slice(u);
        } else {
            self.state.command.fill(f64::NAN);
        }
    }
}

impl Diagnoser for UnknownInputFilterBank {
    fn description(&self) -> &Description {
        &self.description
    }

    fn step(&mut self, input: &StepInput<'_>, record: &mut StepRecord) {
        self.advance(input.measurements, input.commands, record);
    }

    fn skip(&mut self, record: &mut StepRecord) {
        self.advance(&[], &[], record);
    }

    fn reset(&mut self) {
        self.state.started = false;
        self.state.command.fill(f64::NAN);
        for set in &mut self.state.sets {
            set.set_void();
            set.covariance.fill(0.0);
        }
        self.state.windows.iter_mut().for_each(ParityWindow::reset);
        self.state.falsified.fill(false);
        self.state.quiet = 0;
        self.forget_outcomes();
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
        let mut state: BankState = self.format.decode(state)?;
        if !state.fits(&self.state) {
            return Err(RestoreError::Damaged);
        }
        for (window, present) in state.windows.iter_mut().zip(&mut self.state.windows) {
            window.keep_constants_of(present);
        }
        self.state = state;
        self.forget_outcomes();
        Ok(())
    }
}
