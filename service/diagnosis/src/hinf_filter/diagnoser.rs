//! The online diagnoser: one instant after the other (method sheet 4).

use super::{
    Report,
    filter::{FilterState, ResidualFilter},
    isolation::{BlindSets, Episode},
    options::{HinfFilterOptions, InitialType},
    problem::Problem,
};
use crate::diagnoser::{
    Channel, Description, Diagnoser, RestoreError, StepInput, StepRecord, Verdict, flags, inputs_valid,
};
use crate::matrix::{Matrix, dot};
use crate::state::StateFormat;
use serde::{Deserialize, Serialize};

/// Larger numbers count as missing: their squares, sums and products with gains stay finite.
const LARGEST_INPUT: f64 = 1e100;

/// Observer-based fault detection with guaranteed thresholds.
///
/// The first filter detects; further ones are blind to some faults and isolate; the last one may estimate them.
#[derive(Clone, Debug)]
pub struct HinfFilter {
    pub(super) filters: Vec<ResidualFilter>,
    pub(super) rules: Rules,
    pub(super) sets: BlindSets,
    pub(super) state: State,
    /// Room for x̂₀.
    pub(super) start: Vec<f64>,
    pub(super) description: Description,
    pub(super) format: StateFormat,
    pub(super) report: Report,
}

/// Rules that do not change.
#[derive(Clone, Debug)]
pub(super) struct Rules {
    first_output: bool,
    /// x̂₀, or the part of it that the first output does not show.
    prior: Vec<f64>,
    /// C⁺.
    inverse: Matrix,
    /// D.
    feedthrough: Matrix,
    max_gap: u32,
    period_ns: u64,
    tolerance_ns: u64,
    /// Number of blind filters.
    bank: usize,
    /// All faults, bit by bit.
    faults: u64,
}

impl Rules {
    pub fn new(problem: &Problem, options: &HinfFilterOptions, bank: usize) -> Self {
        let first_output = options.filter.initial == InitialType::FirstOutput;
        let (inverse, unseen) = problem.first_output();
        let prior = match first_output {
            true => unseen * &problem.initial.state,
            false => problem.initial.state.clone(),
        };
        let period_ns = problem.sampled.sample_time_s * 1e9;
        let count = problem.plant.bf.ncols();
        Self {
            first_output,
            prior: prior.as_slice().to_vec(),
            inverse: Matrix::from(&inverse),
            feedthrough: Matrix::from(&problem.plant.d),
            max_gap: options.filter.max_gap,
            period_ns: period_ns.round() as u64,
            tolerance_ns: (options.filter.jitter_tolerance * period_ns) as u64,
            bank,
            faults: (0..count).fold(0, |bits, j| bits | 1 << j),
        }
    }
}

/// Where the filter stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
enum Phase {
    /// Before the first usable sample.
    Starting,
    /// Stepping.
    Running,
    /// Out of step with the plant; starts again at the next complete sample.
    Waiting,
}

/// Everything that changes from instant to instant.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct State {
    phase: Phase,
    /// Whether the guarantee is lost until a reset.
    lost: bool,
    /// The last complete command.
    command: Vec<f64>,
    /// Samples lost in a row.
    gap: u32,
    /// The last instant, 0 if unknown.
    instant_ns: u64,
    filters: Vec<FilterState>,
    episode: Episode,
}

impl State {
    pub fn new(filters: Vec<FilterState>, commands: usize, episode: Episode) -> Self {
        Self {
            phase: Phase::Starting,
            lost: false,
            command: vec![0.0; commands],
            gap: 0,
            instant_ns: 0,
            filters,
            episode,
        }
    }

    fn fits(&self, other: &Self, bank: usize) -> bool {
        self.command.len() == other.command.len()
            && self.episode.fits(bank)
            && self.filters.len() == other.filters.len()
            && self
                .filters
                .iter()
                .zip(&other.filters)
                .all(|(state, other)| state.fits(other))
    }
}

