//! Diagnosers on the gains of a file: nothing in it is believed, everything is recomputed.

use super::build::{packets_come_from_one_input, refuse};
use super::enabling::channels_exist;
use super::error::{ConfigurationError, Mistake, Source};
use super::load::Loaded;
use super::locate::{Document, Mistakes};
use super::refusal::parts;
use super::{Configuration, DiagnoserConfiguration};
use residual_diagnosis::gains::error::GainsError;
use residual_diagnosis::gains::file::GainsFile;
use residual_diagnosis::method::{Designed, Refusal};
use std::path::Path;

/// What to do about gains that are refused without advice.
const WRITE_AGAIN: &str = "write the file again with `residuald design`";

/// Why the gains of one diagnoser are refused.
enum Rejection {
    /// By the file's own word, in this entry where there is one.
    File(Option<usize>, Box<GainsError>),
    /// By the method, in this entry.
    Method(usize, Refusal),
}

/// Reads a gains file; mistakes call it `name`.
///
/// # Errors
/// What is wrong with its form, at its place.
pub fn parse_gains(name: &str, text: &str) -> Result<GainsFile, ConfigurationError> {
    let source = Source::new(name, text);
    GainsFile::parse(text).map_err(|error| {
        let place = match &error {
            GainsError::Unreadable { place, .. } => place.clone().unwrap_or(0..0),
            other => Document::parse(&source).map_or(0..0, |document| document.span_of(other.key())),
        };
        let (message, help) = parts(&error.to_string());
        let mistake = Mistake::new(&source, place, message, Some(help));
        ConfigurationError::Mistakes {
            name: name.to_owned(),
            mistakes: vec![mistake],
        }
    })
}

impl Loaded {
    /// The diagnosers on the gains of a file.
    pub(super) fn on_gains_file(&self, path: &Path) -> Result<Vec<Designed>, ConfigurationError> {
        let text = read(path).map_err(|reason| self.no_gains_file(path, &reason))?;
        self.on_gains(&path.display().to_string(), &text)
    }

    /// Constructs the diagnosers on the gains of a file's text, which mistakes call `name`.
    ///
    /// # Errors
    /// What is wrong with the file, and every diagnoser whose gains do not belong to it, do not fulfil a condition or
    /// do not achieve what the file states, at the place in the file; conditions of the configuration alone at their
    /// place there.
    pub fn on_gains(&self, name: &str, text: &str) -> Result<Vec<Designed>, ConfigurationError> {
        let file = parse_gains(name, text)?;
        let source = Source::new(name, text);
        let (document, configuration) = (Document::parse(&source)?, Document::parse(&self.source)?);
        let mut in_file = Mistakes::new(&document);
        let mut in_configuration = Mistakes::new(&configuration);
        strangers(&file, &self.configuration, &mut in_file);
        let mut diagnosers = Vec::new();
        for (position, diagnoser) in self.configuration.diagnosers.iter().enumerate() {
            match construct(&file, diagnoser) {
                Ok(designed) => diagnosers.push(designed),
                Err(Rejection::Method(_, refusal)) if !blames_gains(&refusal) => {
                    refuse(&mut in_configuration, position, diagnoser, &refusal);
                }
                Err(Rejection::Method(index, refusal)) => {
                    let (reason, help) = parts(&refusal.message);
                    let message = format!("the gains of `{}` are refused: {reason}", diagnoser.name);
                    let help = if help.is_empty() {
                        WRITE_AGAIN.to_owned()
                    } else {
                        help
                    };
                    in_file.at(&format!("diagnoser.{index}.{}", refusal.key), message, help);
                }
                Err(Rejection::File(index, error)) => {
                    let place = match index {
                        Some(index) => format!("diagnoser.{index}.{}", error.key()),
                        None => error.key().to_owned(),
                    };
                    let (message, help) = parts(&error.to_string());
                    in_file.at(&place, message, help);
                }
            }
        }
        match (in_configuration.len(), in_file.len()) {
            (0, 0) => Ok(diagnosers),
            (0, _) => Err(in_file.into_error()),
            _ => Err(in_configuration.into_error()),
        }
    }

    /// The mistake of naming a file that cannot be read.
    fn no_gains_file(&self, path: &Path, reason: &str) -> ConfigurationError {
        let document = match Document::parse(&self.source) {
            Ok(document) => document,
            Err(error) => return error,
        };
        let mut mistakes = Mistakes::new(&document);
        mistakes.at(
            "daemon.gains_file",
            format!("the gains file {} cannot be read: {reason}", path.display()),
            format!(
                "write it with `residuald design {}`, or leave `gains_file` out to have the gains found at the start",
                self.source.name
            ),
        );
        mistakes.into_error()
    }
}

/// The text of a file. Anything but a file is refused, as reading it might never end.
///
/// # Errors
/// Why not, in words.
pub fn read(path: &Path) -> Result<String, String> {
    let metadata = std::fs::metadata(path).map_err(|error| error.to_string())?;
    if !metadata.is_file() {
        return Err("it is not a file".to_owned());
    }
    let bytes = std::fs::read(path).map_err(|error| error.to_string())?;
    String::from_utf8(bytes).map_err(|error| {
        let offset = error.utf8_error().valid_up_to();
        format!("it is not UTF-8 text (byte {offset})")
    })
}

fn construct(file: &GainsFile, diagnoser: &DiagnoserConfiguration) -> Result<Designed, Rejection> {
    let (index, entry) = file
        .entry(&diagnoser.name)
        .map_err(|error| Rejection::File(None, Box::new(error)))?;
    let rejected = |error| Rejection::File(Some(index), Box::new(error));
    let refused = |refusal| Rejection::Method(index, refusal);
    let (method, sample_time_s) = (&diagnoser.method, diagnoser.sample_time_s());
    let inputs = method.hash_of_inputs(sample_time_s).map_err(refused)?;
    entry
        .belongs_to(method.name(), sample_time_s, &inputs)
        .map_err(rejected)?;
    let mut designed = method.with_gains(sample_time_s, &entry.gains).map_err(refused)?;
    entry
        .verify(&designed.achieved, file.tolerance)
        .map_err(rejected)?;
    packets_come_from_one_input(diagnoser, &designed).map_err(refused)?;
    channels_exist(diagnoser, &designed).map_err(refused)?;
    designed.warnings.extend(entry.warnings.iter().cloned());
    Ok(designed)
}

fn blames_gains(refusal: &Refusal) -> bool {
    refusal.key == "gains" || refusal.key.starts_with("gains.")
}

/// Refuses gains for diagnosers that are not there: the file was written for another configuration.
fn strangers(file: &GainsFile, configuration: &Configuration, mistakes: &mut Mistakes<'_>) {
    for (index, entry) in file.diagnoser.iter().enumerate() {
        if configuration
            .diagnosers
            .iter()
            .all(|diagnoser| diagnoser.name != entry.name)
        {
            let error = GainsError::Stranger {
                name: entry.name.clone(),
            };
            let (message, help) = parts(&error.to_string());
            mistakes.at(&format!("diagnoser.{index}.{}", error.key()), message, help);
        }
    }
}
