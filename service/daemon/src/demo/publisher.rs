//! The publisher process of the demonstration: the sensors and controllers of all plants.

use std::collections::HashMap;

use clap::Args;
use residual_shared::bounds_table::{OpenError, TableReader};
use residual_shared::clock::sleep_until_monotonic;
use residual_shared::transport::{self, SamplePublisher, SendError, TransportError};

use super::Part;
use super::plants::Merged;
use super::scenario::{Scenario, Variation};

/// What the publisher process is told.
#[derive(Clone, Debug, Args)]
pub struct PublisherArguments {
    /// Place and time.
    #[command(flatten)]
    pub part: Part,
    /// Seed and disturbance.
    #[command(flatten)]
    pub variation: Variation,
}

/// Why publishing failed.
#[derive(Debug, thiserror::Error)]
pub enum PublisherError {
    /// There is no bounds table, which tells the daemon's time.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// iceoryx2 refused.
    #[error(transparent)]
    Transport(#[from] TransportError),
    /// A sample could not be sent.
    #[error(transparent)]
    Send(#[from] SendError),
}

/// Publishes what the plants of the scenarios say, each emission at its time; lost ones only use up their number.
pub fn execute(arguments: &PublisherArguments) -> Result<(), PublisherError> {
    let part = &arguments.part;
    let instance = part.instance();
    let time = TableReader::open(&instance.bounds_path())?.directory().spec.time;
    let node = transport::open_node(&instance)?;
    let mut publishers: HashMap<&str, SamplePublisher> = HashMap::new();
    let scenarios = part
        .scenarios
        .iter()
        .filter_map(|name| super::scenario::named(name));
    let plants = scenarios.flat_map(|scenario: &Scenario| (scenario.plants)(&arguments.variation));
    for emission in Merged::new(plants.collect()) {
        let publisher = match publishers.entry(emission.input) {
            std::collections::hash_map::Entry::Occupied(entry) => entry.into_mut(),
            std::collections::hash_map::Entry::Vacant(entry) => {
                entry.insert(SamplePublisher::open(&node, &instance, emission.input)?)
            }
        };
        let instant_ns = part.start_ns + emission.time_ns;
        sleep_until_monotonic(time.to_monotonic(instant_ns));
        match emission.elements {
            Some(elements) => publisher.send(instant_ns, &elements)?,
            None => publisher.skip(),
        }
        if let Some(event) = emission.event {
            println!(
                "         --- t = {:.2} s: {event} ---",
                emission.time_ns as f64 * 1e-9
            );
        }
    }
    Ok(())
}
