//! Construction of the diagnoser of the joint mode from a design.

use super::{
    ReducedOrderObserver,
    channels::{describe, fault_names},
    design::Design,
    episode::{EpisodeRules, EpisodeState},
    error::ConstructionError,
    filter::Filter,
    inputs::Inputs,
    joint::{Phase, STATE_VERSION, Starts, State},
    observer::Observer,
    observer_design::ObserverDesign,
    options::Initialisation,
    start::Start,
    state_interval::StateInterval,
    test_row::TestRow,
    workspace::Workspace,
};
use crate::{diagnoser::Description, matrix::absolute_sum, state::StateFormat};

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
                .map(|(row, noise)| absolute_sum(row) + noise)
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
            format: StateFormat::new("reduced_order_observer", STATE_VERSION, &(options, &design.gains)),
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
}
