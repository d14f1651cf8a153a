//! Fault modes: the sets of actuators that one filter each treats as unknown inputs (method sheet 1).

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};
use std::fmt;

/// A set of actuators that may be faulty together; at most 64 actuators, counted from 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "Vec<usize>", into = "Vec<usize>")]
pub struct FaultMode(u64);

impl FaultMode {
    /// The fault-free mode: no actuator is faulty.
    pub const FAULT_FREE: Self = Self(0);

    /// The mode with exactly these actuators; `None` if one of them is 64 or above.
    pub fn from_actuators(actuators: &[usize]) -> Option<Self> {
        actuators
            .iter()
            .try_fold(Self::FAULT_FREE, |mode, &j| mode.with(j))
    }

    /// The mode of these fault-set bits: bit j is actuator j.
    pub fn from_bits(bits: u64) -> Self {
        Self(bits)
    }

    /// The fault set: bit j is actuator j.
    pub fn bits(self) -> u64 {
        self.0
    }

    /// This mode with one more actuator; `None` if it is 64 or above.
    pub fn with(self, actuator: usize) -> Option<Self> {
        (actuator < 64).then(|| Self(self.0 | 1 << actuator))
    }

    /// Number of actuators of the mode.
    pub fn len(self) -> usize {
        self.0.count_ones() as usize
    }

    /// Whether this is the fault-free mode.
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Whether the actuator belongs to the mode.
    pub fn contains(self, actuator: usize) -> bool {
        actuator < 64 && self.0 >> actuator & 1 == 1
    }

    /// Whether every actuator of this mode belongs to the other.
    pub fn is_subset_of(self, other: Self) -> bool {
        self.0 & !other.0 == 0
    }

    /// Whether this mode is a subset of the other and not equal to it.
    pub fn is_proper_subset_of(self, other: Self) -> bool {
        self != other && self.is_subset_of(other)
    }

    /// The actuators of the mode in ascending order.
    pub fn actuators(self) -> impl Iterator<Item = usize> {
        (0..64).filter(move |&j| self.contains(j))
    }

    /// The actuators below `actuator_count` that do not belong to the mode, in ascending order.
    pub fn other_actuators(self, actuator_count: usize) -> impl Iterator<Item = usize> {
        (0..actuator_count).filter(move |&j| !self.contains(j))
    }

    /// F: the columns of B (nx x nu) of the mode's actuators, nx x nf; nx x 0 for the fault-free mode.
    ///
    /// Actuators that B has no column for are left out.
    pub fn unknown_input_matrix(self, b: &DMatrix<f64>) -> DMatrix<f64> {
        let columns: Vec<usize> = self.actuators().filter(|&j| j < b.ncols()).collect();
        b.select_columns(&columns)
    }

    /// The mode in the names of channels: `fault_free`, `1`, `0_2`.
    pub fn label(self) -> String {
        if self.is_empty() {
            "fault_free".to_owned()
        } else {
            self.joined("_", |j| j.to_string())
        }
    }

    /// The mode in messages: "fault-free", "heater", "heater + fan"; an actuator without a name by its number.
    pub fn describe(self, actuator_names: &[&str]) -> String {
        if self.is_empty() {
            return "fault-free".to_owned();
        }
        self.joined(" + ", |j| {
            actuator_names
                .get(j)
                .map_or_else(|| j.to_string(), |&name| name.to_owned())
        })
    }

    fn joined(self, separator: &str, name: impl Fn(usize) -> String) -> String {
        self.actuators().map(name).collect::<Vec<_>>().join(separator)
    }
}

/// The actuators as a list: `[]`, `[1]`, `[0, 2]`.
impl fmt::Display for FaultMode {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "[{}]", self.joined(", ", |j| j.to_string()))
    }
}

impl TryFrom<Vec<usize>> for FaultMode {
    type Error = String;

    fn try_from(actuators: Vec<usize>) -> Result<Self, String> {
        Self::from_actuators(&actuators)
            .ok_or_else(|| format!("the mode {actuators:?} has an actuator above 63, the largest possible"))
    }
}

impl From<FaultMode> for Vec<usize> {
    fn from(mode: FaultMode) -> Self {
        mode.actuators().collect()
    }
}

/// The modes of a bank: the fault-free mode if wanted, then the single modes, then, if `pairs`, every pair in
/// the order (0,1), (0,2), ..., (1,2), ...
pub fn enumerate_modes(actuator_count: usize, fault_free: bool, pairs: bool) -> Vec<FaultMode> {
    let count = actuator_count.min(64);
    let mut modes = Vec::new();
    if fault_free {
        modes.push(FaultMode::FAULT_FREE);
    }
    modes.extend((0..count).map(|j| FaultMode(1 << j)));
    if pairs {
        modes.extend((0..count).flat_map(|i| (i + 1..count).map(move |j| FaultMode(1 << i | 1 << j))));
    }
    modes
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::dmatrix;

    fn lists(modes: &[FaultMode]) -> Vec<Vec<usize>> {
        modes.iter().map(|&mode| mode.into()).collect()
    }

    #[test]
    fn pairs_follow_the_single_modes_in_lexicographic_order() {
        let modes = enumerate_modes(3, true, true);
        let expected: [&[usize]; 7] = [&[], &[0], &[1], &[2], &[0, 1], &[0, 2], &[1, 2]];
        assert_eq!(lists(&modes), expected);
        assert_eq!(lists(&enumerate_modes(1, false, true)), [[0]]);
    }

    #[test]
    fn the_unknown_input_matrix_has_the_columns_of_the_mode() {
        let b = dmatrix![1.0, 2.0, 3.0; 4.0, 5.0, 6.0];
        let mode = FaultMode::from_actuators(&[2, 0]).unwrap();
        assert_eq!(mode.unknown_input_matrix(&b), dmatrix![1.0, 3.0; 4.0, 6.0]);
        assert_eq!(FaultMode::FAULT_FREE.unknown_input_matrix(&b).shape(), (2, 0));
    }

    #[test]
    fn names_tell_modes_apart() {
        let pair = FaultMode::from_actuators(&[0, 2]).unwrap();
        assert_eq!(pair.label(), "0_2");
        assert_eq!(pair.describe(&["heater", "chiller", "fan"]), "heater + fan");
        assert_eq!(FaultMode::FAULT_FREE.label(), "fault_free");
        assert_eq!(pair.to_string(), "[0, 2]");
    }

    #[test]
    fn set_relations_are_those_of_sets() {
        let [single, pair] = [vec![1], vec![0, 1]].map(|a| FaultMode::from_actuators(&a).unwrap());
        assert!(single.is_proper_subset_of(pair) && FaultMode::FAULT_FREE.is_proper_subset_of(single));
        assert!(!pair.is_subset_of(single) && !pair.is_proper_subset_of(pair) && pair.is_subset_of(pair));
        assert_eq!(FaultMode::from_actuators(&[64]), None);
        assert_eq!(pair.other_actuators(4).collect::<Vec<_>>(), [2, 3]);
    }
}
