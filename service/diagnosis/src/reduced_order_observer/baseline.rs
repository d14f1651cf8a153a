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
    channels::{describe, fault_names, output_excess},
    design::Design,
    episode::{EpisodeRules, EpisodeState, Findings},
    error::ConstructionError,
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
    zonotope::{Reducer, Reduction},
};
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// Version of [`State`].
const STATE_VERSION: u16 = 1;

/// Everything that changes from instant to instant.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct State {
    started: bool,
    /// A command without a box was missing, or the observers are not finite any more.
    lost: bool,
    z1: Vec<f64>,
    z2: Vec<f64>,
    /// p.
    centre: Vec<f64>,
    /// α.
    radius: Vec<f64>,
    /// H of the paper's bound.
    generators: Matrix,
    episode: EpisodeState,
}

/// The two observers with a bound of z̃1 alone.
#[derive(Clone, Debug)]
pub struct BaselineObserver {
    mode: Mode,
    observers: ObserverPair,
    start: Start,
    m: Matrix,
    /// |M|.
    m_absolute: Matrix,
    /// D1 p_η.
    shift: Vec<f64>,
    /// D1 H_η.
    disturbance: Matrix,
    /// |D1| H_η.
    spread: Vec<f64>,
    order: usize,
    tolerance: f64,
    episodes: EpisodeRules,
    inputs: Inputs,
    rows: Vec<TestRow>,
    room: Vec<f64>,
    pair_room: PairRoom,
    product: Matrix,
    reducer: Reducer,
    state: State,
    idle: State,
    format: StateFormat,
    description: Description,
}

impl BaselineObserver {
    /// The diagnoser of a design in the mode `paper` or `tiom`.
    ///
    /// # Errors
    /// [`ConstructionError::TooManyChannels`].
    pub fn new(design: &Design) -> Result<Self, ConstructionError> {
        let (plant, options) = (&design.plant, &design.options);
        let (p, q) = (plant.outputs(), plant.disturbances());
        let observer = &design.main.observer;
        let order = options.bounds.effective_generator_order();
        let d1 = plant.d.rows(0, p).into_owned();
        let disturbance = &d1 * DMatrix::from_diagonal(&plant.disturbance.radius);
        // The box of C x(0), relative to ẑ1(0) = C x_c.
        let radius: Vec<f64> = (plant.c.abs() * &plant.initial_state.radius).as_slice().to_vec();
        let columns = order.max(p) + q;
        let mut generators = Matrix::with_capacity(p, columns);
        generators.append_diagonal(&radius);
        let state = State {
            started: false,
            lost: false,
            z1: vec![0.0; p],
            z2: vec![0.0; plant.hidden()],
            centre: vec![0.0; p],
            radius,
            generators,
            episode: EpisodeState::new(0),
        };
        let outputs_only = Design {
            main: design.main.clone().with_tests(DMatrix::identity(p, p)),
            ..design.clone()
        };
        Ok(Self {
            mode: options.bounds.mode,
            observers: ObserverPair::new(observer),
            start: Start::prior_box(plant, observer, &plant.initial_state),
            m: Matrix::from(&observer.m),
            m_absolute: Matrix::from(&observer.m.abs()),
            shift: (&d1 * &plant.disturbance.centre).as_slice().to_vec(),
            spread: disturbance.abs().column_sum().as_slice().to_vec(),
            disturbance: Matrix::from(&disturbance),
            order,
            tolerance: options.bounds.rounding_tolerance,
            episodes: EpisodeRules {
                alarm_samples: options.bounds.alarm_samples,
                clear_samples: options.isolation.clear_samples,
                actuators: plant.actuators(),
                isolate: false,
            },
            inputs: Inputs::new(plant),
            rows: vec![TestRow::default(); p],
            room: vec![0.0; p],
            pair_room: PairRoom::new(plant.states(), p),
            product: Matrix::with_capacity(p, columns),
            reducer: Reducer::new(Reduction::Euclidean, p, columns),
            idle: state.clone(),
            state,
            format: StateFormat::new("reduced_order_observer", STATE_VERSION, options),
            description: Description {
                method: "reduced_order_observer",
                channels: describe(&outputs_only)?,
                faults: fault_names(&options.model, plant.actuators()),
                measurement_count: p,
                command_count: plant.actuators(),
                packets: None,
            },
        })
    }

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
        match (self.state.lost, found.tested) {
            (true, _) => Verdict::GuaranteeLost,
            (false, true) => Verdict::Nominal,
            (false, false) => Verdict::NotEvaluated,
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

    fn restore(&mut self, state: &[u8]) -> Result<(), RestoreError> {
        let saved: State = self.format.decode(state)?;
        if !saved.fits(&self.state) {
            return Err(RestoreError::Damaged);
        }
        self.state = saved;
        Ok(())
    }
}
