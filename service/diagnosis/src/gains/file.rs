//! The gains file: TOML, every number with all its digits.

use super::compare::first_difference;
use super::{FoundGains, SolverRun};
use crate::achieved::Achieved;
use crate::method::MethodOptions;
use serde::{Deserialize, Serialize};
use toml::{Table, Value};
use xxhash_rust::xxh3::xxh3_64;

/// Version of the form of the file.
pub const VERSION: u32 = 1;
/// How far a stated number may lie from the recomputed one, relative to the larger.
pub const TOLERANCE: f64 = 1e-6;
/// A file may ask for no more than this.
const LARGEST_TOLERANCE: f64 = 1e-3;

/// The gains of all diagnosers of a configuration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GainsFile {
    /// Version of the form.
    pub version: u32,
    /// The program that wrote it, with its version.
    pub tool: String,
    /// When, UTC, RFC 3339.
    pub date: String,
    /// How far a stated number may lie from the recomputed one, relative.
    pub tolerance: f64,
    /// One entry a diagnoser.
    pub diagnoser: Vec<Entry>,
}

/// The gains of one diagnoser.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Entry {
    /// The diagnoser.
    pub name: String,
    /// Its method.
    pub method: String,
    /// Hash of its model, options and period.
    pub inputs: String,
    /// What was accepted but deserves a second look.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
    /// The solvers' words.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub solver: Vec<SolverRun>,
    /// The numbers; each method has its own.
    pub gains: Table,
    /// What they achieve.
    pub achieved: Achieved,
}

/// Why a gains file is refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GainsError {
    /// Not TOML, a key that is missing or unknown, a value of the wrong type.
    #[error(
        "the gains file cannot be read: {0}; it is damaged or incomplete, write it again with `residuald design`"
    )]
    Unreadable(String),
    /// Another form.
    #[error(
        "the gains file has version {found}, this program reads version {VERSION}; write it again with `residuald design`"
    )]
    UnknownVersion {
        /// Its version.
        found: u32,
    },
    /// A tolerance that would accept anything.
    #[error(
        "the tolerance {0} of the gains file does not lie between 0 and {LARGEST_TOLERANCE}; write it again with `residuald design`"
    )]
    Tolerance(f64),
    /// A diagnoser without gains.
    #[error(
        "the gains file has no gains for the diagnoser `{name}`; it is incomplete or belongs to another configuration, write it again with `residuald design`"
    )]
    NoEntry {
        /// The diagnoser.
        name: String,
    },
    /// A diagnoser with several.
    #[error(
        "the gains file has several entries for the diagnoser `{name}`; write it again with `residuald design`"
    )]
    SeveralEntries {
        /// The diagnoser.
        name: String,
    },
    /// Gains of another method.
    #[error(
        "the gains of `{name}` are for the method `{found}`, but it runs `{expected}`; write the file again with `residuald design`"
    )]
    OtherMethod {
        /// The diagnoser.
        name: String,
        /// The file's method.
        found: String,
        /// The configuration's.
        expected: String,
    },
    /// Gains of another plant, with other options or another period.
    #[error(
        "the gains of `{name}` were designed for another model, other options or another period ({found}, not {expected}); write the file again with `residuald design`"
    )]
    OtherInputs {
        /// The diagnoser.
        name: String,
        /// The file's hash.
        found: String,
        /// The configuration's.
        expected: String,
    },
    /// Gains that are not what the method needs.
    #[error("the gains of `{name}` cannot be read: {reason}; write the file again with `residuald design`")]
    Gains {
        /// The diagnoser.
        name: String,
        /// What is wrong.
        reason: String,
    },
    /// A number that the gains do not bear out.
    #[error(
        "the gains of `{name}` do not achieve what the file states: {place} is stated as {stated}, the gains give {recomputed}; the file was altered, write it again with `residuald design`"
    )]
    NotAchieved {
        /// The diagnoser.
        name: String,
        /// Where.
        place: String,
        /// What the file states.
        stated: String,
        /// What the gains give.
        recomputed: String,
    },
    /// A condition that does not hold.
    #[error("the gains of `{name}` violate a condition: {condition}, by {excess:e}; design the gains again")]
    Violated {
        /// The diagnoser.
        name: String,
        /// The condition.
        condition: String,
        /// How far it is violated.
        excess: f64,
    },
}

