//! From dotted key paths to places in the text.

use super::error::{ConfigurationError, Mistake, Source, line_and_column};
use super::suggest::did_you_mean;
use std::ops::Range;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// A parsed text that knows the place of every key and value.
pub(super) struct Document<'t> {
    pub source: &'t Source,
    pub root: Spanned<DeTable<'t>>,
}

impl<'t> Document<'t> {
    /// Parses `source`.
    ///
    /// # Errors
    /// Every mistake of syntax.
    pub fn parse(source: &'t Source) -> Result<Self, ConfigurationError> {
        let (root, errors) = DeTable::parse_recoverable(&source.text);
        if errors.is_empty() {
            return Ok(Self { source, root });
        }
        let mistake = |error: &toml::de::Error| {
            let message = format!("not valid TOML: {}", error.message().trim_end());
            Mistake::new(source, error.span().unwrap_or(0..0), message, None)
        };
        let mistakes = errors.iter().map(mistake).collect();
        Err(ConfigurationError::Mistakes {
            name: source.name.clone(),
            mistakes,
        })
    }

    /// The bytes of the value at a dotted path such as `diagnoser.0.model.B` (`diagnoser[0].model.B` is the same);
    /// where the path leaves the text, the innermost table or array that exists.
    pub fn span_of(&self, path: &str) -> Range<usize> {
        let mut segments = path.split(['.', '[', ']']).filter(|segment| !segment.is_empty());
        let Some(mut value) = segments.next().and_then(|first| self.root.get_ref().get(first)) else {
            return 0..0;
        };
        for segment in segments {
            let inner = match value.get_ref() {
                DeValue::Table(table) => table.get(segment),
                DeValue::Array(array) => segment.parse().ok().and_then(|index: usize| array.get(index)),
                _ => None,
            };
            match inner {
                Some(inner) => value = inner,
                None => break,
            }
        }
        value.span()
    }
}

/// Collects the mistakes of one text.
pub(super) struct Mistakes<'d> {
    pub document: &'d Document<'d>,
    list: Vec<Mistake>,
}

impl<'d> Mistakes<'d> {
    pub fn new(document: &'d Document<'d>) -> Self {
        Self {
            document,
            list: Vec::new(),
        }
    }

    /// Adds a mistake at a dotted path.
    pub fn at(&mut self, path: &str, message: impl Into<String>, help: impl Into<String>) {
        self.at_span(self.document.span_of(path), message, help);
    }

    /// The line, from 1, of the value at a dotted path.
    pub fn line_of(&self, path: &str) -> usize {
        line_and_column(&self.document.source.text, self.document.span_of(path).start).0
    }

    /// Adds a mistake at bytes of the text.
    pub fn at_span(&mut self, span: Range<usize>, message: impl Into<String>, help: impl Into<String>) {
        let help = Some(help.into()).filter(|help| !help.is_empty());
        self.list
            .push(Mistake::new(self.document.source, span, message.into(), help));
    }

    /// Adds an unknown key, with the known ones as help.
    pub fn unknown_key(&mut self, span: Range<usize>, key: &str, known: &[&str]) {
        self.at_span(
            span,
            format!("unknown key `{key}`"),
            did_you_mean(key, known, "known keys"),
        );
    }

    /// How many were found so far.
    pub fn len(&self) -> usize {
        self.list.len()
    }

    /// The error with all mistakes, in the order of their places.
    pub fn into_error(mut self) -> ConfigurationError {
        self.list.sort_by_key(|mistake| (mistake.line, mistake.column));
        ConfigurationError::Mistakes {
            name: self.document.source.name.clone(),
            mistakes: self.list,
        }
    }
}
