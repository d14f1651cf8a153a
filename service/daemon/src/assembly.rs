//! From a configuration to the parts of a running monitor.

use residual_diagnosis::diagnoser::Description;
use residual_shared::bounds_table::{ChannelSpec, InputSpec, SlotSpec, TableSpec};
use residual_shared::clock::DaemonTime;

use crate::configuration::{Configuration, DiagnoserConfiguration};
use crate::runtime::companion::{Identity, Introduction, LogNames};
use crate::runtime::engine::{Engine, InboxOptions};
use crate::runtime::schedule::Timing;
use crate::runtime::unit::DiagnoserUnit;
use residual_diagnosis::method::Designed;

/// What each diagnoser says in its records, by slot.
pub fn descriptions(diagnosers: &[Designed]) -> Vec<Description> {
    diagnosers
        .iter()
        .map(|built| built.diagnoser.description().clone())
        .collect()
}

/// Builds the engine: `diagnosers` in the order of the configuration, sampling instants counted from
/// `epoch_ns`, transport allowances stretched with the daemon's `speed` so that they last as long as
/// configured.
pub fn assemble(
    configuration: &Configuration,
    diagnosers: Vec<Designed>,
    epoch_ns: u64,
    speed: f64,
) -> Engine {
    let inputs: Vec<InboxOptions> = configuration
        .inputs
        .iter()
        .map(|input| InboxOptions {
            signal_count: input.signals.len(),
            buffer_samples: input.buffer_samples,
            max_ahead_ns: input.max_ahead_ns,
        })
        .collect();
    let units = configuration
        .diagnosers
        .iter()
        .zip(diagnosers)
        .map(|(configured, built)| DiagnoserUnit {
            rules: configured.lifecycle.rules,
            enabling: configured.enabling(built.diagnoser.description()),
            diagnoser: built.diagnoser,
            timing: timing(configured, speed),
            measurements: configured.measurements.clone(),
            commands: configured.commands.clone(),
            command_delay_steps: configured.command_delay_steps,
        })
        .collect();
    Engine::new(epoch_ns, configuration.daemon.catch_up_limit, &inputs, units)
}

fn timing(configured: &DiagnoserConfiguration, speed: f64) -> Timing {
    Timing {
        period_ns: configured.period_ns,
        phase_ns: configured.phase_ns,
        margin_ns: (configured.margin_ns as f64 * speed) as u64,
        priority: configured.priority,
    }
}

/// What the header and directory of the bounds table say.
pub fn table_spec(
    configuration: &Configuration,
    descriptions: &[Description],
    time: DaemonTime,
    epoch_ns: u64,
) -> TableSpec {
    TableSpec {
        instance: configuration.daemon.instance.to_string(),
        slots: configuration
            .diagnosers
            .iter()
            .zip(descriptions)
            .map(|(configured, description)| slot_spec(configured, description))
            .collect(),
        inputs: configuration
            .inputs
            .iter()
            .map(|input| InputSpec {
                name: input.name.clone(),
                signals: input.signals.clone(),
            })
            .collect(),
        time,
        schedule_epoch_ns: epoch_ns,
        stale_after_periods: configuration.daemon.stale_after_periods,
        alarm_capacity: configuration.daemon.alarm_capacity,
    }
}

fn slot_spec(configured: &DiagnoserConfiguration, description: &Description) -> SlotSpec {
    SlotSpec {
        name: configured.name.clone(),
        method: description.method.into(),
        period_ns: configured.period_ns,
        phase_ns: configured.phase_ns,
        margin_ns: configured.margin_ns,
        channels: description
            .channels
            .iter()
            .map(|channel| ChannelSpec {
                name: channel.name.clone(),
                unit: channel.unit.clone(),
            })
            .collect(),
        faults: description.faults.clone(),
    }
}

/// What the companion has to know.
pub fn introduction(configuration: &Configuration, diagnosers: &[Designed]) -> Introduction {
    let slots = configuration.diagnosers.iter().zip(diagnosers);
    Introduction {
        names: log_names(configuration),
        identity: Identity {
            program: env!("CARGO_PKG_VERSION").into(),
            diagnosers: crate::commands::descriptions::descriptions(configuration, diagnosers),
            identities: slots
                .map(|(configured, built)| slot_spec(configured, built.diagnoser.description()).identity())
                .collect(),
        },
    }
}

/// Names for the log.
fn log_names(configuration: &Configuration) -> LogNames {
    LogNames {
        diagnosers: configuration
            .diagnosers
            .iter()
            .map(|configured| configured.name.clone())
            .collect(),
        inputs: configuration
            .inputs
            .iter()
            .map(|input| input.name.clone())
            .collect(),
    }
}
