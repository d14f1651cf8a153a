//! Two-sided cumulative sums of the normalised innovations (method sheet 4, step 9).

use super::filter::Correction;
use serde::{Deserialize, Serialize};

/// The sums of every sensor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Cusum {
    /// p_i: grows with positive innovations.
    pub upper: Vec<f64>,
    /// q_i: grows with negative innovations.
    pub lower: Vec<f64>,
}

impl Cusum {
    pub fn new(measurements: usize) -> Self {
        Self {
            upper: vec![0.0; measurements],
            lower: vec![0.0; measurements],
        }
    }

    pub fn clear(&mut self) {
        self.upper.fill(0.0);
        self.lower.fill(0.0);
    }

    /// c = ν_i / sqrt(S_ii), p_i = max(0, p_i + c - ref), q_i = max(0, q_i - c - ref); missing rows keep their sums.
    pub fn step(&mut self, reference: f64, update: &Correction) {
        for ((row, innovation), variance) in update.rows.iter().zip(&update.innovation).zip(&update.variance)
        {
            let c = innovation / variance.sqrt();
            for (sums, c) in [(&mut self.upper, c), (&mut self.lower, -c)] {
                if let Some(sum) = sums.get_mut(*row) {
                    let next = *sum + c - reference;
                    // Unlike f64::max this keeps a value that is not a number, which restarts the diagnoser.
                    *sum = if next < 0.0 { 0.0 } else { next };
                }
            }
        }
    }

    /// max(p_i, q_i) with the sign of the larger side.
    pub fn signed(&self, row: usize) -> f64 {
        let side = |sums: &[f64]| sums.get(row).copied().unwrap_or(0.0);
        let (upper, lower) = (side(&self.upper), side(&self.lower));
        if upper >= lower { upper } else { -lower }
    }

    pub fn is_finite(&self) -> bool {
        self.upper.iter().chain(&self.lower).all(|sum| sum.is_finite())
    }

    pub fn fits(&self, other: &Self) -> bool {
        self.upper.len() == other.upper.len() && self.lower.len() == other.lower.len()
    }
}
