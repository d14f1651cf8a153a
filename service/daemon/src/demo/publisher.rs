//! The publisher process of the demonstration: the aircraft's sensors and its flight controller.

use clap::Args;
use residual_shared::clock::sleep_until_monotonic;
use residual_shared::transport::{self, SamplePublisher, SendError, TransportError};

use super::Part;
use super::plant::{Aircraft, Disturbance, PERIOD_NS, STEPS};

/// What the publisher process is told.
#[derive(Clone, Debug, Args)]
pub struct PublisherArguments {
    /// Place and time.
    #[command(flatten)]
    pub part: Part,
    /// Seed of noise and random disturbances.
    #[arg(long)]
    pub seed: u64,
    /// Disturbance.
    #[arg(long, value_enum)]
    pub disturbance: Disturbance,
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
    let instance = arguments.part.instance();
    let node = transport::open_node(&instance)?;
    let mut sensors = SamplePublisher::open(&node, &instance, "aircraft_sensors")?;
    let mut commands = SamplePublisher::open(&node, &instance, "aircraft_commands")?;
    let mut aircraft = Aircraft::new(arguments.part.case, arguments.disturbance, arguments.seed);
    for k in 0..=STEPS {
        let instant_ns = arguments.part.start_ns + k * PERIOD_NS;
        sleep_until_monotonic(instant_ns);
        sensors.send(instant_ns, &aircraft.measure())?;
        commands.send(instant_ns, &aircraft.command())?;
        if aircraft.advance() {
            println!(
                "         --- the publisher injects the fault: case {}, from k = {k} on ---",
                arguments.part.case
            );
        }
    }
    Ok(())
}
