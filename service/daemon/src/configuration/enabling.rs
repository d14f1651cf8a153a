//! The channels of enable conditions, which are known only once the diagnoser is built.

use super::suggest::did_you_mean;
use super::{DiagnoserConfiguration, EnableConfiguration};
use crate::lifecycle::{ALL_CHANNELS, EnableCondition, Enabling};
use residual_diagnosis::diagnoser::Description;
use residual_diagnosis::method::{Designed, Refusal};

/// Refuses conditions on channels that the diagnoser does not have.
pub(super) fn channels_exist(diagnoser: &DiagnoserConfiguration, designed: &Designed) -> Result<(), Refusal> {
    let description = designed.diagnoser.description();
    for (index, condition) in diagnoser.lifecycle.enable.iter().enumerate() {
        let mut names = condition.channels.iter().flatten().enumerate();
        if let Some((place, name)) = names.find(|(_, name)| channel(description, name).is_none()) {
            let known: Vec<_> = description.channels.iter().map(|channel| &channel.name).collect();
            let help = did_you_mean(name, &known, "channels");
            return Err(Refusal {
                key: format!("lifecycle.enable.{index}.channels.{place}"),
                message: format!("it has no channel `{name}`; {help}"),
            });
        }
    }
    Ok(())
}

fn channel(description: &Description, name: &str) -> Option<usize> {
    description
        .channels
        .iter()
        .position(|channel| channel.name == name)
}

impl EnableConfiguration {
    fn resolve(&self, description: &Description) -> EnableCondition {
        let channels = match &self.channels {
            None => ALL_CHANNELS,
            Some(names) => names
                .iter()
                .filter_map(|name| channel(description, name))
                .fold(0, |set, index| set | 1 << index),
        };
        EnableCondition {
            channels,
            signal: self.signal,
            range: self.range,
        }
    }
}

impl DiagnoserConfiguration {
    /// Its enable conditions on the channels of the diagnoser with this description.
    pub fn enabling(&self, description: &Description) -> Enabling {
        let conditions = self.lifecycle.enable.iter();
        Enabling::new(
            conditions
                .map(|condition| condition.resolve(description))
                .collect(),
        )
    }
}
