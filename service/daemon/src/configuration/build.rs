//! From a configuration to its diagnosers.

use super::error::ConfigurationError;
use super::load::Loaded;
use super::locate::{Document, Mistakes};
use super::refusal::explain;
use super::{DiagnoserConfiguration, SignalReference};
use residual_diagnosis::method::{Designed, Refusal};

impl Loaded {
    /// Constructs the diagnosers, in the order of the configuration. Their off-line design is done the first time
    /// and kept, so that all diagnosers of one configuration are equal to the last bit.
    ///
    /// # Errors
    /// The conditions of the methods that do not hold, one a diagnoser, at their places in the text.
    pub fn build_diagnosers(&self) -> Result<Vec<Designed>, ConfigurationError> {
        let diagnosers = &self.configuration.diagnosers;
        let designs = self.designs.get_or_init(|| {
            diagnosers
                .iter()
                .map(|diagnoser| {
                    let designed = diagnoser.method.design(diagnoser.sample_time_s())?;
                    packets_come_from_one_input(diagnoser, &designed)?;
                    Ok(designed)
                })
                .collect()
        });
        if designs.iter().all(Result::is_ok) {
            return Ok(designs.iter().flatten().cloned().collect());
        }
        let document = Document::parse(&self.source)?;
        let mut mistakes = Mistakes::new(&document);
        for (index, (diagnoser, design)) in diagnosers.iter().zip(designs).enumerate() {
            if let Err(refusal) = design {
                let (message, help) = explain(refusal);
                let message = format!("the diagnoser `{}` cannot be built: {message}", diagnoser.name);
                mistakes.at(&format!("diagnoser.{index}.{}", refusal.key), message, help);
            }
        }
        Err(mistakes.into_error())
    }
}

/// A packet is one sample of one input; so what a sensor measures, and all commands, must lie in one.
fn packets_come_from_one_input(
    diagnoser: &DiagnoserConfiguration,
    designed: &Designed,
) -> Result<(), Refusal> {
    let Some(rules) = &designed.diagnoser.description().packets else {
        return Ok(());
    };
    let stranger = |signals: &[SignalReference]| {
        let first = signals.first()?.input;
        signals.iter().position(|signal| signal.input != first)
    };
    let mut begin = 0;
    for (sensor, rows) in rules.sensor_rows.iter().enumerate() {
        let end = (begin + rows).min(diagnoser.measurements.len());
        if let Some(place) = stranger(&diagnoser.measurements[begin..end]) {
            return Err(Refusal {
                key: format!("measurements.{}", begin + place),
                message: format!(
                    "the signals of sensor {} come from several inputs; a sensor's sample is one packet, so take all \
                     its signals from one input or make two sensors of it",
                    sensor + 1
                ),
            });
        }
        begin = end;
    }
    match stranger(&diagnoser.commands) {
        Some(place) => Err(Refusal {
            key: format!("commands.{place}"),
            message: "the commands come from several inputs; this method takes them as one packet, so publish them \
                      together"
                .to_owned(),
        }),
        None => Ok(()),
    }
}
