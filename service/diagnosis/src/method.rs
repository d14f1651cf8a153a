//! From the tables of a diagnoser in a configuration to the diagnoser: what every method offers.

use crate::diagnoser::Diagnoser;
use crate::tables::TableError;
use serde::{Serialize, de::DeserializeOwned};
use std::fmt::{self, Debug};

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

impl Refusal {
    /// The refusal of the entry at `key` for the reason of an error.
    pub fn new(key: impl Into<String>, error: &dyn fmt::Display) -> Self {
        Self {
            key: key.into(),
            message: error.to_string(),
        }
    }
}

impl From<TableError> for Refusal {
    fn from(error: TableError) -> Self {
        Self::new(error.key(), &error)
    }
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

impl Debug for Designed {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter
            .debug_struct("Designed")
            .field("diagnoser", self.diagnoser.description())
            .field("notes", &self.notes)
            .field("warnings", &self.warnings)
            .finish()
    }
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
