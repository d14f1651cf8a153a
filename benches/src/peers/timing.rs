//! Processor times of repeated rounds.

use std::time::Duration;

use anyhow::Result;
use nix::time::{ClockId, clock_gettime};

/// Mean times of one step, nanoseconds, one for each round.
#[derive(Clone, Debug, Default)]
pub struct Times(Vec<f64>);

impl Times {
    /// Adds a round that took `time` for so many steps.
    pub fn add(&mut self, time: Duration, steps: usize) {
        self.0.push(time.as_nanos() as f64 / steps as f64);
    }

    /// How many rounds there were.
    pub fn rounds(&self) -> usize {
        self.0.len()
    }

    /// The median of all rounds.
    pub fn median(&self) -> f64 {
        let mut sorted = self.0.clone();
        sorted.sort_by(f64::total_cmp);
        sorted.get(sorted.len() / 2).copied().unwrap_or(f64::NAN)
    }

    /// The best round.
    pub fn best(&self) -> f64 {
        self.0.iter().copied().fold(f64::INFINITY, f64::min)
    }
}

/// What this thread has used of a processor.
///
/// # Errors
/// The system has no such clock.
pub fn processor_time() -> Result<Duration> {
    Ok(clock_gettime(ClockId::CLOCK_THREAD_CPUTIME_ID)?.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_and_the_best_of_the_rounds_are_told() {
        let mut times = Times::default();
        assert!(times.median().is_nan());
        for nanoseconds in [50, 10, 90, 20, 30] {
            times.add(Duration::from_nanos(nanoseconds), 10);
        }
        assert_eq!((times.rounds(), times.median(), times.best()), (5, 3.0, 1.0));
    }

    #[test]
    fn processor_time_grows_with_work() {
        let begin = processor_time().unwrap();
        while processor_time().unwrap() == begin {
            std::hint::black_box(0);
        }
    }
}
