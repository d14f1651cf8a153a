//! Which faults the present thresholds can see (method sheet 4.8).
//!
//! In mode i a constant fault j is certainly seen by a test row when it exceeds 2h/|w'CB_j|, and by a certificate
//! when it exceeds 2h/gain. It is detected as soon as one mode without j is falsified and isolated when all are.

use super::{modes::FaultMode, outcome::Outcome};
use crate::diagnoser::Channel;

/// Smallest faults that are certainly detected and isolated with the thresholds of one instant.
#[derive(Clone, Debug)]
pub(super) struct Floors {
    detectable: Vec<f64>,
    isolable: Vec<f64>,
    of_interest: Option<Vec<f64>>,
    tested: bool,
}

impl Floors {
    /// `of_interest`: the faults that must stay detectable, length nu.
    pub fn new(actuators: usize, of_interest: Option<Vec<f64>>) -> Self {
        Self {
            detectable: vec![f64::INFINITY; actuators],
            isolable: vec![f64::NAN; actuators],
            of_interest,
            tested: false,
        }
    }

    /// Forgets the last instant.
    pub fn clear(&mut self) {
        self.detectable.fill(f64::INFINITY);
        self.isolable.fill(f64::NAN);
        self.tested = false;
    }

    /// Takes the floors of one mode.
    pub fn note(&mut self, mode: FaultMode, outcome: &Outcome) {
        let finite = outcome.floors.iter().any(|floor| floor.is_finite());
        self.tested |= finite;
        for j in mode.other_actuators(self.detectable.len()) {
            self.detectable[j] = self.detectable[j].min(outcome.floors[j]);
            self.isolable[j] = self.isolable[j].max(outcome.floors[j]);
        }
    }

    /// Whether a fault of interest is below what is certainly detected; false at an instant without a test.
    pub fn inert(&self) -> bool {
        let of_interest = self.of_interest.as_deref().unwrap_or(&[]);
        self.tested
            && self
                .detectable
                .iter()
                .zip(of_interest)
                .any(|(floor, size)| floor > size)
    }

    /// `detectable_fault_j`, then `isolable_fault_j`: from 0 to the fault of interest, without an alarm.
    pub fn channels(&self) -> impl Iterator<Item = Channel> + '_ {
        let limit = |j: usize| self.of_interest.as_ref().map_or(f64::INFINITY, |sizes| sizes[j]);
        let both = self
            .detectable
            .iter()
            .enumerate()
            .chain(self.isolable.iter().enumerate());
        both.map(move |(j, &floor)| {
            if self.tested && floor.is_finite() {
                Channel {
                    lower: 0.0,
                    residual: floor,
                    upper: limit(j),
                    ratio: 0.0,
                }
            } else {
                Channel::NOT_EVALUATED
            }
        })
    }
}
