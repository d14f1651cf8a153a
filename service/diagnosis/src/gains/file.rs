//! The gains file: TOML, every number with all its digits.

use super::SolverRun;
use super::compare::{allowed, first_difference};
use super::error::GainsError;
use super::layout;
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
pub(super) const LARGEST_TOLERANCE: f64 = 1e-3;
/// Every gains file begins with these words.
pub const BEGINNING: &str = "# Gains of residuald:";

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
    /// Its sampling period, s.
    pub sample_time_s: f64,
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

impl GainsFile {
    /// Reads the text of a gains file.
    ///
    /// # Errors
    /// [`GainsError::Unreadable`], [`GainsError::UnknownVersion`], [`GainsError::NotFinite`], [`GainsError::Tolerance`].
    pub fn parse(text: &str) -> Result<Self, GainsError> {
        let unreadable = |error: toml::de::Error| GainsError::Unreadable {
            reason: error.message().trim_end().to_owned(),
            place: error.span(),
        };
        let table: Table = toml::from_str(text).map_err(unreadable)?;
        if let Some(version) = table.get("version").and_then(Value::as_integer)
            && version != i64::from(VERSION)
        {
            return Err(GainsError::UnknownVersion { found: version });
        }
        not_finite("", &Value::Table(table)).map_or(Ok(()), Err)?;
        // From the text again: only so the places of refusals are known.
        let file: Self = toml::from_str(text).map_err(unreadable)?;
        if !(file.tolerance > 0.0 && file.tolerance <= LARGEST_TOLERANCE) {
            return Err(GainsError::Tolerance(file.tolerance));
        }
        Ok(file)
    }

    /// The file as text for people: matrices row by row, every number with the fewest digits that give it back.
    /// `command` is what makes the file again.
    ///
    /// # Errors
    /// [`GainsError::Unwritable`].
    pub fn to_text(&self, command: &str) -> Result<String, GainsError> {
        let table = Table::try_from(self).map_err(|error| GainsError::Unwritable(error.to_string()))?;
        not_finite("", &Value::Table(table.clone())).map_or(Ok(()), Err)?;
        Ok(format!(
            "{BEGINNING} what its diagnosers run on, and what they achieve with it.\n\
             # Whenever it is loaded, every condition is checked on the gains, and what is achieved is recomputed and\n\
             # compared; warnings, solver and date are remarks. Change the configuration, not this file.\n\
             # Made by: {}\n\n{}",
            command.replace(char::is_control, " "),
            layout::text(&table)
        ))
    }

    /// The entry of a diagnoser, and its position.
    ///
    /// # Errors
    /// [`GainsError::NoEntry`], [`GainsError::SeveralEntries`].
    pub fn entry(&self, name: &str) -> Result<(usize, &Entry), GainsError> {
        let mut entries = self
            .diagnoser
            .iter()
            .enumerate()
            .filter(|(_, entry)| entry.name == name);
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

/// The first number that is none, or infinite.
fn not_finite(path: &str, value: &Value) -> Option<GainsError> {
    let below = |part: &dyn std::fmt::Display| match path {
        "" => part.to_string(),
        _ => format!("{path}.{part}"),
    };
    match value {
        Value::Float(number) if !number.is_finite() => Some(GainsError::NotFinite {
            path: path.to_owned(),
            value: *number,
        }),
        Value::Array(entries) => {
            let mut entries = entries.iter().enumerate();
            entries.find_map(|(index, entry)| not_finite(&below(&index), entry))
        }
        Value::Table(entries) => {
            let mut entries = entries.iter();
            entries.find_map(|(key, entry)| not_finite(&below(key), entry))
        }
        _ => None,
    }
}

/// Hash of all that a design depends on: the method's tables and the period.
///
/// # Errors
/// Tables that cannot be written as TOML.
pub fn hash_of_inputs<T: MethodOptions>(options: &T, sample_time_s: f64) -> Result<String, toml::ser::Error> {
    let text = toml::to_string(options)?;
    let hash = xxh3_64(format!("{}\n{sample_time_s}\n{text}", T::METHOD).as_bytes());
    Ok(format!("xxh3:{hash:016x}"))
}

impl Entry {
    /// Whether the gains were found for this method, this period and these inputs ([`hash_of_inputs`]).
    ///
    /// # Errors
    /// [`GainsError::OtherMethod`], [`GainsError::OtherPeriod`], [`GainsError::OtherInputs`].
    pub fn belongs_to(&self, method: &str, sample_time_s: f64, inputs: &str) -> Result<(), GainsError> {
        let name = || self.name.clone();
        if self.method != method {
            return Err(GainsError::OtherMethod {
                name: name(),
                found: self.method.clone(),
                expected: method.to_owned(),
            });
        }
        if self.sample_time_s != sample_time_s {
            return Err(GainsError::OtherPeriod {
                name: name(),
                found: self.sample_time_s,
                expected: sample_time_s,
            });
        }
        if self.inputs != inputs {
            return Err(GainsError::OtherInputs {
                name: name(),
                found: self.inputs.clone(),
                expected: inputs.to_owned(),
            });
        }
        Ok(())
    }

    /// Compares what the file states with what the gains achieve.
    ///
    /// # Errors
    /// [`GainsError::Violated`] if a condition does not hold, [`GainsError::BelowBound`] at a norm below what is
    /// possible, [`GainsError::NotAchieved`] at the first number that differs by more than `tolerance`.
    pub fn verify(&self, achieved: &Achieved, tolerance: f64) -> Result<(), GainsError> {
        if let Some(inequality) = achieved.violated() {
            return Err(GainsError::Violated {
                name: self.name.clone(),
                condition: inequality.name.clone(),
                margin: inequality.margin,
            });
        }
        let too_small = achieved.norms.iter().find_map(|norm| {
            let bound = norm.lower_bound?;
            let allowed = allowed(norm.value, bound, tolerance);
            (norm.value < bound - allowed).then_some((norm, bound))
        });
        if let Some((norm, bound)) = too_small {
            return Err(GainsError::BelowBound {
                name: self.name.clone(),
                norm: norm.name.clone(),
                value: norm.value,
                bound,
            });
        }
        let value = |achieved: &Achieved| {
            Value::try_from(achieved).map_err(|error| GainsError::Unwritable(error.to_string()))
        };
        match first_difference(&value(&self.achieved)?, &value(achieved)?, tolerance) {
            None => Ok(()),
            Some(difference) => Err(GainsError::NotAchieved {
                name: self.name.clone(),
                key: format!("achieved.{}", difference.key),
                place: difference.place,
                stated: difference.stated,
                recomputed: difference.recomputed,
            }),
        }
    }
}
