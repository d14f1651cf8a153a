//! The filter of one fault mode in the configured form.

use super::{
    filter::CoupledFilter,
    fixed_step::FixedFilter,
    kalman::KalmanFilter,
    outcome::Outcome,
    paper::PaperFilter,
    plant::{Command, Measured, Plant},
    state::SetState,
    workspace::Workspace,
};
use crate::matrix::combination;

/// One filter; see the module of each form.
#[derive(Clone, Debug)]
pub(crate) enum ModeFilter {
    Coupled(CoupledFilter),
    Fixed(Box<FixedFilter>),
    Paper(PaperFilter),
    Kalman(KalmanFilter),
}

impl ModeFilter {
    /// One step with the command of the last transition and the measurements of this instant.
    pub fn step(
        &self,
        plant: &Plant,
        command: &Command,
        measured: &Measured,
        state: &mut SetState,
        work: &mut Workspace,
        outcome: &mut Outcome,
    ) {
        match self {
            Self::Coupled(filter) => filter.step(plant, command, measured, state, work, outcome),
            Self::Fixed(filter) => filter.step(plant, command, measured, state, work, outcome),
            Self::Paper(filter) => filter.step(plant, command, measured, state, work, outcome),
            Self::Kalman(filter) => filter.step(plant, command, measured, state, &mut work.kalman, outcome),
        }
    }

    /// Responses of the projector row of an output to unit faults of all actuators, one step later; `None` in the
    /// Kalman-type baseline, whose thresholds promise nothing.
    pub fn responses(&self, plant: &Plant, output: usize) -> Option<Vec<f64>> {
        let decoupling = match self {
            Self::Coupled(filter) => &filter.decoupling,
            Self::Fixed(filter) => filter.decoupling(),
            Self::Paper(filter) => filter.decoupling(),
            Self::Kalman(_) => return None,
        };
        let mut responses = vec![0.0; plant.nu()];
        combination(&mut responses, decoupling.test_rows.row(output), &plant.cb);
        Some(responses)
    }

    /// Whether the set of this filter contains the state while its mode holds.
    pub fn is_guaranteed(&self) -> bool {
        !matches!(self, Self::Kalman(_))
    }
}
