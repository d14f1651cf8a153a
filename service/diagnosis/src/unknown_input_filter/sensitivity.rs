//! Which constant faults a bank is certain to see, and how soon (method sheet 3.4, 4.8).
//!
//! In mode i a constant fault j is certainly seen one step later by a test row if it exceeds 2h/|w'CB_j|, and after L
//! steps by a certificate if it exceeds 2h/gain, with h at |x| = x_nom. It is detected as soon as one mode without j
//! is falsified and isolated when all of them are.

use super::{bank::Mode, modes::FaultMode, parity::ParityTest, settled::Settled};
use std::collections::BTreeSet;

/// What one mode sees of foreign faults.
pub(super) struct ModeFloors {
    mode: FaultMode,
    /// For each actuator the smallest fault seen by the rows of one instant; infinite if none.
    one_step: Vec<f64>,
    /// (j, L, floor) of each certificate.
    certificates: Vec<(usize, usize, f64)>,
}

/// The smallest constant faults that are certainly detected and isolated within a number of samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sizes {
    /// L.
    pub samples: usize,
    /// Infinite: no size is.
    pub detectable: f64,
    /// Infinite: no size is; 0 if there is no mode that would have to be falsified.
    pub isolable: f64,
}

impl ModeFloors {
    /// The floors of a mode; without a settled filter nothing is certain.
    pub fn new(mode: &Mode, settled: Option<&Settled>, nominal_state: &[f64], actuators: usize) -> Self {
        let one_step = settled.filter(|settled| !settled.grows);
        Self {
            mode: mode.mode,
            one_step: one_step.map_or_else(
                || vec![f64::INFINITY; actuators],
                |settled| settled.floors.clone(),
            ),
            certificates: mode
                .parity
                .iter()
                .map(|test| {
                    (
                        test.fault(),
                        test.length(),
                        certificate_floor(test, nominal_state),
                    )
                })
                .collect(),
        }
    }

    /// The smallest fault of an actuator that is certainly seen within so many samples; infinite if none.
    pub fn within(&self, actuator: usize, samples: usize) -> f64 {
        let certificates = self.certificates.iter();
        certificates
            .filter(|(fault, length, _)| *fault == actuator && *length <= samples)
            .map(|(.., floor)| *floor)
            .fold(
                self.one_step.get(actuator).copied().unwrap_or(f64::INFINITY),
                f64::min,
            )
    }
}

/// 2h/gain with |x| = x_nom.
pub(super) fn certificate_floor(test: &ParityTest, nominal_state: &[f64]) -> f64 {
    2.0 * test.half_width_at(nominal_state) / test.gain()
}

/// What a bank of these modes is certain to see of a fault within 1 sample and within the lengths of its certificates.
pub(super) fn sizes(modes: &[ModeFloors], actuator: usize) -> Vec<Sizes> {
    let lengths = modes.iter().flat_map(|mode| &mode.certificates);
    let mut lengths: BTreeSet<usize> = lengths.map(|(_, length, _)| *length).collect();
    lengths.insert(1);
    let of_length = |samples: usize| {
        let foreign = modes.iter().filter(|mode| !mode.mode.contains(actuator));
        let floors = foreign.map(|mode| mode.within(actuator, samples));
        Sizes {
            samples,
            detectable: floors.clone().fold(f64::INFINITY, f64::min),
            isolable: floors.fold(0.0, f64::max),
        }
    };
    lengths.into_iter().map(of_length).collect()
}
