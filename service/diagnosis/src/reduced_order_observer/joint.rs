//! The diagnoser of the joint mode: main observer, members, estimators, verdict (method sheet 4).

use super::{
    channels::{describe, fault_names, output_excess},
    design::Design,
    episode::{EpisodeRules, EpisodeState, Findings, MemberFindings},
    error::ConstructionError,
    filter::{Filter, FilterState},
    inputs::{Commands, Inputs},
    observer::Observer,
    observer_design::ObserverDesign,
    options::Initialisation,
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
const STATE_VERSION: u16 = 1;

/// Whether the observers run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
enum Phase {
    /// No complete sample yet.
    Starting,
    /// The errors are in their sets.
    Running,
    /// A command without a box was missing, or the sets are not finite any more.
    Lost,
}

/// Everything that changes from instant to instant.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct State {
    phase: Phase,
    /// Main observer, members, estimators.
    filters: Vec<FilterState>,
    episode: EpisodeState,
}

/// Starts of one observer.
#[derive(Clone, Debug)]
struct Starts {
    first: Start,
    /// From the box of x at all times, if that is configured.
    again: Option<Start>,
}

/// The observers with the joint zonotope of their errors; no false alarm as long as its assumptions hold.
#[derive(Clone, Debug)]
pub struct ReducedOrderObserver {
    /// Main observer, members, estimators.
    filters: Vec<Filter>,
    starts: Vec<Starts>,
    members: usize,
    outputs: usize,
    /// Half widths of the outputs above which an instant counts as not evaluated.
    too_wide: Vec<f64>,
    /// Those right after a restart.
    restart_widths: Option<Vec<f64>>,
    episodes: EpisodeRules,
    interval: StateInterval,
    inputs: Inputs,
    rows: Vec<Vec<TestRow>>,
    work: Workspace,
    state: State,
    idle: State,
    format: StateFormat,
    description: Description,
}

impl ReducedOrderObserver {
    /// The diagnoser of a design in the joint mode.
    ///
    /// # Errors
    /// [`ConstructionError`]: too many channels, or a restart box that is wrong.
    pub fn new(design: &Design) -> Result<Self, ConstructionError> {
        let (plant, options) = (&design.plant, &design.options);
        let bounds = &options.bounds;
        let restart = options.restart_box(plant)?;
        let isolation = &design.isolation;
        let designs: Vec<&ObserverDesign> = std::iter::once(&design.main)
            .chain(&isolation.members)
            .chain(&isolation.estimators)
            .collect();
        let fault_bound = |design: &ObserverDesign| {
            let bounds = options.isolation.fault_bound.as_ref()?;
            bounds.get(design.actuator?).copied()
        };
        let order = bounds.effective_generator_order();
        let filters: Vec<Filter> = designs
            .iter()
            .map(|design| {
                Filter::new(
                    plant,
                    design,
                    order,
                    bounds.rounding_tolerance,
                    fault_bound(design),
                )
            })
            .collect();
        let start = |observer: &Observer| match bounds.effective_initialisation() {
            Initialisation::MeasuredOutput => Start::measured_output(plant, observer, &plant.initial_state),
            Initialisation::PriorBox => Start::prior_box(plant, observer, &plant.initial_state),
        };
        let starts: Vec<Starts> = designs
            .iter()
            .map(|design| Starts {
                first: start(&design.observer),
                again: restart
                    .as_ref()
                    .map(|states| Start::measured_output(plant, &design.observer, states)),
            })
            .collect();
        let hull = design.main.hull();
        let widths_after = |start: &Start| {
            let (generators, first) = (start.generators(), design.main.thresholds.row(0));
            let sums = generators.iter_rows().zip(first.iter());
            sums.take(plant.outputs())
                .map(|(row, noise)| crate::matrix::absolute_sum(row) + noise)
                .collect()
        };
        let state = State {
            phase: Phase::Starting,
            filters: filters.iter().map(Filter::idle_state).collect(),
            episode: EpisodeState::new(isolation.members.len()),
        };
        Ok(Self {
            members: isolation.members.len(),
            outputs: plant.outputs(),
            too_wide: hull
                .iter()
                .map(|width| options.missing.max_width_ratio * width + bounds.rounding_tolerance)
                .collect(),
            restart_widths: starts
                .first()
                .and_then(|starts| starts.again.as_ref())
                .map(widths_after),
            episodes: EpisodeRules {
                alarm_samples: bounds.alarm_samples,
                clear_samples: options.isolation.clear_samples,
                actuators: plant.actuators(),
                isolate: options.isolation.enabled,
            },
            interval: StateInterval::new(plant, &design.main),
            inputs: Inputs::new(plant),
            rows: filters
                .iter()
                .map(|filter| vec![TestRow::default(); filter.row_count()])
                .collect(),
            work: Workspace::new(plant.states(), plant.outputs(), filters.iter()),
            idle: state.clone(),
            state,
            format: StateFormat::new("reduced_order_observer", STATE_VERSION, options),
            description: Description {
                method: "reduced_order_observer",
                channels: describe(design)?,
                faults: fault_names(&options.model, plant.actuators()),
                measurement_count: plant.outputs(),
                command_count: plant.actuators(),
                packets: None,
            },
            filters,
            starts,
        })
    }

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
                    Some(starts) if !starts.first.from_output() => self.run(record),
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
        match (self.state.phase, tested && !wide) {
            (Phase::Lost, _) if self.restart_widths.is_none() => Verdict::GuaranteeLost,
            (_, true) => Verdict::Nominal,
            (_, false) => Verdict::NotEvaluated,
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
            if start.from_output() {
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
