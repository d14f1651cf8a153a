//! The paper's bound and the traditional interval observer, for comparison; neither is guaranteed (method sheet
//! 3.10, paper equations (13), (14), (16) to (18) with the corrections of method sheet 5).
//!
//! Both bound z̃1 alone, by p ± α:
//!
//! | bound | p⁺ | α⁺ |
//! |---|---|---|
//! | paper | M p + D1 p_η | row sums of H⁺ = \[M R_d(H), D1 H_η\] |
//! | interval | the same | \|M\| α + \|D1\| H_η, which is what lower and upper ends give by positive and negative parts |

use super::{
    channels::output_excess,
    episode::{EpisodeRules, EpisodeState, Findings},
    inputs::{Commands, Inputs},
    observer_pair::{ObserverPair, PairRoom},
    options::Mode,
    start::Start,
    test_row::TestRow,
};
use crate::{
    diagnoser::{Description, Diagnoser, StepInput, StepRecord, Verdict, flags},
    matrix::{Matrix, all_finite, apply, multiply, row_sums},
    state::{RestoreError, StateFormat},
    zonotope::Reducer,
};
use serde::{Deserialize, Serialize};

/// Version of [`State`].
pub(super) const STATE_VERSION: u16 = 1;

/// Everything that changes from instant to instant.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct State {
    pub(super) started: bool,
    /// A command without a box was missing, or the observers are not finite any more.
    pub(super) lost: bool,
    pub(super) z1: Vec<f64>,
    pub(super) z2: Vec<f64>,
    /// p.
    pub(super) centre: Vec<f64>,
    /// α.
    pub(super) radius: Vec<f64>,
    /// H of the paper's bound.
    pub(super) generators: Matrix,
    pub(super) episode: EpisodeState,
}

/// The two observers with a bound of z̃1 alone.
#[derive(Clone, Debug)]
pub struct BaselineObserver {
    pub(super) mode: Mode,
    pub(super) observers: ObserverPair,
    pub(super) start: Start,
    pub(super) m: Matrix,
    /// |M|.
    pub(super) m_absolute: Matrix,
    /// D1 p_η.
    pub(super) shift: Vec<f64>,
    /// D1 H_η.
    pub(super) disturbance: Matrix,
    /// |D1| H_η.
    pub(super) spread: Vec<f64>,
    pub(super) order: usize,
    pub(super) tolerance: f64,
    pub(super) episodes: EpisodeRules,
    pub(super) inputs: Inputs,
    pub(super) rows: Vec<TestRow>,
    pub(super) room: Vec<f64>,
    pub(super) pair_room: PairRoom,
    pub(super) product: Matrix,
    pub(super) reducer: Reducer,
    pub(super) state: State,
    pub(super) idle: State,
    pub(super) format: StateFormat,
    pub(super) description: Description,
}

impl BaselineObserver {
    /// ẑ1 and ẑ2: what is predicted for the next instant.
    pub fn observer_state(&self) -> (&[f64], &[f64]) {
        (&self.state.z1, &self.state.z2)
    }

    fn advance(&mut self, y: &[f64], u: &[f64], record: &mut StepRecord) {
        self.inputs.receive(y, u);
        self.rows.fill(TestRow::default());
        record.inputs_valid = self.inputs.received;
        record.flags |= if self.inputs.complete() {
            0
        } else {
            flags::INPUT_MISSING
        };
        if !self.state.started && self.inputs.all_valid && self.inputs.commands != Commands::Lost {
            self.start
                .observers(&self.inputs.y, &mut self.state.z1, &mut self.state.z2);
            self.state.started = true;
        }
        let quiet = match (self.state.started, self.state.lost) {
            (false, _) => Verdict::Starting,
            (true, true) => Verdict::GuaranteeLost,
            (true, false) => self.run(record),
        };
        self.episodes.conclude(&self.state.episode, quiet, record);
        self.write(record);
    }

