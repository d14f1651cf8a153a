//! Sums over a sliding window in constant time, exact again after every turn.

use crate::matrix::all_finite;
use serde::{Deserialize, Serialize};

/// Σ v over the last N values, or over all values.
///
/// The running sum is replaced by a freshly added one whenever the ring has turned, so that rounding errors of large
/// values do not stay for ever. Only finite values may be pushed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WindowEnergy {
    /// The last N values; empty for a sum over all values.
    ring: Vec<f64>,
    next: usize,
    running: f64,
    fresh: f64,
}

impl WindowEnergy {
    /// An empty window of `length` values; `None` sums over all values.
    pub fn new(length: Option<usize>) -> Self {
        Self {
            ring: vec![0.0; length.unwrap_or(0)],
            next: 0,
            running: 0.0,
            fresh: 0.0,
        }
    }

    /// Takes the value of one instant (>= 0) and returns the sum.
    pub fn push(&mut self, value: f64) -> f64 {
        match self.ring.get_mut(self.next) {
            None => self.running += value,
            Some(oldest) => {
                self.running += value - *oldest;
                self.fresh += value;
                *oldest = value;
                self.next += 1;
                if self.next == self.ring.len() {
                    self.running = self.fresh;
                    self.fresh = 0.0;
                    self.next = 0;
                }
            }
        }
        self.sum()
    }

    /// The sum.
    pub fn sum(&self) -> f64 {
        // Rounding may leave less than nothing; what is not a number stays visible.
        if self.running < 0.0 { 0.0 } else { self.running }
    }

    /// Forgets all values.
    pub fn clear(&mut self) {
        self.ring.fill(0.0);
        self.next = 0;
        self.running = 0.0;
        self.fresh = 0.0;
    }

    /// Whether a saved window has the length of this one, stands at a place of it, and holds numbers.
    pub(super) fn fits(&self, other: &Self) -> bool {
        self.ring.len() == other.ring.len()
            && self.next < self.ring.len().max(1)
            && all_finite(&self.ring)
            && all_finite(&[self.running, self.fresh])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spike_leaves_no_error_behind_after_one_turn() {
        let mut window = WindowEnergy::new(Some(100));
        let small = |k: usize| 1e-7 * (1.0 + (k as f64).sin());
        let mut naive = 0.0;
        let value = |k: usize| if k == 150 { 1e8 } else { small(k) };
        for k in 0..1000 {
            naive += value(k) - if k >= 100 { value(k - 100) } else { 0.0 };
            window.push(value(k));
        }
        let exact: f64 = (900..1000).map(value).sum();
        assert!((window.sum() - exact).abs() < 1e-19);
        assert!((naive - exact).abs() > 1e-10, "the naive update keeps its error");
    }

    #[test]
    fn without_a_length_everything_counts() {
        let mut all = WindowEnergy::new(None);
        (0..1000).for_each(|_| {
            all.push(0.5);
        });
        assert_eq!(all.sum(), 500.0);
    }
}
