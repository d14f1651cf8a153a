//! Times as percentiles.

use hdrhistogram::Histogram;
use residuald::summary::StepTimes;
use serde::{Deserialize, Serialize};

/// Heads of the columns that [`Percentiles::cells`] fills.
pub const COLUMNS: [&str; 6] = ["samples", "p50", "p90", "p99", "p99.9", "max"];

/// Percentiles of times, nanoseconds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Percentiles {
    /// How many times were measured.
    pub samples: u64,
    /// The median.
    pub p50: u64,
    /// 90 of 100 are not longer.
    pub p90: u64,
    /// 99 of 100 are not longer.
    pub p99: u64,
    /// 999 of 1,000 are not longer.
    pub p999: u64,
    /// The longest.
    pub max: u64,
}

impl Percentiles {
    /// The percentiles of `times`.
    pub fn of(times: &Histogram<u64>) -> Self {
        Self {
            samples: times.len(),
            p50: times.value_at_quantile(0.5),
            p90: times.value_at_quantile(0.9),
            p99: times.value_at_quantile(0.99),
            p999: times.value_at_quantile(0.999),
            max: times.max(),
        }
    }

    /// One cell for each of [`COLUMNS`].
    pub fn cells(&self) -> Vec<String> {
        let times = [self.p50, self.p90, self.p99, self.p999, self.max];
        let times = times.map(|time| duration(time as f64));
        std::iter::once(self.samples.to_string()).chain(times).collect()
    }
}

/// The longest time that a histogram holds without growing, nanoseconds.
const LONGEST_NS: u64 = 60_000_000_000;

impl From<StepTimes> for Percentiles {
    /// Those that a daemon has counted.
    fn from(times: StepTimes) -> Self {
        Self {
            samples: times.count,
            p50: times.p50_ns,
            p90: times.p90_ns,
            p99: times.p99_ns,
            p999: times.p999_ns,
            max: times.max_ns,
        }
    }
}

/// An empty histogram of nanoseconds with three significant digits. It has room for a minute, so that recording does
/// not allocate; longer times make it grow (`record`) or count as a minute (`saturating_record`).
#[expect(
    clippy::missing_panics_doc,
    clippy::expect_used,
    reason = "such bounds and three digits are always allowed"
)]
pub fn times() -> Histogram<u64> {
    let mut times = Histogram::new_with_bounds(1, LONGEST_NS, 3).expect("allowed bounds");
    times.auto(true);
    times
}

/// Every time that was measured and how often: what one process tells another.
pub type Counts = Vec<(u64, u64)>;

/// The times of a histogram.
pub fn counts(times: &Histogram<u64>) -> Counts {
    let values = times.iter_recorded();
    values
        .map(|value| (value.value_iterated_to(), value.count_at_value()))
        .collect()
}

/// The histogram of these times.
pub fn times_of(counts: &Counts) -> Histogram<u64> {
    let mut all = times();
    add(&mut all, counts);
    all
}

/// Adds times to a histogram.
pub fn add(times: &mut Histogram<u64>, counts: &Counts) {
    for &(time, count) in counts {
        times.saturating_record_n(time, count);
    }
}

/// A number of nanoseconds with three significant digits and a fitting unit.
pub fn duration(nanoseconds: f64) -> String {
    let (value, unit) = match nanoseconds.abs() {
        size if size >= 1e9 => (nanoseconds / 1e9, "s"),
        size if size >= 1e6 => (nanoseconds / 1e6, "ms"),
        size if size >= 1e3 => (nanoseconds / 1e3, "µs"),
        _ => (nanoseconds, "ns"),
    };
    format!("{} {unit}", significant(value))
}

/// `value` with three significant digits, without an exponent.
pub fn significant(value: f64) -> String {
    let whole = if value == 0.0 {
        0.0
    } else {
        value.abs().log10().floor()
    };
    let decimals = (2.0 - whole).clamp(0.0, 9.0) as usize;
    let text = format!("{value:.decimals$}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_have_three_digits_and_a_fitting_unit() {
        assert_eq!(duration(0.0), "0 ns");
        assert_eq!(duration(20.36), "20.4 ns");
        assert_eq!(duration(1_234.0), "1.23 µs");
        assert_eq!(duration(30e6), "30 ms");
        assert_eq!(duration(154e9), "154 s");
        assert_eq!(significant(12_345.6), "12346");
        assert_eq!(significant(0.012_345), "0.0123");
    }

    #[test]
    fn percentiles_are_those_of_the_histogram() {
        let mut all = times();
        (1..=1000).for_each(|time| all.record(time).unwrap());
        let percentiles = Percentiles::of(&all);
        assert_eq!(
            (percentiles.samples, percentiles.p50, percentiles.max),
            (1000, 500, 1000)
        );
        assert_eq!(percentiles.cells().len(), COLUMNS.len());
    }

    #[test]
    fn times_survive_the_way_to_another_process() {
        let mut all = times();
        [3, 70, 70, 5_000_000_000]
            .iter()
            .for_each(|&time| all.record(time).unwrap());
        assert_eq!(Percentiles::of(&times_of(&counts(&all))), Percentiles::of(&all));
    }
}
