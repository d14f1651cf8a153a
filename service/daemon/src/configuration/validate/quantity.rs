//! Seconds as written, whole nanoseconds as used.

use crate::configuration::locate::Mistakes;

const NANOSECONDS: f64 = 1e9;

/// Shortest period, 10 µs: below, waiting for the instant takes longer than the period.
const MIN_PERIOD_S: f64 = 10e-6;

/// Longest period, 1 h.
const MAX_PERIOD_S: f64 = 3600.0;

/// Relative deviation at which a period no longer counts as a whole number of nanoseconds.
const ROUNDING: f64 = 1e-9;

/// The period in nanoseconds, which must be a whole number of them: sampling instants never drift.
pub(super) fn period_ns(path: &str, seconds: f64, mistakes: &mut Mistakes<'_>) -> Option<u64> {
    if !(MIN_PERIOD_S..=MAX_PERIOD_S).contains(&seconds) {
        mistakes.at(
            path,
            format!("a period of {seconds} s is not possible"),
            format!("use {MIN_PERIOD_S} s (10 µs) to {MAX_PERIOD_S} s (1 h)"),
        );
        return None;
    }
    let exact = seconds * NANOSECONDS;
    let whole = exact.round();
    if (whole - exact).abs() > ROUNDING * exact {
        mistakes.at(
            path,
            format!("a period of {seconds} s is not a whole number of nanoseconds"),
            format!("write the period that the data have, for instance {}", whole / NANOSECONDS),
        );
        return None;
    }
    Some(whole as u64)
}

/// A duration between 0 and `limit_s` in nanoseconds, rounded to the nearest; `limit` explains the limit.
pub(super) fn duration_ns(
    path: &str,
    seconds: f64,
    limit_s: f64,
    limit: &str,
    mistakes: &mut Mistakes<'_>,
) -> Option<u64> {
    if !(0.0..=limit_s).contains(&seconds) {
        mistakes.at(path, format!("{seconds} s is outside what is possible here"), limit);
        return None;
    }
    Some((seconds * NANOSECONDS).round() as u64)
}
