//! Known inputs and the selected model: what a missing command means (method sheet 4).

use serde::{Deserialize, Serialize};

/// The last received input and model number.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Inputs {
    /// Whether the first input is known: u(0).
    pub started: bool,
    /// u(k), each element held while it is missing.
    pub present: Vec<f64>,
    /// u(k-1).
    pub previous: Vec<f64>,
    /// Number of the model of instant k.
    pub model: usize,
    /// Instants in a row with an element missing.
    pub held_steps: u32,
}

impl Inputs {
    pub fn new(inputs: usize, initial: Option<&[f64]>, commands: usize) -> Self {
        let mut state = Self {
            started: false,
            present: vec![0.0; inputs],
            previous: vec![0.0; inputs],
            model: 0,
            held_steps: 0,
        };
        state.restart(initial, commands);
        state
    }

    /// Back to before the first input; `commands` is the number of elements a step brings.
    pub fn restart(&mut self, initial: Option<&[f64]>, commands: usize) {
        self.present.fill(0.0);
        self.previous.fill(0.0);
        self.model = 0;
        self.held_steps = 0;
        self.started = commands == 0;
        if let Some(initial) = initial {
            self.started = true;
            self.present.copy_from_slice(initial);
        }
    }

    /// Takes the commands of this instant; with `models` the last one is the number of the model. Returns whether
    /// all arrived.
    pub fn receive(&mut self, commands: &[f64], models: Option<usize>) -> bool {
        let count = self.present.len() + usize::from(models.is_some());
        self.previous.copy_from_slice(&self.present);
        let mut complete = commands.len() == count;
        if complete {
            for (held, value) in self.present.iter_mut().zip(commands) {
                if value.is_finite() {
                    *held = *value;
                } else {
                    complete = false;
                }
            }
            if let Some(models) = models {
                match commands.last().and_then(|number| model_number(*number, models)) {
                    Some(number) => self.model = number,
                    None => complete = false,
                }
            }
        }
        self.held_steps = if complete {
            0
        } else {
            self.held_steps.saturating_add(1)
        };
        complete
    }

    pub fn fits(&self, other: &Self, models: usize) -> bool {
        self.present.len() == other.present.len()
            && self.previous.len() == other.previous.len()
            && self.model < models.max(1)
    }
}

/// The number of a model; a value that is no whole number below `models` counts as missing.
fn model_number(value: f64, models: usize) -> Option<usize> {
    let whole = value >= 0.0 && value < models as f64 && value.fract() == 0.0;
    whole.then_some(value as usize)
}
