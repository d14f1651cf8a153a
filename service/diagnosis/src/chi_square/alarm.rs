//! Confirmation, clearing and isolation (method sheet 4, "Alarm" and "Isolation").

use super::{engine::Outcome, glr::LikelihoodRatio};
use serde::{Deserialize, Serialize};

/// Rules that do not change.
#[derive(Clone, Copy, Debug)]
pub(super) struct AlarmRules {
    pub confirm_steps: u32,
    pub clear_steps: u32,
    pub warmup_steps: u32,
    pub isolation_margin: f64,
    /// M - s: an onset this long ago may be older in truth.
    pub window_edge: u64,
}

/// The component that was declared faulty.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Isolated {
    pub component: usize,
    /// The onset lay at the edge of the window: it may be older, and the component another one.
    pub at_window_edge: bool,
}

/// Counters and verdict.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct AlarmState {
    /// Instants with a raw alarm in a row.
    alarmed: u32,
    /// Instants without in a row.
    quiet: u32,
    /// Instants left of the warm-up.
    pub warmup: u32,
    /// Whether a fault is confirmed.
    pub fault: bool,
    pub isolated: Option<Isolated>,
}

impl AlarmState {
    pub fn new(rules: &AlarmRules) -> Self {
        Self {
            alarmed: 0,
            quiet: 0,
            warmup: rules.warmup_steps,
            fault: false,
            isolated: None,
        }
    }

    /// Back to the start.
    pub fn clear(&mut self, rules: &AlarmRules) {
        *self = Self::new(rules);
    }

    /// One tested instant; returns whether a confirmed alarm is on at this very instant.
    pub fn judge(&mut self, rules: &AlarmRules, raw_alarm: bool) -> bool {
        if self.warmup > 0 {
            self.warmup -= 1;
            return false;
        }
        if raw_alarm {
            self.alarmed = self.alarmed.saturating_add(1);
            self.quiet = 0;
            self.fault |= self.alarmed >= rules.confirm_steps;
        } else {
            self.alarmed = 0;
            self.quiet = self.quiet.saturating_add(1);
            if self.quiet >= rules.clear_steps {
                self.fault = false;
                self.isolated = None;
            }
        }
        raw_alarm && self.fault
    }

    /// Declares the component of the likeliest fault once it exceeds every other component by the margin; returns
    /// it at the first declaration.
    pub fn isolate(
        &mut self,
        rules: &AlarmRules,
        outcome: &Outcome,
        components: usize,
    ) -> Option<(usize, LikelihoodRatio)> {
        if self.isolated.is_some() {
            return None;
        }
        let value = |component: usize| {
            outcome
                .likelihood_ratio_of(component)
                .map_or(0.0, |found| found.value)
        };
        let best =
            (0..components).reduce(|best, next| if value(next) > value(best) { next } else { best })?;
        let other = (0..components)
            .filter(|other| *other != best)
            .map(value)
            .fold(0.0, f64::max);
        let found = outcome.likelihood_ratio_of(best)?;
        if !(found.value > other + rules.isolation_margin) {
            return None;
        }
        self.isolated = Some(Isolated {
            component: best,
            at_window_edge: found.age >= rules.window_edge,
        });
        Some((best, found))
    }

    pub fn fits(&self, components: usize) -> bool {
        self.isolated
            .is_none_or(|isolated| isolated.component < components)
    }
}
