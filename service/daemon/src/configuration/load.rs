//! From a file to a configuration, and from a configuration to its diagnosers.

use super::deserialise::{keys_of, read};
use super::error::{ConfigurationError, Source};
use super::locate::{Document, Mistakes};
use super::schema;
use super::validate::{self, refuse_duplicates};
use super::{Configuration, DiagnoserConfiguration, InputConfiguration, MethodConfiguration};
use residual_diagnosis::method::Designed;
use std::ops::Range;
use std::path::Path;
use std::sync::OnceLock;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// A configuration together with its text.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// The configuration in force.
    pub configuration: Configuration,
    pub(super) source: Source,
    /// The diagnosers, from their first construction on.
    pub(super) built: OnceLock<Vec<Designed>>,
}

impl Configuration {
    /// Reads and checks a configuration file.
    ///
    /// # Errors
    /// [`ConfigurationError`]: the file cannot be read, or everything that is wrong in it.
    pub fn from_file(path: &Path) -> Result<Loaded, ConfigurationError> {
        let bytes = std::fs::read(path).map_err(|reason| ConfigurationError::Unreadable {
            path: path.to_owned(),
            reason,
        })?;
        let text = String::from_utf8(bytes).map_err(|error| {
            let offset = error.utf8_error().valid_up_to();
            let line = error.as_bytes()[..offset]
                .iter()
                .filter(|&&byte| byte == b'\n')
                .count()
                + 1;
            ConfigurationError::NotUtf8 {
                path: path.to_owned(),
                line,
                offset,
            }
        })?;
        let directory = path.parent().unwrap_or(Path::new(""));
        Self::from_text_in(directory, &path.display().to_string(), &text)
    }

    /// Checks the text of a configuration; `name` is what mistakes call it. Paths in it are seen from the working
    /// directory.
    ///
    /// # Errors
    /// [`ConfigurationError::Mistakes`] with as many mistakes as can be seen at once.
    pub fn from_text(name: &str, text: &str) -> Result<Loaded, ConfigurationError> {
        Self::from_text_in(Path::new(""), name, text)
    }

    /// Checks the text of a configuration whose paths are seen from `directory`.
    fn from_text_in(directory: &Path, name: &str, text: &str) -> Result<Loaded, ConfigurationError> {
        let source = Source::new(name, text);
        let configuration = load(&source, directory)?;
        Ok(Loaded {
            configuration,
            source,
            built: OnceLock::new(),
        })
    }
}

fn load(source: &Source, directory: &Path) -> Result<Configuration, ConfigurationError> {
    let document = Document::parse(source)?;
    let mut mistakes = Mistakes::new(&document);
    let root = document.root.get_ref();
    if root.is_empty() {
        mistakes.at_span(
            0..0,
            "the configuration is empty",
            "start from the example deploy/config/vtol.toml",
        );
        return Err(mistakes.into_error());
    }
    for key in root
        .keys()
        .filter(|key| !schema::TOP_LEVEL.contains(&key.get_ref().as_ref()))
    {
        mistakes.unknown_key(key.span(), key.get_ref(), &schema::TOP_LEVEL);
    }
    let daemon = match table(root, "daemon", &mut mistakes) {
        Some((entries, span)) => read(entries, span, "daemon", &[], &mut mistakes)
            .and_then(|section| validate::daemon(section, directory, &mut mistakes)),
        None => {
            if !root.contains_key("daemon") {
                mistakes.at_span(
                    0..0,
                    "missing section [daemon]",
                    "add [daemon] with instance = \"...\"",
                );
            }
            None
        }
    };
    let realtime = match table(root, "realtime", &mut mistakes) {
        Some((entries, span)) => read(entries, span, "realtime", &[], &mut mistakes),
        None => Some(schema::Realtime::default()),
    };
    let realtime = realtime.map(|section| validate::realtime(&section, &mut mistakes));
    let inputs = inputs(root, &mut mistakes);
    let diagnosers = diagnosers(root, inputs.as_deref(), &mut mistakes);
    let replay = table(root, "replay", &mut mistakes)
        .and_then(|(entries, span)| read(entries, span, "replay", &[], &mut mistakes))
        .zip(inputs.as_deref())
        .map(|(section, inputs)| validate::replay(section, inputs, &mut mistakes));
    match (daemon, realtime, inputs, diagnosers) {
        (Some(daemon), Some(realtime), Some(inputs), Some(diagnosers)) if mistakes.len() == 0 => {
            Ok(Configuration {
                daemon,
                realtime,
                inputs,
                diagnosers,
                replay,
            })
        }
        _ => Err(mistakes.into_error()),
    }
}

