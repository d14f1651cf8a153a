//! Limits of the counts among the options: what lies beyond takes memory and time but finds nothing more.

use super::options::{PreSamples, UnknownInputFilterOptions};
use super::options_error::OptionsError;
use std::ops::RangeInclusive;

/// Largest number of fault durations with parity tests of their own.
const MAX_PARITY_LENGTHS: usize = 16;

impl UnknownInputFilterOptions {
    /// Checks every count against its limits.
    ///
    /// # Errors
    /// [`OptionsError`] for the first that is outside.
    pub(super) fn validate_counts(&self) -> Result<(), OptionsError> {
        in_range(
            "filter.generator_order",
            self.filter.generator_order,
            0..=1000,
            "at most 1000 columns are allowed, and some tens are enough",
        )?;
        in_range(
            "filter.gain_sweeps",
            [self.filter.gain_sweeps],
            0..=6,
            "0 to 6 sweeps are allowed; more do not narrow the sets",
        )?;
        in_range(
            "bank.max_isolation_window",
            self.bank.max_isolation_window,
            1..=10_000,
            "1 to 10000 samples are allowed; leave it out for four times the number of states",
        )?;
        in_range(
            "bank.clear_samples",
            [self.bank.clear_samples as usize],
            0..=1_000_000_000,
            "at most 1000000000 instants are allowed; use 0 to end episodes only on request",
        )?;
        in_range(
            "parity.lengths",
            self.parity.lengths.iter().copied(),
            1..=1000,
            "1 to 1000 samples are allowed; use an empty list to switch the parity tests off",
        )?;
        let pre_samples = match self.parity.pre_samples {
            PreSamples::Auto => None,
            PreSamples::Count(count) => Some(count),
        };
        in_range(
            "parity.pre_samples",
            pre_samples,
            0..=1000,
            "at most 1000 samples are allowed; leave it out for 0 or 30, as the outputs demand",
        )?;
        let lengths = self.parity.lengths.len();
        if lengths > MAX_PARITY_LENGTHS {
            return Err(OptionsError::DimensionMismatch {
                key: "parity.lengths",
                actual: format!("a list of length {lengths}"),
                expected: format!("a list of length {MAX_PARITY_LENGTHS} at most"),
            });
        }
        Ok(())
    }
}

fn in_range(
    key: &'static str,
    values: impl IntoIterator<Item = usize>,
    range: RangeInclusive<usize>,
    allowed: &'static str,
) -> Result<(), OptionsError> {
    match values.into_iter().find(|value| !range.contains(value)) {
        Some(value) => Err(OptionsError::OutOfRange {
            key,
            value: value as f64,
            allowed,
        }),
        None => Ok(()),
    }
}
