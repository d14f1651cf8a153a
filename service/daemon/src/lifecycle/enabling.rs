//! Which channels count, by the values of other signals.

use crate::configuration::SignalReference;

use super::ALL_CHANNELS;

/// Some channels count only while a signal lies in a range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EnableCondition {
    /// Bit i: it concerns channel i.
    pub channels: u64,
    /// The signal.
    pub signal: SignalReference,
    /// Lowest and highest value at which the channels count.
    pub range: [f64; 2],
}

/// The conditions of one diagnoser; all that concern a channel must hold.
#[derive(Clone, Debug, Default)]
pub struct Enabling {
    conditions: Vec<EnableCondition>,
}

impl Enabling {
    /// The conditions together.
    pub fn new(conditions: Vec<EnableCondition>) -> Self {
        Self { conditions }
    }

    /// The signals that decide.
    pub fn signals(&self) -> impl Iterator<Item = SignalReference> {
        self.conditions.iter().map(|condition| condition.signal)
    }

    /// The set of enabled channels; `value_of` gives the newest value of a signal, none before the first one.
    pub fn enabled(&self, mut value_of: impl FnMut(SignalReference) -> Option<f64>) -> u64 {
        self.conditions.iter().fold(ALL_CHANNELS, |enabled, condition| {
            let [low, high] = condition.range;
            match value_of(condition.signal) {
                Some(value) if (low..=high).contains(&value) => enabled,
                _ => enabled & !condition.channels,
            }
        })
    }
}
