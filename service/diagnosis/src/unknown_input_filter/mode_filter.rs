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

/// One filter; see the module of each form.
#[derive(Clone, Debug)]
pub(crate) enum ModeFilter {
    Coupled(CoupledFilter),
    Fixed(FixedFilter),
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

    /// Whether the set of this filter contains the state while its mode holds.
    pub fn is_guaranteed(&self) -> bool {
        !matches!(self, Self::Kalman(_))
    }
}
