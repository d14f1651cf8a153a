//! From mode probabilities to a declared mode (paper (81), method sheet 4.3).

use serde::{Deserialize, Serialize};

/// The decision rule: μ_T and L.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DecisionRule {
    /// μ_T: a probability above it counts.
    pub threshold: f64,
    /// L: for so many instants in a row.
    pub window_steps: u32,
}

/// Counters of the rule.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct DecisionState {
    /// The fault mode above the threshold at the last instant, 0 if none.
    pub candidate: usize,
    /// For how many instants it has been.
    pub run: u32,
    /// For how many instants 1 - μ⁰ has been above the threshold.
    pub detection_run: u32,
}

impl DecisionRule {
    /// Takes the probabilities of one more instant; the lowest index wins a tie.
    ///
    /// 1 - μ⁰ is summed up from the fault modes, so that it is never below any of them and detection never comes
    /// after isolation.
    pub fn update(&self, state: &mut DecisionState, probability: &[f64]) {
        let mut most_probable = (0, 0.0);
        for (mode, &mu) in probability.iter().enumerate().skip(1) {
            if mu > most_probable.1 {
                most_probable = (mode, mu);
            }
        }
        let (mode, mu) = most_probable;
        if mu > self.threshold {
            let same = state.candidate == mode;
            state.run = if same { state.run.saturating_add(1) } else { 1 };
            state.candidate = mode;
        } else {
            (state.run, state.candidate) = (0, 0);
        }
        if fault_probability(probability) > self.threshold {
            state.detection_run = state.detection_run.saturating_add(1);
        } else {
            state.detection_run = 0;
        }
    }

    /// The declared fault mode; 0 if none.
    pub fn declared_mode(&self, state: &DecisionState) -> usize {
        if state.run >= self.window_steps {
            state.candidate
        } else {
            0
        }
    }

    /// Whether a fault is detected, of whatever mode.
    pub fn fault_detected(&self, state: &DecisionState) -> bool {
        state.detection_run >= self.window_steps
    }
}

/// 1 - μ⁰ as the sum of the others.
pub fn fault_probability(probability: &[f64]) -> f64 {
    probability.iter().skip(1).sum()
}
