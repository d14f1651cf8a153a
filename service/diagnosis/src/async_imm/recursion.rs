//! The three forms of the filters behind one face.

use super::{
    batch::BatchUpdate,
    design::{Form, ImmDesign},
    interval::Interval,
    joseph::JosephSteps,
    sensor::SensorModel,
    square_root::RootSteps,
    state::ModeState,
};
use crate::matrix::Matrix;

/// How a mode is predicted and updated.
#[derive(Clone)]
pub(super) enum Recursion {
    Joseph(JosephSteps),
    Root(RootSteps),
    Batch {
        steps: JosephSteps,
        update: Box<BatchUpdate>,
        updated: Vec<ModeState>,
    },
}

impl Recursion {
    /// For a (checked) design; `max_slots` bounds the samples of one interval in the batch form.
    pub fn new(design: &ImmDesign, modes: &[ModeState], max_slots: usize) -> Self {
        let (states, _, channels) = design.plant.sizes();
        let (n, widest) = (design.filter_states(), design.widest_sensor());
        match design.form {
            Form::Sequential => Self::Joseph(JosephSteps::new(modes.len(), n, widest)),
            Form::SequentialSquareRoot => Self::Root(RootSteps::new(modes.len(), n, widest)),
            Form::BatchUnobserved => Self::Batch {
                steps: JosephSteps::new(modes.len(), n, widest),
                update: Box::new(BatchUpdate::new(max_slots, widest, states, channels, n)),
                updated: modes.to_vec(),
            },
        }
    }

    /// Predicts one mode over an interval; `noise_root` is its Ω^{1/2}.
    pub fn predict(
        &mut self,
        interval: &Interval,
        noise_root: Option<&Matrix>,
        direction: &Matrix,
        state: &mut ModeState,
    ) {
        match (self, noise_root) {
            (Self::Root(steps), Some(root)) => steps.predict(interval, root, direction, state),
            (Self::Joseph(steps) | Self::Batch { steps, .. }, _) => steps.predict(interval, direction, state),
            (Self::Root(_), None) => {}
        }
    }

    /// Prepares the update of mode `m` with one sample; false if the sample cannot be used.
    pub fn innovate(&mut self, m: usize, state: &ModeState, sensor: &SensorModel, z: &[f64]) -> bool {
        match self {
            Self::Joseph(steps) => steps.innovate(m, state, sensor, z),
            Self::Root(steps) => steps.innovate(m, state, sensor, z),
            Self::Batch { .. } => false,
        }
    }

    /// Updates mode `m` with the sample that was prepared; its log-likelihood.
    pub fn update(&mut self, m: usize, state: &mut ModeState, sensor: &SensorModel) -> f64 {
        match self {
            Self::Joseph(steps) => steps.update(m, state, sensor),
            Self::Root(steps) => steps.update(m, state, sensor),
            Self::Batch { .. } => 0.0,
        }
    }

    /// Theorem 1 in every mode, or in none and false.
    pub fn update_all_at_once(
        &mut self,
        directions: &[Matrix],
        modes: &mut Vec<ModeState>,
        log_likelihood: &mut [f64],
    ) -> bool {
        let Self::Batch { update, updated, .. } = self else {
            return true;
        };
        if update.is_empty() {
            return true;
        }
        for (m, state) in updated.iter_mut().enumerate() {
            state.copy_from(&modes[m]);
            match update.update(&directions[m], state) {
                Some(value) => log_likelihood[m] = value,
                None => {
                    log_likelihood.fill(0.0);
                    return false;
                }
            }
        }
        std::mem::swap(updated, modes);
        true
    }
}
