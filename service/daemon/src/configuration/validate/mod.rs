//! From the sections as written to the configuration in force: every condition that the schema cannot express.

mod daemon;
mod diagnoser;
mod input;
mod lifecycle;
mod quantity;
mod replay;

pub(super) use daemon::{daemon, realtime};
pub(super) use diagnoser::diagnoser;
pub(super) use input::input;
pub(super) use replay::replay;

use super::locate::Mistakes;
use std::collections::HashMap;

/// Longest name of an input, signal or diagnoser; it becomes part of service names and of the bounds table.
pub(super) const MAX_NAME: usize = 48;

/// Refuses names that could not be part of a path, a service name or a dotted reference.
fn check_name(path: &str, name: &str, what: &str, mistakes: &mut Mistakes<'_>) {
    let allowed = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    if let Some(character) = name.chars().find(|&c| !allowed(c)) {
        mistakes.at(
            path,
            format!("the {what} name `{name}` holds `{character}`"),
            "use only letters a-z and A-Z, digits, `_` and `-`",
        );
    } else if name.is_empty() || name.len() > MAX_NAME {
        mistakes.at(
            path,
            format!("the {what} name `{name}` has {} characters", name.len()),
            format!("use 1 to {MAX_NAME} characters"),
        );
    }
}

/// Refuses every repetition in a list whose elements lie at `path_of(index)`.
pub(super) fn refuse_duplicates<'n>(
    names: impl IntoIterator<Item = &'n str>,
    path_of: impl Fn(usize) -> String,
    what: &str,
    mistakes: &mut Mistakes<'_>,
) {
    let mut first = HashMap::new();
    for (index, name) in names.into_iter().enumerate() {
        if let Some(earlier) = first.insert(name, index) {
            let line = mistakes.line_of(&path_of(earlier));
            mistakes.at(
                &path_of(index),
                format!("the {what} `{name}` appears twice"),
                format!("it is already used in line {line}; rename or remove one of the two"),
            );
        }
    }
}

/// Refuses a number outside `from..=to`.
fn check_range(path: &str, value: u64, from: u64, to: u64, what: &str, mistakes: &mut Mistakes<'_>) {
    if !(from..=to).contains(&value) {
        mistakes.at(
            path,
            format!("{value} is no possible {what}"),
            format!("use {from} to {to}"),
        );
    }
}