/// Whether a list has its length and only usable numbers.
fn usable(values: &[f64], length: usize) -> bool {
    values.len() == length && values.iter().all(|value| value.abs() <= LARGEST_INPUT)
}

impl HinfFilter {
    /// What the design found.
    pub fn report(&self) -> &Report {
        &self.report
    }

    /// x̂ of the main filter: the prediction for the next instant.
    pub fn state_estimate(&self) -> &[f64] {
        &self.state.filters[0].observer.x
    }

    /// r̃ of the main filter at the last instant, 0 if its sample was lost.
    pub fn residual(&self) -> &[f64] {
        let filter = &self.filters[0];
        &filter.outcome.residual[..filter.tested]
    }

    /// ρ of the main filter at the last instant.
    pub fn bound(&self) -> &[f64] {
        let filter = &self.filters[0];
        &filter.outcome.bound[..filter.tested]
    }

    /// Back to the state before the first instant.
    pub(super) fn clear(&mut self) {
        self.start.fill(0.0);
        self.start_filters();
        let state = &mut self.state;
        state.phase = Phase::Starting;
        state.lost = false;
        state.command.fill(0.0);
        state.gap = 0;
        state.instant_ns = 0;
        state.episode = Episode::default();
    }

    fn start_filters(&mut self) {
        for (filter, state) in self.filters.iter_mut().zip(&mut self.state.filters) {
            filter.start(state, &self.start);
        }
    }

    /// x̂₀ from the first output, C⁺(y₀ - D u₀) + (I - C⁺C) x_prior, or as configured.
    fn start_from(&mut self, y: &[f64], u: &[f64]) {
        let rules = &self.rules;
        for (i, x) in self.start.iter_mut().enumerate() {
            *x = rules.prior[i];
            if rules.first_output {
                for (j, weight) in rules.inverse.row(i).iter().enumerate() {
                    *x += weight * (y[j] - dot(rules.feedthrough.row(j), u));
                }
            }
        }
        self.start_filters();
        self.state.phase = Phase::Running;
        self.state.gap = 0;
    }

    /// Whether the time since the last instant is not one period.
    fn out_of_step(&mut self, instant_ns: u64) -> bool {
        let last = std::mem::replace(&mut self.state.instant_ns, instant_ns);
        let known = last != 0 && instant_ns != 0;
        let elapsed = instant_ns.saturating_sub(last);
        known && elapsed.abs_diff(self.rules.period_ns) > self.rules.tolerance_ns
    }

    /// x̂ no longer follows the plant within its bounds.
    fn lose_guarantee(&mut self) {
        if self.rules.first_output {
            self.state.phase = Phase::Waiting;
        } else {
            self.state.lost = true;
        }
    }

    fn advance(&mut self, instant_ns: u64, y: &[f64], u: &[f64], record: &mut StepRecord) {
        let heard_y = usable(y, self.description.measurement_count);
        let heard_u = usable(u, self.description.command_count);
        let complete = heard_y && heard_u;
        self.begin_record(y, u, complete, record);
        let out_of_step = self.out_of_step(instant_ns);
        if self.state.phase == Phase::Running && (out_of_step || !heard_u) {
            self.lose_guarantee();
        }
        let overdue = self.state.phase == Phase::Running && self.state.gap > self.rules.max_gap && complete;
        if overdue || self.state.phase != Phase::Running {
            let ready = complete || heard_u && !self.rules.first_output;
            if !ready {
                record.verdict = match self.state.phase {
                    Phase::Starting => Verdict::Starting,
                    _ => Verdict::NotEvaluated,
                } as u32;
                return;
            }
            if self.state.phase != Phase::Starting {
                record.flags |= flags::RESET;
                // The configured initial state speaks of the first instant only.
                self.state.lost |= !self.rules.first_output;
            }
            self.start_from(y, u);
        }
        if heard_u {
            self.state.command.copy_from_slice(u);
        }
        self.state.gap = if complete {
            0
        } else {
            self.state.gap.saturating_add(1)
        };
        let sample = complete.then_some(y);
        let command = &self.state.command;
        let mut sound = true;
        for (filter, state) in self.filters.iter_mut().zip(&mut self.state.filters) {
            sound &= filter.step(state, sample, command);
        }
        if sound {
            self.conclude(complete, record);
        } else {
            self.state.phase = Phase::Waiting;
            record.verdict = Verdict::NotEvaluated as u32;
        }
    }

