//! What of y and u is there at one instant.

use super::plant::Plant;

/// The samples of one instant with their validity.
#[derive(Clone, Debug)]
pub(super) struct Inputs {
    /// y, zero where it is missing.
    pub y: Vec<f64>,
    /// s: which outputs are there.
    pub valid: Vec<bool>,
    /// Whether all of them are.
    pub all_valid: bool,
    /// u; where it is missing the centre of its box, if that is known.
    pub u: Vec<f64>,
    /// Half width of u: zero where it is there.
    pub u_radius: Vec<f64>,
    /// How much of u is there.
    pub commands: Commands,
    /// Bit i: element i of outputs followed by commands was received.
    pub received: u64,
    bounds: Option<(Vec<f64>, Vec<f64>)>,
}

/// How much of u is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Commands {
    /// All of it.
    Complete,
    /// What is missing lies in its box.
    Bridged,
    /// Something is missing and has no box.
    Lost,
}

impl Inputs {
    pub fn new(plant: &Plant) -> Self {
        let (p, m) = (plant.outputs(), plant.actuators());
        let list = |vector: &nalgebra::DVector<f64>| vector.as_slice().to_vec();
        Self {
            y: vec![0.0; p],
            valid: vec![false; p],
            all_valid: false,
            u: vec![0.0; m],
            u_radius: vec![0.0; m],
            commands: Commands::Lost,
            received: 0,
            bounds: plant
                .input
                .as_ref()
                .map(|bounds| (list(&bounds.centre), list(&bounds.radius))),
        }
    }

    /// Takes the samples of an instant; what is not finite, or a list of a wrong length, is missing.
    pub fn receive(&mut self, y: &[f64], u: &[f64]) {
        self.received = 0;
        let p = self.y.len();
        for (i, (value, valid)) in self.y.iter_mut().zip(&mut self.valid).enumerate() {
            let sample = y
                .get(i)
                .copied()
                .filter(|sample| y.len() == p && sample.is_finite());
            *value = sample.unwrap_or(0.0);
            *valid = sample.is_some();
            self.received |= bit(i, *valid);
        }
        self.all_valid = self.valid.iter().all(|valid| *valid);
        self.commands = Commands::Complete;
        let m = self.u.len();
        for (j, (value, radius)) in self.u.iter_mut().zip(&mut self.u_radius).enumerate() {
            let sample = u
                .get(j)
                .copied()
                .filter(|sample| u.len() == m && sample.is_finite());
            let bound = self
                .bounds
                .as_ref()
                .map(|(centre, radius)| (centre[j], radius[j]));
            (*value, *radius) = match (sample, bound) {
                (Some(sample), _) => (sample, 0.0),
                (None, Some(bound)) => bound,
                (None, None) => (0.0, 0.0),
            };
            if sample.is_none() && self.commands != Commands::Lost {
                self.commands = if bound.is_some() {
                    Commands::Bridged
                } else {
                    Commands::Lost
                };
            }
            self.received |= bit(p + j, sample.is_some());
        }
    }

    /// Whether everything arrived.
    pub fn complete(&self) -> bool {
        self.all_valid && self.commands == Commands::Complete
    }
}

fn bit(position: usize, set: bool) -> u64 {
    if position < 64 {
        u64::from(set) << position
    } else {
        0
    }
}
