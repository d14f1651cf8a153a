//! From the tables of a diagnoser in a configuration to the diagnoser: what every method offers.

use crate::diagnoser::Diagnoser;
use serde::{Serialize, de::DeserializeOwned};
use std::fmt::Debug;

/// What a method reads from a diagnoser's table; its serde fields are the method's keys.
pub trait MethodOptions: Serialize + DeserializeOwned + Clone + PartialEq + Debug {
    /// The method's name, as written in the configuration.
    const METHOD: &'static str;

    /// How many measurements and commands the tables speak of.
    fn signal_counts(&self) -> (usize, usize);

    /// Fills in names and units of measurements and commands, (name, unit), where the tables state none.
    fn name_signals(&mut self, measurements: &[(String, String)], commands: &[(String, String)]);

    /// Checks all that needs no design: shapes, ranges, definiteness, rank, stability.
    ///
    /// # Errors
    /// The first condition that does not hold.
    fn validate(&self, sample_time_s: f64) -> Result<(), Refusal>;

    /// Does the off-line design and constructs the diagnoser.
    ///
    /// # Errors
    /// The first condition that does not hold.
    fn design(&self, sample_time_s: f64) -> Result<Designed, Refusal>;
}

/// Why a method cannot run as configured.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{key}: {message}")]
pub struct Refusal {
    /// Dotted path, inside the diagnoser's table, of the entry to look at.
    pub key: String,
    /// "What is wrong; what to do".
    pub message: String,
}

/// A diagnoser before its first step, and what its design found.
pub struct Designed {
    /// The diagnoser.
    pub diagnoser: Box<dyn Diagnoser>,
    /// What the design found, for people: name and value.
    pub notes: Vec<(&'static str, String)>,
    /// What is accepted but deserves a second look.
    pub warnings: Vec<String>,
}

impl Clone for Designed {
    fn clone(&self) -> Self {
        Self {
            diagnoser: self.diagnoser.boxed_clone(),
            notes: self.notes.clone(),
            warnings: self.warnings.clone(),
        }
    }
}
