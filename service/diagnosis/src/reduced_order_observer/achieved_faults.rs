//! Which constant faults are certain to be seen and isolated, how large and how soon (method sheet 3.6, 3.9).
//!
//! A fault alarms for certain from 2 (t_inf + rounding tolerance) / |w'g_j(k)| on, in the row w of any observer that
//! sees it best; with `alarm_samples` > 1 at that many instants in a row. It is isolated when the members of all other
//! actuators have alarmed.

use super::{
    achieved::observers,
    channels::{entry, fault_names},
    design::Design,
    floors::{certain_sizes, confirmed_sizes},
    observer_design::ObserverDesign,
};
use crate::achieved::{Delay, FaultSensitivity, Need, Separation};

/// Samples after the onset of a fault that the delay curve states.
const DELAYS: [usize; 10] = [1, 2, 3, 5, 10, 20, 30, 50, 100, 200];

/// The faults of a design.
pub(super) struct Faults<'a> {
    design: &'a Design,
    names: Vec<String>,
    consecutive: usize,
}

impl<'a> Faults<'a> {
    /// The faults of all actuators.
    pub fn new(design: &'a Design) -> Self {
        Self {
            design,
            names: fault_names(&design.options.model, design.plant.actuators()),
            consecutive: usize::try_from(design.options.bounds.alarm_samples).unwrap_or(usize::MAX),
        }
    }

    /// What is certain to be seen of each, as far as 200 samples show it.
    pub fn sensitivities(&self, sample_time_s: f64) -> Vec<FaultSensitivity> {
        let names = self.names.iter().enumerate();
        names
            .map(|(actuator, name)| {
                let detected = confirmed_sizes(&self.sizes_of_all(actuator), self.consecutive);
                let delays = DELAYS.iter().filter_map(|&k| {
                    let size = detected.get(k).copied()?;
                    let within_s = k as f64 * sample_time_s;
                    Some(Delay { within_s, size })
                });
                FaultSensitivity {
                    fault: name.clone(),
                    unit: entry(&self.design.options.model.actuator_units, actuator).to_owned(),
                    assurance: 1.0,
                    provided_that: String::new(),
                    detectable: smallest(&detected),
                    isolable: self.isolable(actuator, &detected),
                    delays: Delay::worth_stating(delays),
                }
            })
            .collect()
    }

    /// How soon each fault can be told from each other one; nothing where nobody isolates.
    pub fn separations(&self) -> Vec<Separation> {
        if !self.design.options.isolation.enabled {
            return Vec::new();
        }
        let count = self.names.len();
        let pairs = (0..count).flat_map(|there| (0..count).map(move |from| (there, from)));
        pairs
            .filter(|(there, from)| there != from)
            .map(|(there, from)| {
                let confirmed = self
                    .member(from)
                    .map(|member| confirmed_sizes(&self.sizes(member, there), self.consecutive));
                let first = confirmed.and_then(|sizes| sizes.iter().position(|size| size.is_finite()));
                Separation {
                    fault: self.names[there].clone(),
                    from: self.names[from].clone(),
                    instants: first.and_then(|k| u64::try_from(k).ok()),
                    need: Need::Instants,
                }
            })
            .collect()
    }

    /// The size from which every other actuator is exonerated; `None` if one of them has no member.
    fn isolable(&self, actuator: usize, detected: &[f64]) -> Option<f64> {
        if !self.design.options.isolation.enabled {
            return None;
        }
        let mut needed = smallest(detected)?;
        for other in (0..self.names.len()).filter(|other| *other != actuator) {
            let sizes = confirmed_sizes(&self.sizes(self.member(other)?, actuator), self.consecutive);
            needed = needed.max(smallest(&sizes)?);
        }
        Some(needed)
    }

    fn member(&self, actuator: usize) -> Option<&ObserverDesign> {
        let mut members = self.design.isolation.members.iter();
        members.find(|member| member.actuator == Some(actuator))
    }

    fn sizes(&self, observer: &ObserverDesign, actuator: usize) -> Vec<f64> {
        let steady = observer
            .steady()
            .add_scalar(self.design.options.bounds.rounding_tolerance);
        certain_sizes(&observer.observer, &observer.tests, &steady, actuator)
    }

    /// The sizes certain to alarm in any observer.
    fn sizes_of_all(&self, actuator: usize) -> Vec<f64> {
        let mut best = Vec::new();
        for (_, observer) in observers(self.design) {
            let sizes = self.sizes(observer, actuator);
            best.resize(sizes.len(), f64::INFINITY);
            best.iter_mut()
                .zip(sizes)
                .for_each(|(best, size): (&mut f64, f64)| *best = best.min(size));
        }
        best
    }
}

/// The last of falling sizes, unless it is infinite.
fn smallest(sizes: &[f64]) -> Option<f64> {
    sizes.last().copied().filter(|size| size.is_finite())
}
