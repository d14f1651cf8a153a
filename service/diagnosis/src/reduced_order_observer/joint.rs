//! The diagnoser of the joint mode: main observer, members, estimators, verdict (method sheet 4).

use super::{
    channels::output_excess,
    episode::{EpisodeRules, EpisodeState, Findings, MemberFindings},
    filter::{Filter, FilterState},
    inputs::{Commands, Inputs},
    start::Start,
    state_interval::StateInterval,
    test_row::TestRow,
    workspace::Workspace,
};
use crate::{
    diagnoser::{Channel, Description, Diagnoser, StepInput, StepRecord, Verdict, flags},
    state::{RestoreError, StateFormat},
};
use serde::{Deserialize, Serialize};

/// Version of [`State`].
pub(super) const STATE_VERSION: u16 = 1;

/// Whether the observers run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Phase {
    /// No complete sample yet.
    Starting,
    /// The errors are in their sets.
    Running,
    /// A command without a box was missing, or the sets are not finite any more.
    Lost,
}

/// Everything that changes from instant to instant.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct State {
    pub(super) phase: Phase,
    /// Main observer, members, estimators.
    pub(super) filters: Vec<FilterState>,
    pub(super) episode: EpisodeState,
}

/// Starts of one observer.
#[derive(Clone, Debug)]
pub(super) struct Starts {
    pub(super) first: Start,
    /// From the box of x at all times, if that is configured.
    pub(super) again: Option<Start>,
}

/// The observers with the joint zonotope of their errors; no false alarm as long as its assumptions hold.
#[derive(Clone, Debug)]
pub struct ReducedOrderObserver {
    /// Main observer, members, estimators.
    pub(super) filters: Vec<Filter>,
    pub(super) starts: Vec<Starts>,
    pub(super) members: usize,
    pub(super) outputs: usize,
    /// Half widths of the outputs above which an instant counts as not evaluated.
    pub(super) too_wide: Vec<f64>,
    /// Those right after a restart.
    pub(super) restart_widths: Option<Vec<f64>>,
    pub(super) episodes: EpisodeRules,
    pub(super) interval: StateInterval,
    pub(super) inputs: Inputs,
    pub(super) rows: Vec<Vec<TestRow>>,
    pub(super) work: Workspace,
    pub(super) state: State,
    pub(super) idle: State,
    pub(super) format: StateFormat,
    pub(super) description: Description,
}

impl ReducedOrderObserver {
    /// Centre and radius of the interval of every plant state at the last instant, state units; `None` unless its
    /// sample was complete. Valid only while no fault acts.
    pub fn state_interval(&self) -> Option<(&[f64], &[f64])> {
        let interval = &self.interval;
        interval
            .valid
            .then_some((interval.centre.as_slice(), interval.radius.as_slice()))
    }

    /// ẑ1 and ẑ2 of the main observer: what it predicts for the next instant.
    pub fn observer_state(&self) -> (&[f64], &[f64]) {
        self.state
            .filters
            .first()
            .map_or((&[], &[]), |main| (&main.z1, &main.z2))
    }

    /// Bit i: actuator i has been exonerated in this episode.
    pub fn exonerated(&self) -> u64 {
        self.state.episode.exonerated
    }

    fn advance(&mut self, y: &[f64], u: &[f64], record: &mut StepRecord) {
        self.inputs.receive(y, u);
        self.interval.valid = false;
        self.rows
            .iter_mut()
            .for_each(|rows| rows.fill(TestRow::default()));
        record.inputs_valid = self.inputs.received;
        record.flags |= if self.inputs.complete() {
            0
        } else {
            flags::INPUT_MISSING
        };
        let ready = self.inputs.all_valid && self.inputs.commands != Commands::Lost;
        let quiet = match self.state.phase {
            Phase::Running => self.run(record),
            Phase::Starting if ready => {
                self.start(false);
                match self.starts.first() {
                    Some(starts) if !starts.first.is_at_output() => self.run(record),
                    _ => Verdict::Starting,
                }
            }
            Phase::Starting => Verdict::Starting,
            Phase::Lost if ready && self.restart_widths.is_some() => {
                self.start(true);
                record.flags |= flags::RESET;
                Verdict::NotEvaluated
            }
            Phase::Lost => Verdict::GuaranteeLost,
        };
        self.episodes.conclude(&self.state.episode, quiet, record);
        self.write(record);
    }

    /// An instant of the running observers; the verdict if no episode is active.
    fn run(&mut self, record: &mut StepRecord) -> Verdict {
        self.test();
        if self.judge() {
            record.flags |= flags::ALARM_NOW;
        }
        let tested = self.rows.iter().flatten().any(|row| row.evaluated);
        let wide = self
            .hull()
            .zip(&self.too_wide)
            .any(|(row, most)| row.half_width > *most);
        if wide {
            record.flags |= flags::THRESHOLD_INERT;
        }
        if self.inputs.all_valid
            && let Some(main) = self.state.filters.first()
        {
            self.interval.evaluate(main, &self.inputs.y, &mut self.work.image);
        }
        if self.inputs.commands == Commands::Lost {
            self.state.phase = Phase::Lost;
        } else if wide && self.restart_narrows() {
            self.start(true);
            record.flags |= flags::RESET;
        } else {
            self.propagate();
        }
        if tested && !wide {
            Verdict::Nominal
        } else {
            Verdict::NotEvaluated
        }
    }

