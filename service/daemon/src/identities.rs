//! What tells the diagnosers and inputs of two configurations apart: whether one can go on as the other.

use residual_diagnosis::method::Designed;
use xxhash_rust::xxh3::xxh3_64;

use crate::configuration::{Configuration, DiagnoserConfiguration, SignalReference};
use crate::runtime::checkpoint::Identity;
use crate::runtime::take_over::Correspondence;

/// The inputs and diagnosers of a configuration.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Identities {
    /// `[[input]]`, in order.
    pub inputs: Vec<Identity>,
    /// `[[diagnoser]]`, in order.
    pub diagnosers: Vec<Identity>,
    /// Period and phase of each diagnoser, nanoseconds.
    grids: Vec<(u64, u64)>,
}

impl Identities {
    /// The identities of a configuration and its diagnosers, none of which has done a step.
    pub fn of(configuration: &Configuration, diagnosers: &[Designed]) -> Self {
        let inputs: Vec<Identity> = configuration
            .inputs
            .iter()
            .map(|input| Identity {
                name: input.name.clone(),
                fingerprint: fingerprint(&input),
            })
            .collect();
        Self {
            diagnosers: configuration
                .diagnosers
                .iter()
                .zip(diagnosers)
                .map(|(configured, designed)| Identity {
                    name: configured.name.clone(),
                    fingerprint: fingerprint_of_diagnoser(configured, designed, &inputs),
                })
                .collect(),
            grids: configuration
                .diagnosers
                .iter()
                .map(|configured| (configured.period_ns, configured.phase_ns))
                .collect(),
            inputs,
        }
    }

    /// What of these is the same in an older configuration.
    pub fn correspondence(&self, old: &Self) -> Correspondence {
        let same = |new: &[Identity], old: &[Identity]| -> Vec<Option<usize>> {
            let place = |new| old.iter().position(|old| old == new);
            new.iter().map(place).collect()
        };
        let named: Vec<Option<usize>> = (self.diagnosers.iter())
            .map(|new| old.diagnosers.iter().position(|old| old.name == new.name))
            .collect();
        let on_same_grid = |(place, grid): (&Option<usize>, &(u64, u64))| {
            place.filter(|place| old.grids.get(*place) == Some(grid))
        };
        Correspondence {
            inputs: same(&self.inputs, &old.inputs),
            kept: same(&self.diagnosers, &old.diagnosers),
            replaced: named.iter().zip(&self.grids).map(on_same_grid).collect(),
            named,
        }
    }
}

/// Hash of all that a diagnoser does depends on: its keys, its signals and their inputs, its gains and what they
/// achieve.
fn fingerprint_of_diagnoser(
    configured: &DiagnoserConfiguration,
    designed: &Designed,
    inputs: &[Identity],
) -> u64 {
    // Inputs are numbered in the order of the file, which means nothing.
    let signals = |references: &[SignalReference]| -> Vec<(Option<&Identity>, usize)> {
        let signal = |reference: &SignalReference| (inputs.get(reference.input), reference.element);
        references.iter().map(signal).collect()
    };
    let enabling: Vec<SignalReference> = (configured.lifecycle.enable.iter())
        .map(|condition| condition.signal)
        .collect();
    let mut keys = DiagnoserConfiguration {
        measurements: Vec::new(),
        commands: Vec::new(),
        ..configured.clone()
    };
    for condition in &mut keys.lifecycle.enable {
        condition.signal = SignalReference { input: 0, element: 0 };
    }
    let mut state = Vec::new();
    designed.diagnoser.save(&mut state);
    fingerprint(&(
        keys,
        signals(&configured.measurements),
        signals(&configured.commands),
        signals(&enabling),
        state,
        &designed.achieved,
    ))
}

/// Hash of a value as it is written for people, in which every number has all of its digits.
fn fingerprint(value: &impl std::fmt::Debug) -> u64 {
    xxh3_64(format!("{value:?}").as_bytes())
}
