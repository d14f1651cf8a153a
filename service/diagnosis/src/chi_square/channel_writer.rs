//! Channels of the statistics, and what they say of the decision (method sheet 4, "Channels").

use super::{
    engine::{Outcome, Statistic},
    options::StatisticKind,
    thresholds::{Thresholds, threshold},
};
use crate::diagnoser::Channel;

/// What the decision says at an instant.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Tested {
    /// Some statistic of the decision could be evaluated.
    pub evaluated: bool,
    /// One of them is beyond its bound.
    pub alarm: bool,
}

/// Puts channels into a record one after the other.
pub(super) struct Writer<'a> {
    slots: std::slice::IterMut<'a, Channel>,
    pub tested: Tested,
}

impl<'a> Writer<'a> {
    pub fn new(slots: &'a mut [Channel]) -> Self {
        Self {
            slots: slots.iter_mut(),
            tested: Tested::default(),
        }
    }

    pub fn put(&mut self, channel: Channel) {
        if let Some(slot) = self.slots.next() {
            *slot = channel;
        }
    }

    /// A channel of the decision, or one for information.
    fn judged(&mut self, channel: Channel, decides: bool) {
        let channel = if decides || !channel.is_evaluated() {
            channel
        } else {
            Channel {
                ratio: 0.0,
                ..channel
            }
        };
        if decides && channel.is_evaluated() {
            self.tested.evaluated = true;
            self.tested.alarm |= channel.ratio > 1.0;
        }
        self.put(channel);
    }

    pub fn statistic(
        &mut self,
        kind: StatisticKind,
        decides: bool,
        outcome: &Outcome,
        thresholds: &Thresholds,
        measurements: usize,
    ) {
        let test =
            |statistic: Statistic, list: &[f64]| one_sided(statistic.value, threshold(list, &statistic));
        match kind {
            StatisticKind::Residual => self.judged(test(outcome.residual, &thresholds.residual), decides),
            StatisticKind::StatePlain => self.judged(test(outcome.plain, &thresholds.plain), decides),
            StatisticKind::StateTwoPropagator => self.judged(test(outcome.pair, &thresholds.pair), decides),
            StatisticKind::StateWindow => {
                let mut largest = f64::NEG_INFINITY;
                for (_, window) in outcome.windows() {
                    self.judged(test(window, &thresholds.window), decides);
                    if window.degrees > 0 {
                        largest = largest.max(window.value / threshold(&thresholds.bank_reference, &window));
                    }
                }
                if outcome.windows().count() > 1 {
                    let bank = if largest >= 0.0 {
                        one_sided(largest, thresholds.bank)
                    } else {
                        Channel::NOT_EVALUATED
                    };
                    self.judged(bank, decides);
                }
            }
            StatisticKind::Glr => {
                let best = outcome.likelihood_ratio();
                let channel = best.map_or(Channel::NOT_EVALUATED, |best| {
                    one_sided(best.value, thresholds.glr)
                });
                self.judged(channel, decides);
            }
            StatisticKind::Cusum => {
                for row in 0..measurements {
                    let arrived = outcome.innovations().any(|(available, ..)| available == row);
                    let channel = match outcome.cusum.get(row) {
                        Some(value) if arrived => Channel::two_sided(*value, thresholds.cusum),
                        _ => Channel::NOT_EVALUATED,
                    };
                    self.judged(channel, decides);
                }
            }
        }
    }
}

/// (0, value, threshold); not evaluated without a finite threshold, infinite for a value that is not a number.
fn one_sided(value: f64, threshold: f64) -> Channel {
    if !threshold.is_finite() {
        return Channel::NOT_EVALUATED;
    }
    let value = if value.is_nan() { f64::INFINITY } else { value };
    Channel {
        lower: 0.0,
        residual: value,
        upper: threshold,
        ratio: value / threshold,
    }
}

/// A value with its half width that never alarms.
pub(super) fn informative(value: f64, half_width: f64) -> Channel {
    Channel {
        lower: -half_width,
        residual: value,
        upper: half_width,
        ratio: 0.0,
    }
}
