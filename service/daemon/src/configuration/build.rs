//! From a configuration to its diagnosers, whose gains are found now.

use super::enabling::channels_exist;
use super::error::ConfigurationError;
use super::load::Loaded;
use super::locate::{Document, Mistakes};
use super::refusal::explain;
use super::{DiagnoserConfiguration, SignalReference};
use residual_diagnosis::gains::file::{Entry, TOLERANCE};
use residual_diagnosis::method::{Designed, Refusal};

/// The gains of all diagnosers of a configuration, and the diagnosers that run on them.
#[derive(Clone, Debug)]
pub struct Design {
    /// What a gains file says of each, in the order of the configuration.
    pub entries: Vec<Entry>,
    /// The diagnosers.
    pub diagnosers: Vec<Designed>,
}

impl Loaded {
    /// Constructs the diagnosers, in the order of the configuration: on the gains of the configured file, or, without
    /// one, on gains that are found now. This is done once, so that all diagnosers of one configuration are equal to
    /// the last bit.
    ///
    /// # Errors
    /// The conditions that do not hold, at their places in the configuration or in the gains file.
    pub fn build_diagnosers(&self) -> Result<Vec<Designed>, ConfigurationError> {
        if let Some(built) = self.built.get() {
            return Ok(built.clone());
        }
        let built = match &self.configuration.daemon.gains_file {
            Some(path) => self.on_gains_file(path)?,
            None => self.design(&mut |_, _| {})?.diagnosers,
        };
        Ok(self.built.get_or_init(|| built).clone())
    }

    /// Finds the gains of all diagnosers and constructs them; a configured gains file is not read. `progress` is
    /// called with the name of a diagnoser and what is about to be done for it.
    ///
    /// # Errors
    /// The conditions of the methods that do not hold, one a diagnoser, at their places in the text.
    pub fn design(&self, progress: &mut dyn FnMut(&str, &str)) -> Result<Design, ConfigurationError> {
        let document = Document::parse(&self.source)?;
        let mut mistakes = Mistakes::new(&document);
        let (mut entries, mut diagnosers) = (Vec::new(), Vec::new());
        for (index, diagnoser) in self.configuration.diagnosers.iter().enumerate() {
            match design_one(diagnoser, &mut |what| progress(&diagnoser.name, what)) {
                Ok((entry, designed)) => {
                    entries.push(entry);
                    diagnosers.push(designed);
                }
                Err(refusal) => refuse(&mut mistakes, index, diagnoser, &refusal),
            }
        }
        match mistakes.len() {
            0 => Ok(Design { entries, diagnosers }),
            _ => Err(mistakes.into_error()),
        }
    }
}

fn design_one(
    diagnoser: &DiagnoserConfiguration,
    progress: &mut dyn FnMut(&str),
) -> Result<(Entry, Designed), Refusal> {
    let (method, sample_time_s) = (&diagnoser.method, diagnoser.sample_time_s());
    progress("finding gains");
    let found = method.find_gains(sample_time_s, progress)?;
    progress("checking what they achieve");
    let mut designed = method.with_gains(sample_time_s, &found.gains)?;
    packets_come_from_one_input(diagnoser, &designed)?;
    channels_exist(diagnoser, &designed)?;
    let entry = Entry {
        name: diagnoser.name.clone(),
        method: method.name().to_owned(),
        sample_time_s,
        inputs: method.hash_of_inputs(sample_time_s)?,
        warnings: found.warnings.clone(),
        solver: found.solver,
        gains: found.gains,
        achieved: designed.achieved.clone(),
    };
    entry
        .verify(&designed.achieved, TOLERANCE)
        .map_err(|error| Refusal::new("method", &error))?;
    designed.warnings.extend(found.warnings);
    Ok((entry, designed))
}

/// Notes why a diagnoser of the configuration cannot be built, at the place in the configuration.
pub(super) fn refuse(
    mistakes: &mut Mistakes<'_>,
    index: usize,
    diagnoser: &DiagnoserConfiguration,
    refusal: &Refusal,
) {
    let (message, help) = explain(refusal);
    let message = format!("the diagnoser `{}` cannot be built: {message}", diagnoser.name);
    mistakes.at(&format!("diagnoser.{index}.{}", refusal.key), message, help);
}

/// A packet is one sample of one input; so what a sensor measures, and all commands, must lie in one.
pub(super) fn packets_come_from_one_input(
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
