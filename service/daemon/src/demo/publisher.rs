//! The publisher process of the demonstration: the aircraft's sensors and its flight controller.

use clap::Args;
use residual_shared::clock::sleep_until_monotonic;
use residual_shared::names::{Instance, InstanceName};
use residual_shared::transport::{self, SamplePublisher, SendError, TransportError};
use std::path::PathBuf;

use super::plant::{Aircraft, Disturbance, PERIOD_NS, STEPS};

/// What the publisher process is told.
#[derive(Clone, Debug, Args)]
pub struct PublisherArguments {
    /// Instance to publish for.
    #[arg(long)]
    pub instance: InstanceName,
    /// Runtime directory of the instance.
    #[arg(long)]
    pub runtime_directory: PathBuf,
    /// Which actuator fails: 1 or 2.
    #[arg(long)]
    pub case: u8,
    /// Seed of noise and random disturbances.
    #[arg(long)]
    pub seed: u64,
    /// Disturbance.
    #[arg(long, value_enum)]
    pub disturbance: Disturbance,
    /// Moment of the measurement y_0, CLOCK_MONOTONIC nanoseconds.
    #[arg(long)]
    pub start_ns: u64,
}

/// Why publishing failed.
#[derive(Debug, thiserror::Error)]
pub enum PublisherError {
    /// iceoryx2 refused.
    #[error(transparent)]
    Transport(#[from] TransportError),
    /// A sample could not be sent.
    #[error(transparent)]
    Send(#[from] SendError),
}

/// Publishes y_k and u_k of one case at start + k · 10 ms.
pub fn execute(arguments: &PublisherArguments) -> Result<(), PublisherError> {
    let instance = Instance::new(arguments.instance.clone(), &arguments.runtime_directory);
    let node = transport::open_node(&instance)?;
    let mut sensors = SamplePublisher::open(&node, &instance, "aircraft_sensors")?;
    let mut commands = SamplePublisher::open(&node, &instance, "aircraft_commands")?;
    let mut aircraft = Aircraft::new(arguments.case, arguments.disturbance, arguments.seed);
    for k in 0..=STEPS {
        let instant_ns = arguments.start_ns + k * PERIOD_NS;
        sleep_until_monotonic(instant_ns);
        sensors.send(instant_ns, &aircraft.measure())?;
        commands.send(instant_ns, &aircraft.command())?;
        if aircraft.advance() {
            println!(
                "         --- the publisher injects the fault: case {}, from k = {k} on ---",
                arguments.case
            );
        }
    }
    Ok(())
}
