//! What the daemon says of its diagnosers when a client asks.

use residual_diagnosis::method::Designed;
use residual_shared::control::{ChannelDescription, DiagnoserDescription};

use super::achieved::summary;
use super::lifecycle::lifecycle;
use crate::configuration::{Configuration, DiagnoserConfiguration, InputConfiguration, SignalReference};

/// All that stays constant over the life of each diagnoser, by slot.
pub(crate) fn descriptions(
    configuration: &Configuration,
    diagnosers: &[Designed],
) -> Vec<DiagnoserDescription> {
    let gains = match &configuration.daemon.gains_file {
        Some(path) => format!("from {}, verified", path.display()),
        None => "found at the start".to_owned(),
    };
    let slots = configuration.diagnosers.iter().zip(diagnosers).zip(0..);
    slots
        .map(|((diagnoser, built), slot)| DiagnoserDescription {
            slot,
            gains: gains.clone(),
            ..description(diagnoser, built, &configuration.inputs)
        })
        .collect()
}

fn description(
    diagnoser: &DiagnoserConfiguration,
    built: &Designed,
    inputs: &[InputConfiguration],
) -> DiagnoserDescription {
    let description = built.diagnoser.description();
    let notes = built.notes.iter().cloned();
    let owned = |(name, value): (&str, String)| (name.to_owned(), value);
    DiagnoserDescription {
        name: diagnoser.name.clone(),
        method: description.method.into(),
        period_ns: diagnoser.period_ns,
        phase_ns: diagnoser.phase_ns,
        margin_ns: diagnoser.margin_ns,
        priority: diagnoser.priority,
        measurements: signals(&diagnoser.measurements, inputs),
        commands: signals(&diagnoser.commands, inputs),
        command_delay_steps: u32::try_from(diagnoser.command_delay_steps).unwrap_or(u32::MAX),
        channels: description
            .channels
            .iter()
            .map(|channel| ChannelDescription {
                name: channel.name.clone(),
                unit: channel.unit.clone(),
            })
            .collect(),
        faults: description.faults.clone(),
        lifecycle: lifecycle(diagnoser, &built.achieved, inputs)
            .into_iter()
            .map(owned)
            .collect(),
        certificate: notes.chain(summary(&built.achieved)).map(owned).collect(),
        warnings: built.warnings.clone(),
        ..DiagnoserDescription::default()
    }
}

/// Signals as INPUT.SIGNAL.
pub(super) fn signals(references: &[SignalReference], inputs: &[InputConfiguration]) -> Vec<String> {
    let name = |reference: &SignalReference| {
        let input = &inputs[reference.input];
        format!("{}.{}", input.name, input.signals[reference.element])
    };
    references.iter().map(name).collect()
}