impl GainsFile {
    /// Reads the text of a gains file.
    ///
    /// # Errors
    /// [`GainsError::Unreadable`], [`GainsError::UnknownVersion`], [`GainsError::Tolerance`].
    pub fn parse(text: &str) -> Result<Self, GainsError> {
        let unreadable =
            |error: toml::de::Error| GainsError::Unreadable(error.to_string().trim_end().to_owned());
        let table: Table = text.parse().map_err(unreadable)?;
        if let Some(version) = table.get("version").and_then(Value::as_integer)
            && version != i64::from(VERSION)
        {
            let found = u32::try_from(version).unwrap_or(0);
            return Err(GainsError::UnknownVersion { found });
        }
        let file: Self = Value::Table(table).try_into().map_err(unreadable)?;
        if !(file.tolerance > 0.0 && file.tolerance <= LARGEST_TOLERANCE) {
            return Err(GainsError::Tolerance(file.tolerance));
        }
        Ok(file)
    }

    /// The entry of a diagnoser.
    ///
    /// # Errors
    /// [`GainsError::NoEntry`], [`GainsError::SeveralEntries`].
    pub fn entry(&self, name: &str) -> Result<&Entry, GainsError> {
        let mut entries = self.diagnoser.iter().filter(|entry| entry.name == name);
        let name = || name.to_owned();
        let entry = entries
            .next()
            .ok_or_else(|| GainsError::NoEntry { name: name() })?;
        match entries.next() {
            None => Ok(entry),
            Some(_) => Err(GainsError::SeveralEntries { name: name() }),
        }
    }
}

/// Hash of all that a design depends on: the method's tables and the period.
pub fn hash_of_inputs<T: MethodOptions>(options: &T, sample_time_s: f64) -> Result<String, GainsError> {
    let text = toml::to_string(options).map_err(|error| GainsError::Gains {
        name: T::METHOD.to_owned(),
        reason: error.to_string(),
    })?;
    let hash = xxh3_64(format!("{}\n{sample_time_s}\n{text}", T::METHOD).as_bytes());
    Ok(format!("xxh3:{hash:016x}"))
}

impl Entry {
    /// The entry of gains that were just found.
    ///
    /// # Errors
    /// [`GainsError::Gains`] if they cannot be written as TOML.
    pub fn new<T: MethodOptions>(
        name: &str,
        options: &T,
        sample_time_s: f64,
        found: &FoundGains<T::Gains>,
        achieved: Achieved,
    ) -> Result<Self, GainsError> {
        let gains = Table::try_from(&found.gains).map_err(|error| GainsError::Gains {
            name: name.to_owned(),
            reason: error.to_string(),
        })?;
        Ok(Self {
            name: name.to_owned(),
            method: T::METHOD.to_owned(),
            inputs: hash_of_inputs(options, sample_time_s)?,
            warnings: found.warnings.clone(),
            solver: found.solver.clone(),
            gains,
            achieved,
        })
    }

    /// The gains, if they belong to this method, these options and this period.
    ///
    /// # Errors
    /// [`GainsError::OtherMethod`], [`GainsError::OtherInputs`], [`GainsError::Gains`].
    pub fn gains<T: MethodOptions>(&self, options: &T, sample_time_s: f64) -> Result<T::Gains, GainsError> {
        let name = || self.name.clone();
        if self.method != T::METHOD {
            return Err(GainsError::OtherMethod {
                name: name(),
                found: self.method.clone(),
                expected: T::METHOD.to_owned(),
            });
        }
        let expected = hash_of_inputs(options, sample_time_s)?;
        if self.inputs != expected {
            return Err(GainsError::OtherInputs {
                name: name(),
                found: self.inputs.clone(),
                expected,
            });
        }
        Value::Table(self.gains.clone())
            .try_into()
            .map_err(|error: toml::de::Error| GainsError::Gains {
                name: name(),
                reason: error.to_string().trim_end().to_owned(),
            })
    }

    /// Compares what the file states with what the gains achieve.
    ///
    /// # Errors
    /// [`GainsError::Violated`] if a condition does not hold, [`GainsError::NotAchieved`] at the first number that
    /// differs by more than `tolerance`.
    pub fn verify(&self, achieved: &Achieved, tolerance: f64) -> Result<(), GainsError> {
        if let Some(inequality) = achieved.violated() {
            return Err(GainsError::Violated {
                name: self.name.clone(),
                condition: inequality.name.clone(),
                excess: -inequality.margin,
            });
        }
        let value = |achieved: &Achieved| {
            Value::try_from(achieved).map_err(|error| GainsError::Gains {
                name: self.name.clone(),
                reason: error.to_string(),
            })
        };
        match first_difference(&value(&self.achieved)?, &value(achieved)?, tolerance) {
            None => Ok(()),
            Some(difference) => Err(GainsError::NotAchieved {
                name: self.name.clone(),
                place: difference.place,
                stated: difference.stated,
                recomputed: difference.recomputed,
            }),
        }
    }
}
