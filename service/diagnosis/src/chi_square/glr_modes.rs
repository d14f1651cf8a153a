//! The faults that the likelihood ratio looks for (method sheet 4, step 9).

use serde::{Deserialize, Serialize};

/// How a fault grows from its onset θ on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum FaultProfile {
    /// 1 from θ on.
    Step,
    /// k - θ + 1.
    Ramp,
}

impl FaultProfile {
    /// The amplitude of a fault of unit size at the age k - θ.
    pub fn amplitude(self, age: u64) -> f64 {
        match self {
            Self::Step => 1.0,
            Self::Ramp => age as f64 + 1.0,
        }
    }
}

/// One fault mode: a profile on one component.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FaultMode {
    /// The component: sensors 0 .. m-1, then process faults.
    pub component: usize,
    /// How it grows.
    pub profile: FaultProfile,
}

/// The modes in order: steps of the sensors, ramps of the sensors, steps of the process faults, their ramps.
pub(super) fn modes(
    sensors: &[FaultProfile],
    measurements: usize,
    process: &[FaultProfile],
    faults: usize,
) -> Vec<FaultMode> {
    let list = |profiles: &[FaultProfile], components: std::ops::Range<usize>| {
        let profiles: Vec<FaultProfile> = [FaultProfile::Step, FaultProfile::Ramp]
            .into_iter()
            .filter(|profile| profiles.contains(profile))
            .collect();
        profiles.into_iter().flat_map(move |profile| {
            components
                .clone()
                .map(move |component| FaultMode { component, profile })
        })
    };
    list(sensors, 0..measurements)
        .chain(list(process, measurements..measurements + faults))
        .collect()
}
