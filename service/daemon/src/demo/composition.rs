//! One configuration out of several: the inputs and diagnosers of all of them in one daemon.

use residual_shared::names::InstanceName;
use toml::{Table, Value};

/// The sections that may occur several times and are collected.
const COLLECTED: [&str; 2] = ["input", "diagnoser"];

/// Why the configurations do not make one.
#[derive(Debug, thiserror::Error)]
pub enum CompositionError {
    /// A configuration is not TOML.
    #[error("an embedded configuration cannot be read: {0}")]
    Read(#[from] toml::de::Error),
    /// The result cannot be written.
    #[error("the configuration cannot be written: {0}")]
    Write(#[from] toml::ser::Error),
}

/// The first configuration under another instance name, with the inputs and diagnosers of the others added.
/// Equal inputs are one.
pub fn compose(configurations: &[&str], instance: &InstanceName) -> Result<String, CompositionError> {
    let mut composed = Table::new();
    for text in configurations {
        for (section, value) in text.parse::<Table>()? {
            let collected = COLLECTED.contains(&section.as_str());
            match (composed.get_mut(&section), value) {
                (Some(Value::Array(there)), Value::Array(more)) if collected => {
                    for entry in more {
                        if !there.contains(&entry) {
                            there.push(entry);
                        }
                    }
                }
                (Some(_), _) => {}
                (None, value) => {
                    composed.insert(section, value);
                }
            }
        }
    }
    composed.remove("replay");
    if let Some(Value::Table(daemon)) = composed.get_mut("daemon") {
        daemon.insert("instance".to_owned(), Value::String(instance.to_string()));
    }
    Ok(toml::to_string(&composed)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::configuration::Configuration;

    #[test]
    fn inputs_and_diagnosers_of_all_configurations_come_together_under_the_new_name() {
        let first = include_str!("../../../../deploy/config/vtol.toml");
        let second = include_str!("../../../../deploy/config/f1tenth.toml");
        let text = compose(&[first, second, first], &"both".parse().unwrap()).unwrap();
        let configuration = Configuration::from_text("composed", &text).unwrap().configuration;
        assert_eq!(configuration.daemon.instance.to_string(), "both");
        let names: Vec<_> = configuration.diagnosers.iter().map(|d| d.name.as_str()).collect();
        assert_eq!(names, ["aircraft_actuators", "car_actuators"]);
        assert_eq!(configuration.inputs.len(), 4);
        assert!(configuration.replay.is_none());
    }
}