    fn hull(&self) -> impl Iterator<Item = &TestRow> {
        self.rows
            .first()
            .map_or(&[][..], |rows| rows.get(..self.outputs).unwrap_or_default())
            .iter()
    }

    fn test(&mut self) {
        let states = self.state.filters.iter().zip(&mut self.rows);
        for (filter, (state, rows)) in self.filters.iter().zip(states) {
            filter.test(state, &self.inputs, &mut self.work, rows);
        }
    }

    /// Episode and exoneration; whether an alarm is confirmed.
    fn judge(&mut self) -> bool {
        let any = findings(self.rows.iter().flatten());
        let members = self
            .filters
            .iter()
            .zip(&self.rows)
            .zip(&self.state.filters)
            .skip(1);
        let members = members.take(self.members).filter_map(|((filter, rows), state)| {
            Some(MemberFindings {
                actuator: filter.actuator?,
                findings: findings(rows.iter()),
                guaranteed: state.unguaranteed == 0,
            })
        });
        self.episodes.update(&mut self.state.episode, any, members)
    }

    /// Whether the sample is complete and a restart from it gives narrower sets than there are.
    fn restart_narrows(&self) -> bool {
        let present = self.hull().map(|row| row.half_width);
        let ratio = |widths: &mut dyn Iterator<Item = f64>| {
            let ratios = widths.zip(&self.too_wide).map(|(width, most)| width / most);
            ratios.fold(0.0, f64::max)
        };
        let fresh = self.restart_widths.as_ref();
        let fresh = fresh.map(|fresh| ratio(&mut fresh.iter().copied()));
        self.inputs.all_valid && fresh.is_some_and(|fresh| fresh < ratio(&mut present.into_iter()))
    }

    /// Starts all observers from this instant's sample.
    fn start(&mut self, again: bool) {
        let mut finite = true;
        for ((filter, state), starts) in self.filters.iter().zip(&mut self.state.filters).zip(&self.starts) {
            let start = starts.again.as_ref().filter(|_| again).unwrap_or(&starts.first);
            filter.start(state, start, &self.inputs);
            if start.is_at_output() {
                finite &= filter.leave_start(state, start, &self.inputs, &mut self.work);
            }
        }
        self.state.phase = if finite { Phase::Running } else { Phase::Lost };
    }

    fn propagate(&mut self) {
        for (filter, state) in self.filters.iter().zip(&mut self.state.filters) {
            if !filter.advance(state, &self.inputs, &mut self.work) {
                self.state.phase = Phase::Lost;
            }
        }
    }

    fn write(&self, record: &mut StepRecord) {
        record.channel_count = self.description.channels.len() as u32;
        let mut next = 0;
        let mut put = |channel: Channel| {
            if let Some(slot) = record.channels.get_mut(next) {
                *slot = channel;
            }
            next += 1;
        };
        let (main, others) = (self.rows.iter().take(1), self.rows.iter().skip(1));
        main.flatten().for_each(|row| put(row.channel()));
        put(output_excess(self.hull().copied()));
        others.flatten().for_each(|row| put(row.channel()));
        let mut own = None;
        let isolated = self.episodes.isolated(&self.state.episode);
        for (actuator, estimate) in self.estimates() {
            put(estimate.map_or(Channel::NOT_EVALUATED, |row| row.estimate_channel()));
            own = own.or(estimate.filter(|row| row.evaluated && isolated == Some(actuator)));
        }
        record.fault_estimate = own.map_or(f64::NAN, |row| row.estimate());
        record.fault_estimate_half_width = own.map_or(f64::NAN, |row| row.half_width);
    }

    /// The row of every estimator with its actuator; none while its interval is not guaranteed.
    fn estimates(&self) -> impl Iterator<Item = (usize, Option<TestRow>)> {
        let estimators = self.filters.iter().zip(&self.rows).zip(&self.state.filters);
        estimators
            .skip(1 + self.members)
            .filter_map(|((filter, rows), state)| {
                let row = rows.first().copied().filter(|_| state.unguaranteed == 0);
                Some((filter.actuator?, row))
            })
    }
}

fn findings<'a>(rows: impl Iterator<Item = &'a TestRow>) -> Findings {
    rows.fold(Findings::default(), |found, row| Findings {
        tested: found.tested || row.evaluated,
        alarm: found.alarm || row.alarm(),
    })
}

impl State {
    /// Whether a saved state has the lengths and rooms of this one.
    fn fits(&self, other: &Self) -> bool {
        self.filters.len() == other.filters.len()
            && self.episode.fits(&other.episode)
            && self
                .filters
                .iter()
                .zip(&other.filters)
                .all(|(left, right)| left.fits(right))
    }
}

impl Diagnoser for ReducedOrderObserver {
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
        self.state.phase = Phase::Starting;
        self.state.episode.clear();
        for (state, idle) in self.state.filters.iter_mut().zip(&self.idle.filters) {
            state.copy_from(idle);
        }
        self.interval.valid = false;
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
        let saved: State = self.format.decode(state)?;
        let ages = saved.filters.iter().zip(&self.filters);
        if !saved.fits(&self.state) || !ages.clone().all(|(state, filter)| filter.admits(state)) {
            return Err(RestoreError::Damaged);
        }
        self.state = saved;
        self.interval.valid = false;
        Ok(())
    }
}