    fn run(&mut self, record: &mut StepRecord) -> Verdict {
        self.test();
        let found = Findings {
            tested: self.rows.iter().any(|row| row.evaluated),
            alarm: self.rows.iter().any(TestRow::alarm),
        };
        if self
            .episodes
            .update(&mut self.state.episode, found, std::iter::empty())
        {
            record.flags |= flags::ALARM_NOW;
        }
        let state = &mut self.state;
        self.observers
            .advance(&mut state.z1, &mut state.z2, &self.inputs, &mut self.pair_room);
        self.advance_bound();
        let state = &mut self.state;
        let finite = all_finite(&state.z1) && all_finite(&state.z2) && all_finite(&state.radius);
        state.lost = self.inputs.commands == Commands::Lost || !finite;
        if found.tested {
            Verdict::Nominal
        } else {
            Verdict::NotEvaluated
        }
    }

    fn test(&mut self) {
        let state = &self.state;
        let bounds = state.z1.iter().zip(state.centre.iter().zip(&state.radius));
        let samples = self.inputs.y.iter().zip(&self.inputs.valid);
        for (row, ((y, valid), (z1, (centre, radius)))) in self.rows.iter_mut().zip(samples.zip(bounds)) {
            *row = TestRow {
                evaluated: *valid,
                residual: if *valid { y - z1 } else { 0.0 },
                centre: *centre,
                half_width: radius + self.tolerance * (1.0 + y.abs() + z1.abs()),
            };
        }
    }

    fn advance_bound(&mut self) {
        let state = &mut self.state;
        apply(&self.m, &state.centre, &mut self.room);
        for ((target, value), shift) in state.centre.iter_mut().zip(&self.room).zip(&self.shift) {
            *target = value + shift;
        }
        if self.mode == Mode::Paper {
            self.reducer.reduce(&mut state.generators, self.order);
            multiply(&self.m, &state.generators, &mut self.product);
            self.product.append(&self.disturbance);
            state.generators.copy_from(&self.product);
            row_sums(&state.generators, &mut state.radius);
        } else {
            apply(&self.m_absolute, &state.radius, &mut self.room);
            for ((target, value), spread) in state.radius.iter_mut().zip(&self.room).zip(&self.spread) {
                *target = value + spread;
            }
        }
    }

    /// What the half widths settle at; `None` if they grow without limit or very slowly.
    pub(super) fn settled_half_widths(&self) -> Option<Vec<f64>> {
        const STEPS: usize = 10_000;
        const SETTLED: f64 = 1e-12;
        let mut bounds = self.clone();
        for _ in 0..STEPS {
            let before = bounds.state.radius.clone();
            bounds.advance_bound();
            if !all_finite(&bounds.state.radius) {
                return None;
            }
            let mut pairs = before.iter().zip(&bounds.state.radius);
            if pairs.all(|(old, new)| (new - old).abs() <= SETTLED * new) {
                return Some(bounds.state.radius);
            }
        }
        None
    }

    fn write(&self, record: &mut StepRecord) {
        record.channel_count = self.description.channels.len() as u32;
        let rows = self.rows.iter().map(TestRow::channel);
        let channels = rows.chain(std::iter::once(output_excess(self.rows.iter().copied())));
        for (slot, channel) in record.channels.iter_mut().zip(channels) {
            *slot = channel;
        }
        record.fault_estimate = f64::NAN;
        record.fault_estimate_half_width = f64::NAN;
    }
}

impl State {
    /// Whether a saved state has the lengths and rooms of this one.
    fn fits(&self, other: &Self) -> bool {
        self.z1.len() == other.z1.len()
            && self.z2.len() == other.z2.len()
            && self.centre.len() == other.centre.len()
            && self.radius.len() == other.radius.len()
            && self.generators.rows() == other.generators.rows()
            && self.generators.has_room_of(&other.generators)
            && self.episode.fits(&other.episode)
    }
}

impl Diagnoser for BaselineObserver {
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
        let (state, idle) = (&mut self.state, &self.idle);
        state.started = false;
        state.lost = false;
        state.z1.copy_from_slice(&idle.z1);
        state.z2.copy_from_slice(&idle.z2);
        state.centre.copy_from_slice(&idle.centre);
        state.radius.copy_from_slice(&idle.radius);
        state.generators.copy_from(&idle.generators);
        state.episode.clear();
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
        if !saved.fits(&self.state) {
            return Err(RestoreError::Damaged);
        }
        self.state = saved;
        Ok(())
    }
}
