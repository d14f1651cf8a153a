//! One configuration out of several: the inputs and diagnosers of all of them in one daemon.

use residual_diagnosis::gains::error::GainsError;
use residual_diagnosis::gains::file::GainsFile;
use residual_shared::names::InstanceName;
use std::path::Path;
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
    /// Gains cannot be read or written.
    #[error(transparent)]
    Gains(#[from] GainsError),
    /// There is nothing to compose.
    #[error("there is no configuration to compose")]
    Nothing,
}

/// A configuration and its gains file, as texts.
#[derive(Clone, Copy, Debug)]
pub struct Example {
    /// The configuration: the same file that users start from.
    pub configuration: &'static str,
    /// What `residuald design` has made of it.
    pub gains: &'static str,
}

/// One configuration with one gains file, as texts.
#[derive(Clone, Debug)]
pub struct Composed {
    /// The configuration.
    pub configuration: String,
    /// Its gains file.
    pub gains: String,
}

/// The first configuration under another instance name, with the inputs and diagnosers of the others added.
/// Equal inputs are one. The gains of all of them belong into the file at `gains_file`.
///
/// # Errors
/// [`CompositionError`].
pub fn compose(
    examples: &[Example],
    instance: &InstanceName,
    gains_file: &Path,
) -> Result<Composed, CompositionError> {
    let mut composed = Table::new();
    for example in examples {
        for (section, value) in example.configuration.parse::<Table>()? {
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
        let gains_file = gains_file.display().to_string();
        daemon.insert("gains_file".to_owned(), Value::String(gains_file));
    }
    Ok(Composed {
        configuration: toml::to_string(&composed)?,
        gains: compose_gains(examples)?,
    })
}

/// The entries of all gains files in one; equal entries are one.
fn compose_gains(examples: &[Example]) -> Result<String, CompositionError> {
    let mut composed: Option<GainsFile> = None;
    for example in examples {
        let file = GainsFile::parse(example.gains)?;
        match &mut composed {
            None => composed = Some(file),
            Some(composed) => {
                for entry in file.diagnoser {
                    if !composed.diagnoser.contains(&entry) {
                        composed.diagnoser.push(entry);
                    }
                }
            }
        }
    }
    let composed = composed.ok_or(CompositionError::Nothing)?;
    Ok(composed.to_text("residuald demo")?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::configuration::Configuration;
    use crate::demo::example;

    #[test]
    fn inputs_and_diagnosers_of_all_configurations_come_together_under_the_new_name() {
        let first = example!("vtol");
        let second = example!("f1tenth");
        let both = "both".parse().unwrap();
        let composed = compose(&[first, second, first], &both, Path::new("both.gains.toml")).unwrap();
        let loaded = Configuration::from_text("composed", &composed.configuration).unwrap();
        let diagnosers = loaded.on_gains("both.gains.toml", &composed.gains).unwrap();
        assert_eq!(diagnosers.len(), 2);
        let configuration = loaded.configuration;
        assert_eq!(configuration.daemon.gains_file, Some("both.gains.toml".into()));
        assert_eq!(configuration.daemon.instance.to_string(), "both");
        let names: Vec<_> = configuration.diagnosers.iter().map(|d| d.name.as_str()).collect();
        assert_eq!(names, ["aircraft_actuators", "car_actuators"]);
        assert_eq!(configuration.inputs.len(), 4);
        assert!(configuration.replay.is_none());
    }
}
