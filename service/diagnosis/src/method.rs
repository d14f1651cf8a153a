//! From the tables of a diagnoser in a configuration to the diagnoser: what every method offers.

use crate::achieved::Achieved;
use crate::diagnoser::Diagnoser;
use crate::gains::FoundGains;
use crate::response::Response;
use crate::tables::TableError;
use serde::{Serialize, de::DeserializeOwned};
use std::fmt::{self, Debug};

/// What a method reads from a diagnoser's table; its serde fields are the method's keys.
pub trait MethodOptions: Serialize + DeserializeOwned + Clone + PartialEq + Debug {
    /// The method's name, as written in the configuration.
    const METHOD: &'static str;

    /// The numbers that a synthesis finds and the diagnoser runs on; they stand in the gains file.
    type Gains: Serialize + DeserializeOwned + Clone + PartialEq + Debug;

    /// How many measurements and commands the tables speak of.
    fn signal_counts(&self) -> (usize, usize);

    /// Fills in names and units of measurements and commands, (name, unit), where the tables state none.
    fn name_signals(&mut self, measurements: &[(String, String)], commands: &[(String, String)]);

    /// Checks all that needs no design: shapes, ranges, definiteness, rank, stability.
    ///
    /// # Errors
    /// The first condition that does not hold.
    fn validate(&self, sample_time_s: f64) -> Result<(), Refusal>;

    /// Why the gains cannot be found by closed forms and Riccati equations alone; `None` if they can.
    fn needs_solver(&self) -> Option<Refusal> {
        None
    }

    /// Finds the gains as far as no solver is needed: closed forms, Riccati equations, given numbers.
    ///
    /// # Errors
    /// The first condition that does not hold.
    fn find_gains(&self, sample_time_s: f64) -> Result<FoundGains<Self::Gains>, Refusal>;

    /// Constructs the diagnoser that runs on these gains and recomputes what they achieve.
    ///
    /// # Errors
    /// The first condition that does not hold.
    fn with_gains(&self, sample_time_s: f64, gains: &Self::Gains) -> Result<Designed, Refusal>;

    /// How residuals answer to disturbances and faults at each frequency, for methods whose residuals come from a
    /// time-invariant filter; otherwise empty.
    ///
    /// # Errors
    /// The first condition that does not hold.
    fn responses(&self, _sample_time_s: f64, _gains: &Self::Gains) -> Result<Vec<Response>, Refusal> {
        Ok(Vec::new())
    }

    /// Finds the gains without a solver and constructs the diagnoser.
    ///
    /// # Errors
    /// The first condition that does not hold.
    fn design(&self, sample_time_s: f64) -> Result<Designed, Refusal> {
        let found = self.find_gains(sample_time_s)?;
        let mut designed = self.with_gains(sample_time_s, &found.gains)?;
        designed.warnings.extend(found.warnings);
        Ok(designed)
    }
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
    /// What the gains achieve.
    pub achieved: Achieved,
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
            .field("achieved", &self.achieved)
            .field("notes", &self.notes)
            .field("warnings", &self.warnings)
            .finish()
    }
}

impl Clone for Designed {
    fn clone(&self) -> Self {
        Self {
            diagnoser: self.diagnoser.boxed_clone(),
            achieved: self.achieved.clone(),
            notes: self.notes.clone(),
            warnings: self.warnings.clone(),
        }
    }
}
