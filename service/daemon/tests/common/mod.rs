//! The example configuration, and ways to spoil it.
#![allow(dead_code)] // Not every test file needs every helper.

use residuald::configuration::{Configuration, ConfigurationError, Mistake};
use std::path::PathBuf;

/// The complete example.
pub const VTOL: &str = include_str!("../../../../deploy/config/vtol.toml");

/// A path seen from the root of the workspace.
pub fn repository(path: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..").join(path)
}

/// The example with the first `good` replaced by `bad`.
pub fn vtol_with(good: &str, bad: &str) -> String {
    assert!(VTOL.contains(good), "the example does not contain {good}");
    VTOL.replacen(good, bad, 1)
}

/// The line, from 1, of the first `words`.
pub fn line_of(text: &str, words: &str) -> usize {
    let offset = text
        .find(words)
        .unwrap_or_else(|| panic!("the text does not contain {words}"));
    text[..offset].matches('\n').count() + 1
}

/// The mistakes of a text, those of the construction of its diagnosers included; empty if it is in order.
pub fn mistakes_of(text: &str) -> Vec<Mistake> {
    // Gains are found anew: those of the example belong to the example as it is.
    let designed =
        Configuration::from_text("vtol.toml", text).and_then(|loaded| loaded.design(&mut |_, _| ()));
    match designed {
        Ok(_) => Vec::new(),
        Err(ConfigurationError::Mistakes { mistakes, .. }) => mistakes,
        Err(other) => panic!("{other}"),
    }
}
