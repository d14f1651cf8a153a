//! The three forms of the filters behind one face.

use super::{
    batch::BatchUpdate,
    design::{Form, ImmDesign},
    interval::Interval,
    joseph::JosephSteps,
    mixing::Mixer,
    sensor::SensorModel,
    small_bank::{SmallBank, small_bank},
    square_root::RootSteps,
    state::ModeState,
};
use crate::matrix::Matrix;

/// How a mode is predicted and updated.
#[derive(Clone)]
pub(super) enum Recursion {
    /// The covariance form for few filter states; it holds the moments itself.
    Small(Box<dyn SmallBank>),
    /// The covariance form.
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
            Form::Sequential => match small_bank(n, modes.len(), widest) {
                Some(bank) => Self::Small(bank),
                None => Self::Joseph(JosephSteps::new(modes.len(), n, widest)),
            },
            Form::SequentialSquareRoot => Self::Root(RootSteps::new(modes.len(), n, widest)),
            Form::BatchUnobserved => Self::Batch {
                steps: JosephSteps::new(modes.len(), n, widest),
                update: Box::new(BatchUpdate::new(max_slots, widest, states, channels, n)),
                updated: modes.to_vec(),
            },
        }
    }

    /// Mixes the posteriors of the last instant, with the weights that the mixer found.
    pub fn mix(&mut self, mixer: &mut Mixer, from: &[ModeState], mixed: &mut [ModeState]) {
        match self {
            Self::Small(bank) => bank.mix(from, mixer),
            _ => mixer.mix_moments(from, mixed),
        }
    }

    /// Hands out the moments at the end of an interval.
    pub fn finish(&self, mixed: &mut [ModeState]) {
        if let Self::Small(bank) = self {
            bank.store(mixed);
        }
    }

    /// Takes the interval of the next predictions.
    pub fn prepare(&mut self, interval: &Interval) {
        if let Self::Small(bank) = self {
            bank.prepare(interval);
        }
    }

    /// Predicts mode `m` over an interval; `noise_root` is its Ω^{1/2}.
    pub fn predict(
        &mut self,
        m: usize,
        interval: &Interval,
        noise_root: Option<&Matrix>,
        direction: &Matrix,
        state: &mut ModeState,
    ) {
        match (self, noise_root) {
            (Self::Small(bank), _) => bank.predict(m, interval, direction),
            (Self::Root(steps), Some(root)) => steps.predict(interval, root, direction, state),
            (Self::Joseph(steps) | Self::Batch { steps, .. }, _) => steps.predict(interval, direction, state),
            (Self::Root(_), None) => {}
        }
    }

    /// Prepares the update of mode `m` with one sample; false if the sample cannot be used.
    pub fn innovate(&mut self, m: usize, state: &ModeState, sensor: &SensorModel, z: &[f64]) -> bool {
        match self {
            Self::Small(bank) => bank.innovate(m, sensor, z),
            Self::Joseph(steps) => steps.innovate(m, state, sensor, z),
            Self::Root(steps) => steps.innovate(m, state, sensor, z),
            Self::Batch { .. } => false,
        }
    }

    /// Updates mode `m` with the sample that was prepared; its log-likelihood.
    pub fn update(&mut self, m: usize, state: &mut ModeState, sensor: &SensorModel) -> f64 {
        match self {
            Self::Small(bank) => bank.update(m, sensor),
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
