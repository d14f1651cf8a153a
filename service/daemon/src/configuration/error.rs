//! What is wrong with a configuration, and where.

use miette::{Diagnostic, NamedSource, SourceSpan};
use std::ops::Range;
use std::path::PathBuf;
use std::sync::Arc;
use thiserror::Error;

/// Why a configuration was refused.
#[derive(Debug, Error, Diagnostic)]
#[non_exhaustive]
pub enum ConfigurationError {
    /// The file cannot be read.
    #[error("cannot read the configuration {}: {reason}", path.display())]
    #[diagnostic(help("give the path of a readable TOML file"))]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What the operating system says.
        reason: std::io::Error,
    },
    /// The file is not UTF-8 text.
    #[error("{}:{line}: the configuration is not UTF-8 text (byte {offset})", path.display())]
    #[diagnostic(help("save the file in UTF-8; TOML allows no other encoding"))]
    NotUtf8 {
        /// The file.
        path: PathBuf,
        /// Line of the first byte that is not UTF-8, from 1.
        line: usize,
        /// Offset of that byte, from 0.
        offset: usize,
    },
    /// The text was read, and these mistakes were found in it.
    #[error("{name}: {}", count(mistakes.len()))]
    Mistakes {
        /// The file, or what the text is called.
        name: String,
        /// The mistakes, in the order of their places; never empty.
        #[related]
        mistakes: Vec<Mistake>,
    },
}

impl ConfigurationError {
    /// The mistakes in the text; empty when it could not be read at all.
    pub fn mistakes(&self) -> &[Mistake] {
        match self {
            Self::Mistakes { mistakes, .. } => mistakes,
            _ => &[],
        }
    }
}

fn count(mistakes: usize) -> String {
    match mistakes {
        1 => "1 mistake".to_owned(),
        more => format!("{more} mistakes"),
    }
}

/// One mistake: what is wrong, where, and what to do about it.
#[derive(Clone, Debug, Error, Diagnostic)]
#[error("{message}")]
pub struct Mistake {
    /// What is wrong.
    pub message: String,
    /// What to do about it; may be empty when the message says all.
    #[help]
    pub help: Option<String>,
    /// Line of its beginning, from 1.
    pub line: usize,
    /// Column of its beginning in characters, from 1.
    pub column: usize,
    #[label("here")]
    span: SourceSpan,
    #[source_code]
    source_code: NamedSource<Arc<str>>,
}

impl Mistake {
    /// The mistake at the bytes `span` of `source`.
    pub(super) fn new(source: &Source, span: Range<usize>, message: String, help: Option<String>) -> Self {
        let (line, column) = line_and_column(&source.text, span.start);
        Self {
            message,
            help,
            line,
            column,
            span: span.into(),
            source_code: NamedSource::new(&source.name, Arc::clone(&source.text)),
        }
    }
}

/// A text and what it is called.
#[derive(Clone, Debug)]
pub(super) struct Source {
    pub name: String,
    pub text: Arc<str>,
}

impl Source {
    pub fn new(name: &str, text: &str) -> Self {
        Self {
            name: name.to_owned(),
            text: text.into(),
        }
    }
}

/// Line and column (in characters) of a byte, both from 1.
pub(super) fn line_and_column(text: &str, offset: usize) -> (usize, usize) {
    let before = text.get(..offset.min(text.len())).unwrap_or("");
    let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
    (
        before.matches('\n').count() + 1,
        before[line_start..].chars().count() + 1,
    )
}
