//! Why gains are refused.

use super::file::{LARGEST_TOLERANCE, VERSION};
use std::ops::Range;

/// Why a gains file is refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GainsError {
    /// Not TOML, a key that is missing or unknown, a value of the wrong type.
    #[error(
        "the gains file cannot be read: {reason}; it is damaged or incomplete, write it again with `residuald design`"
    )]
    Unreadable {
        /// What is wrong.
        reason: String,
        /// Bytes of the text, where known.
        place: Option<Range<usize>>,
    },
    /// Another form.
    #[error(
        "the gains file has version {found}, this program reads version {VERSION}; write it again with `residuald design`"
    )]
    UnknownVersion {
        /// Its version.
        found: i64,
    },
    /// Not a number, or infinite.
    #[error(
        "the gains file holds {value} at {path}; all its numbers are finite, write it again with `residuald design`"
    )]
    NotFinite {
        /// Where: dotted path in the file.
        path: String,
        /// The number.
        value: f64,
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
    /// Gains for a diagnoser that is not there.
    #[error(
        "the gains file has gains for `{name}`, which is no diagnoser of the configuration; it belongs to another configuration, write it again with `residuald design`"
    )]
    Stranger {
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
    /// Gains for another sampling period.
    #[error(
        "the gains of `{name}` were designed for a period of {found} s, not {expected} s; write the file again with `residuald design`"
    )]
    OtherPeriod {
        /// The diagnoser.
        name: String,
        /// The file's period, s.
        found: f64,
        /// The configuration's, s.
        expected: f64,
    },
    /// Gains of another plant or with other options.
    #[error(
        "the gains of `{name}` were designed for another model or other options ({found}, not {expected}); write the file again with `residuald design`"
    )]
    OtherInputs {
        /// The diagnoser.
        name: String,
        /// The file's hash.
        found: String,
        /// The configuration's.
        expected: String,
    },
    /// What cannot be written as TOML.
    #[error("the gains cannot be written: {0}")]
    Unwritable(String),
    /// A number that the gains do not bear out.
    #[error(
        "the gains of `{name}` do not achieve what the file states: {place} is stated as {stated}, the gains give {recomputed}; the file was altered, write it again with `residuald design`"
    )]
    NotAchieved {
        /// The diagnoser.
        name: String,
        /// Where: dotted path in the diagnoser's entry.
        key: String,
        /// Where, in words.
        place: String,
        /// What the file states.
        stated: String,
        /// What the gains give.
        recomputed: String,
    },
    /// A condition that does not hold.
    #[error(
        "the gains of `{name}` violate the condition `{condition}`: its margin is {margin:e}; design the gains again"
    )]
    Violated {
        /// The diagnoser.
        name: String,
        /// The condition.
        condition: String,
        /// Its margin, negative.
        margin: f64,
    },
    /// A norm smaller than any gain can make it.
    #[error(
        "the gains of `{name}` seem to achieve {norm} = {value:e}, less than the possible {bound:e}; the design is numerically unsound, scale the model better and design again"
    )]
    BelowBound {
        /// The diagnoser.
        name: String,
        /// Which norm.
        norm: String,
        /// Its value.
        value: f64,
        /// The smallest possible value.
        bound: f64,
    },
}

impl GainsError {
    /// Where to look: dotted path in the diagnoser's entry, or in the file for what concerns all of it.
    pub fn key(&self) -> &str {
        match self {
            Self::Unreadable { .. } | Self::Unwritable(_) => "",
            Self::UnknownVersion { .. } => "version",
            Self::NotFinite { path, .. } => path,
            Self::Tolerance(_) => "tolerance",
            Self::NoEntry { .. } => "diagnoser",
            Self::SeveralEntries { .. } | Self::Stranger { .. } => "name",
            Self::OtherMethod { .. } => "method",
            Self::OtherPeriod { .. } => "sample_time_s",
            Self::OtherInputs { .. } => "inputs",
            Self::NotAchieved { key, .. } => key,
            Self::Violated { .. } | Self::BelowBound { .. } => "gains",
        }
    }
}