/// `[[input]]`; `None` if one of them could not be read.
fn inputs(root: &DeTable<'_>, mistakes: &mut Mistakes<'_>) -> Option<Vec<InputConfiguration>> {
    let tables = tables(root, "input", mistakes)?;
    let read_one = |(index, (entries, span)): (usize, Section<'_, '_>)| {
        let path = format!("input.{index}");
        let section = read(entries, span, &path, &[], mistakes)?;
        Some(validate::input(&path, section, mistakes))
    };
    // Every table is read before the result is given up, so that each shows its mistakes.
    let inputs: Vec<_> = tables.into_iter().enumerate().map(read_one).collect();
    let inputs = inputs.into_iter().collect::<Option<Vec<_>>>()?;
    let names = inputs.iter().map(|input| input.name.as_str());
    refuse_duplicates(names, |index| format!("input.{index}.name"), "input", mistakes);
    Some(inputs)
}

/// `[[diagnoser]]`; without `inputs` only the form of the tables is checked.
fn diagnosers(
    root: &DeTable<'_>,
    inputs: Option<&[InputConfiguration]>,
    mistakes: &mut Mistakes<'_>,
) -> Option<Vec<DiagnoserConfiguration>> {
    let tables = tables(root, "diagnoser", mistakes)?;
    let read_one = |(index, (entries, span)): (usize, Section<'_, '_>)| {
        let path = format!("diagnoser.{index}");
        let (section, method) = diagnoser_section(entries, span, &path, mistakes);
        validate::diagnoser(&path, section?, method, inputs?, mistakes)
    };
    let diagnosers: Vec<_> = tables.into_iter().enumerate().map(read_one).collect();
    let diagnosers = diagnosers.into_iter().collect::<Option<Vec<_>>>()?;
    let names = diagnosers.iter().map(|diagnoser| diagnoser.name.as_str());
    refuse_duplicates(
        names,
        |index| format!("diagnoser.{index}.name"),
        "diagnoser",
        mistakes,
    );
    Some(diagnosers)
}

/// Splits one `[[diagnoser]]` into what every method shares and what belongs to its method.
fn diagnoser_section(
    entries: &DeTable<'_>,
    span: Range<usize>,
    path: &str,
    mistakes: &mut Mistakes<'_>,
) -> (Option<schema::Diagnoser>, Option<MethodConfiguration>) {
    let all_but = |keys: &[&str]| -> Vec<String> {
        let names = entries.keys().map(|key| key.get_ref().as_ref());
        names
            .filter(|name| !keys.contains(name))
            .map(str::to_owned)
            .collect()
    };
    let (choice, shared) = (
        keys_of::<schema::DiagnoserMethod>(),
        keys_of::<schema::Diagnoser>(),
    );
    let method: Option<schema::DiagnoserMethod> =
        read(entries, span.clone(), path, &all_but(choice), mistakes);
    let section = read(entries, span.clone(), path, &all_but(shared), mistakes);
    // Which keys are unknown depends on the method; without one nothing more can be said.
    let Some(schema::DiagnoserMethod { method }) = method else {
        return (section, None);
    };
    let before = mistakes.len();
    let known = [choice, shared, method.keys()].concat();
    for key in entries
        .keys()
        .filter(|key| !known.contains(&key.get_ref().as_ref()))
    {
        mistakes.unknown_key(key.span(), key.get_ref(), &known);
    }
    let method = method.read(entries, span, path, &all_but(method.keys()), mistakes);
    // Tables with a mistake are not judged as a whole: what was left out would only look wrong a second time.
    (section, method.filter(|_| mistakes.len() == before))
}

type Section<'a, 't> = (&'a DeTable<'t>, Range<usize>);

/// The table of a section, if it is there.
fn table<'a, 't>(root: &'a DeTable<'t>, name: &str, mistakes: &mut Mistakes<'_>) -> Option<Section<'a, 't>> {
    let value = root.get(name)?;
    let DeValue::Table(entries) = value.get_ref() else {
        mistakes.at_span(
            value.span(),
            format!("expected one table, found {}", value.get_ref().type_str()),
            format!("write the section as [{name}], once"),
        );
        return None;
    };
    Some((entries, value.span()))
}

/// The tables of a repeated section, of which at least one is needed.
fn tables<'a, 't>(
    root: &'a DeTable<'t>,
    name: &str,
    mistakes: &mut Mistakes<'_>,
) -> Option<Vec<Section<'a, 't>>> {
    let Some(value) = root.get(name) else {
        mistakes.at_span(
            0..0,
            format!("no [[{name}]]"),
            format!("add at least one section [[{name}]]"),
        );
        return None;
    };
    let section = |value: &'a Spanned<DeValue<'t>>| Some((value.get_ref().as_table()?, value.span()));
    let sections = value
        .get_ref()
        .as_array()
        .and_then(|array| array.iter().map(section).collect());
    if sections.is_none() {
        mistakes.at_span(
            value.span(),
            format!("expected tables, found {}", value.get_ref().type_str()),
            format!("write every such section with two brackets: [[{name}]]"),
        );
    }
    sections
}
