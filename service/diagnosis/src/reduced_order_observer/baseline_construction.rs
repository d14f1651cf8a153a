//! Construction of the diagnoser of the modes `paper` and `tiom` from a design.

use super::{
    BaselineObserver,
    baseline::{STATE_VERSION, State},
    channels::{describe, fault_names},
    design::Design,
    episode::{EpisodeRules, EpisodeState},
    error::ConstructionError,
    inputs::Inputs,
    observer_pair::{ObserverPair, PairRoom},
    start::Start,
    test_row::TestRow,
};
use crate::{
    diagnoser::Description,
    matrix::Matrix,
    state::StateFormat,
    zonotope::{Reducer, Reduction},
};
use nalgebra::DMatrix;

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
            format: StateFormat::new("reduced_order_observer", STATE_VERSION, &(options, &design.gains)),
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
}
