//! What a checkpoint keeps.

use super::{alarm::AlarmState, engine::Detectors, filter::Filter, inputs::Inputs, step_model::StepModel};
use serde::{Deserialize, Serialize};

/// Everything that changes from instant to instant.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct State {
    pub inputs: Inputs,
    pub filter: Filter,
    pub detectors: Detectors,
    pub alarm: AlarmState,
    /// Sensors that count as missing, as bits.
    pub excluded: u64,
    /// Whether commands were missing for too long.
    pub input_lost: bool,
    /// Instants skipped in a row.
    pub gap: u32,
    /// The matrices in force with `schedule = "external"`.
    pub model: Option<StepModel>,
}

impl State {
    pub fn fits(&self, other: &Self, models: usize, components: usize, admissible: &[bool]) -> bool {
        let model = match (&self.model, &other.model) {
            (Some(model), Some(other)) => model.has_shapes_of(other),
            (None, None) => true,
            _ => false,
        };
        let known = |set: u64| usize::try_from(set).ok().and_then(|set| admissible.get(set)) == Some(&true);
        model
            && (self.excluded == 0 || known(self.excluded))
            && self.inputs.fits(&other.inputs, models)
            && self.filter.fits(&other.filter)
            && self.detectors.fits(&other.detectors)
            && self.alarm.fits(components)
    }
}
