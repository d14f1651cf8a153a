//! The configuration in force, and the time that it runs in.

use residual_diagnosis::method::Designed;
use residual_shared::clock::DaemonTime;

use crate::configuration::Configuration;
use crate::identities::Identities;

/// A configuration in force.
#[derive(Debug)]
pub struct Running {
    /// The configuration.
    pub configuration: Configuration,
    /// Its inputs and diagnosers.
    pub identities: Identities,
}

impl Running {
    /// A configuration and its diagnosers, none of which has done a step.
    pub fn new(configuration: Configuration, diagnosers: &[Designed]) -> Self {
        Self {
            identities: Identities::of(&configuration, diagnosers),
            configuration,
        }
    }
}

/// What stays as it is for a whole life of the daemon, over every reload.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// The daemon's time.
    pub time: DaemonTime,
    /// Epoch of the sampling instants, nanoseconds of the daemon's time.
    pub epoch_ns: u64,
}
