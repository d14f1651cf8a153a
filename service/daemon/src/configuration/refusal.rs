//! The error type of deserialisation: it keeps the known keys and words apart, and its place.

use super::suggest::did_you_mean;
use serde::de::{Error, Expected, Unexpected};
use std::fmt;
use std::ops::Range;

/// Why a value was refused, and the innermost key and place it belongs to.
#[derive(Debug)]
pub(super) struct Refusal {
    pub what: What,
    pub path: Option<String>,
    pub span: Option<Range<usize>>,
}

/// What was wrong; a text reads "what is wrong; what to do".
#[derive(Debug)]
pub(super) enum What {
    UnknownKey {
        key: String,
        known: &'static [&'static str],
    },
    UnknownWord {
        word: String,
        known: &'static [&'static str],
    },
    MissingKey(&'static str),
    Value(String),
}

impl Refusal {
    /// Completes the place; what an inner level has written stays.
    pub fn at(mut self, path: Option<&str>, span: Range<usize>) -> Self {
        self.path = self.path.or_else(|| path.map(str::to_owned));
        self.span.get_or_insert(span);
        self
    }

    /// What is wrong and what to do.
    pub fn explain(&self) -> (String, String) {
        match &self.what {
            What::UnknownKey { key, known } => (
                format!("unknown key `{key}`"),
                did_you_mean(key, known, "known keys"),
            ),
            What::UnknownWord { word, known } => (
                format!("unknown value \"{word}\""),
                did_you_mean(word, known, "possible values"),
            ),
            What::MissingKey(key) => (format!("missing key `{key}`"), format!("add `{key} = ...` here")),
            What::Value(message) => parts(message),
        }
    }
}

impl From<What> for Refusal {
    fn from(what: What) -> Self {
        Self {
            what,
            path: None,
            span: None,
        }
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.explain().0)
    }
}

impl std::error::Error for Refusal {}

impl Error for Refusal {
    fn custom<T: fmt::Display>(message: T) -> Self {
        What::Value(message.to_string()).into()
    }

    fn invalid_type(unexpected: Unexpected<'_>, expected: &dyn Expected) -> Self {
        let found = match unexpected {
            Unexpected::Seq => "an array".to_owned(),
            Unexpected::Map => "a table".to_owned(),
            Unexpected::Str(text) => format!("the string \"{text}\""),
            Unexpected::Bool(value) => value.to_string(),
            Unexpected::Signed(number) => number.to_string(),
            Unexpected::Unsigned(number) => number.to_string(),
            Unexpected::Float(number) => format!("{number:?}"),
            other => other.to_string(),
        };
        let expected = expected.to_string();
        let expected = plain_words(&expected);
        What::Value(format!(
            "expected {expected}, found {found}; write {expected} here"
        ))
        .into()
    }

    fn invalid_value(unexpected: Unexpected<'_>, expected: &dyn Expected) -> Self {
        Self::invalid_type(unexpected, expected)
    }

    fn unknown_variant(word: &str, known: &'static [&'static str]) -> Self {
        What::UnknownWord {
            word: word.to_owned(),
            known,
        }
        .into()
    }

    fn unknown_field(key: &str, known: &'static [&'static str]) -> Self {
        What::UnknownKey {
            key: key.to_owned(),
            known,
        }
        .into()
    }

    fn missing_field(key: &'static str) -> Self {
        What::MissingKey(key).into()
    }

    fn duplicate_field(key: &'static str) -> Self {
        What::Value(format!("`{key}` appears twice")).into()
    }
}

/// The expectation of a Rust type in words of TOML.
fn plain_words(expected: &str) -> &str {
    match expected {
        "u8" => "a whole number from 0 to 255",
        "u16" | "u32" | "u64" | "usize" => "a whole number, 0 or more",
        "i8" | "i16" | "i32" | "i64" | "isize" => "a whole number",
        "f32" | "f64" => "a number",
        "a sequence" => "an array",
        "a boolean" => "true or false",
        "path string" => "a string",
        structure if structure.starts_with("struct ") => "a table",
        other => other,
    }
}

/// What is wrong and what to do, from a refusal of a method.
pub(super) fn explain(refusal: &residual_diagnosis::method::Refusal) -> (String, String) {
    parts(&refusal.message)
}

/// Messages read "what is wrong; what to do".
pub(super) fn parts(message: &str) -> (String, String) {
    let (message, help) = message.split_once("; ").unwrap_or((message, ""));
    (message.to_owned(), help.to_owned())
}