    fn begin_record(&self, y: &[f64], u: &[f64], complete: bool, record: &mut StepRecord) {
        record.channel_count = self.description.channels.len() as u32;
        record.channels_mut().fill(Channel::NOT_EVALUATED);
        record.certainly_faulty = 0;
        record.possibly_faulty = 0;
        record.fault_estimate = f64::NAN;
        record.fault_estimate_half_width = f64::NAN;
        record.inputs_valid = inputs_valid(&self.description, y, u);
        if !complete {
            record.flags |= flags::INPUT_MISSING;
        }
    }

    fn conclude(&mut self, complete: bool, record: &mut StepRecord) {
        let tests = &self.filters[..1 + self.rules.bank];
        let alarm = tests.iter().any(ResidualFilter::alarms);
        let fired = tests.iter().skip(1).map(ResidualFilter::alarms);
        self.sets.update(&mut self.state.episode, alarm, fired);
        let mut verdict = match (alarm, complete) {
            (false, false) => Verdict::NotEvaluated,
            (false, true) => Verdict::Nominal,
            (true, _) => Verdict::Fault,
        };
        if alarm {
            record.flags |= flags::ALARM_NOW;
            record.possibly_faulty = self.rules.faults;
            if self.rules.bank > 0 {
                let explanation = self.sets.explain(&self.state.episode);
                record.certainly_faulty = explanation.certain;
                record.possibly_faulty = explanation.possible;
                if explanation.unique {
                    verdict = Verdict::Isolated;
                }
            }
        }
        if self.state.lost {
            verdict = Verdict::GuaranteeLost;
        }
        record.verdict = verdict as u32;
        self.write_channels(record, verdict == Verdict::Isolated);
    }

    fn write_channels(&self, record: &mut StepRecord, isolated: bool) {
        let (tests, estimate) = self.filters.split_at(1 + self.rules.bank);
        let tested = tests.iter().flat_map(ResidualFilter::channels);
        let estimates = estimate.iter().flat_map(|filter| {
            let outcome = &filter.outcome;
            let rows = outcome.residual.iter().zip(&outcome.bound).take(filter.tested);
            rows.map(|(estimate, radius)| match outcome.sampled {
                true => Channel::estimate(*estimate, *radius),
                false => Channel::NOT_EVALUATED,
            })
        });
        for (slot, channel) in record.channels_mut().iter_mut().zip(tested.chain(estimates)) {
            *slot = channel;
        }
        let single = isolated && record.certainly_faulty.is_power_of_two();
        if let Some(filter) = estimate.first().filter(|filter| single && filter.outcome.sampled) {
            let fault = record.certainly_faulty.trailing_zeros() as usize;
            let value = |values: &[f64]| values.get(fault).copied().unwrap_or(f64::NAN);
            record.fault_estimate = value(&filter.outcome.residual);
            record.fault_estimate_half_width = value(&filter.outcome.bound);
        }
    }
}

impl Diagnoser for HinfFilter {
    fn description(&self) -> &Description {
        &self.description
    }

    fn step(&mut self, input: &StepInput<'_>, record: &mut StepRecord) {
        self.advance(input.instant_ns, input.measurements, input.commands, record);
    }

    fn skip(&mut self, record: &mut StepRecord) {
        let instant_ns = match self.state.instant_ns {
            0 => 0,
            last => last.saturating_add(self.rules.period_ns),
        };
        self.advance(instant_ns, &[], &[], record);
    }

    fn reset(&mut self) {
        self.clear();
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
        if !state.fits(&self.state, self.rules.bank) {
            return Err(RestoreError::Damaged);
        }
        self.state = state;
        Ok(())
    }
}
