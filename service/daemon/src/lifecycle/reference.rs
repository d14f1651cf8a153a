//! The definitions of the [module](super) once more, by looking back over the whole history at every step.

use residual_shared::alarm::{AlarmState, alarm_flags};
use residual_shared::record::{StepRecord, Verdict};

use super::{Change, Rules};

/// One sampling instant.
#[derive(Clone, Copy, Debug)]
pub(super) struct Instant {
    pub record: StepRecord,
    pub enabled: u64,
}

impl Instant {
    fn is_evaluated(&self) -> bool {
        !matches!(self.record.verdict(), Verdict::Starting | Verdict::NotEvaluated)
    }

    fn has_faulty_verdict(&self) -> bool {
        matches!(
            self.record.verdict(),
            Verdict::Fault | Verdict::Isolated | Verdict::GuaranteeLost
        )
    }

    fn ratios(&self) -> impl Iterator<Item = (bool, f64)> {
        let channels = self.record.channels().iter().enumerate();
        channels.map(|(index, channel)| (self.enabled >> index & 1 == 1, channel.ratio))
    }
}

/// The alarm with all that it has seen.
pub(super) struct Reference {
    rules: Rules,
    history: Vec<Instant>,
    /// Length of the history when the alarm was cleared last, by itself or by a reset.
    cleared_at: usize,
    reset_at: usize,
    alarm: AlarmState,
    acknowledged: bool,
    occurrences: u64,
    told: Option<u64>,
}

impl Reference {
    pub fn new(rules: Rules) -> Self {
        Self {
            rules,
            history: Vec::new(),
            cleared_at: 0,
            reset_at: 0,
            alarm: AlarmState::Cleared,
            acknowledged: false,
            occurrences: 0,
            told: None,
        }
    }

    /// The evaluated instants of `history[from..]` with their places.
    fn evaluated(&self, from: usize) -> impl DoubleEndedIterator<Item = (usize, &Instant)> {
        let instants = self.history.iter().enumerate().skip(from);
        instants.filter(|(_, instant)| instant.is_evaluated())
    }

    fn is_faulty(&self, place: usize) -> bool {
        // The unbroken run of faulty verdicts up to here, newest first.
        let since_reset = &self.history[self.reset_at..=place];
        let evaluated = since_reset.iter().rev().filter(|instant| instant.is_evaluated());
        let mut run = evaluated
            .take_while(|instant| instant.has_faulty_verdict())
            .peekable();
        if run.peek().is_none() {
            return false;
        }
        let judged = run.find(|instant| instant.ratios().any(|(_, ratio)| ratio > 1.0));
        judged.is_none_or(|instant| instant.ratios().any(|(enabled, ratio)| enabled && ratio > 1.0))
    }

    fn is_suppressed(&self, place: usize) -> bool {
        let first = self
            .evaluated(self.reset_at)
            .next()
            .map_or(place, |(first, _)| first);
        let passed: u64 = self.history[first..=place]
            .iter()
            .skip(1)
            .map(|instant| 1 + u64::from(instant.record.skipped_instants))
            .sum();
        passed < self.rules.suppressed_instants
    }

    fn violates(&self, place: usize) -> bool {
        self.is_faulty(place) && !self.is_suppressed(place)
    }

    fn is_quiet(&self, place: usize) -> bool {
        let near = |(enabled, ratio): (bool, f64)| enabled && ratio > self.rules.clear_ratio;
        !self.is_faulty(place) && !self.history[place].ratios().any(near)
    }

    fn is_over(&self) -> bool {
        let steps = self.rules.clear_steps as usize;
        let last: Vec<usize> = self
            .evaluated(self.cleared_at)
            .rev()
            .take(steps)
            .map(|(place, _)| place)
            .collect();
        last.len() == steps && last.iter().all(|&place| self.is_quiet(place))
    }

    fn set(&mut self, alarm: AlarmState) -> Change {
        self.alarm = alarm;
        let latched = self.rules.latch && alarm.is_active();
        let mut flags = 0;
        if latched {
            flags |= alarm_flags::LATCHED;
        }
        if self.acknowledged {
            flags |= alarm_flags::ACKNOWLEDGED;
        }
        if alarm == AlarmState::Cleared {
            self.cleared_at = self.history.len();
            self.acknowledged = false;
            self.told = None;
        }
        Change {
            state: alarm,
            flags,
            occurrence: self.occurrences,
        }
    }

    pub fn advance(&mut self, instant: Instant) -> Vec<Change> {
        self.history.push(instant);
        if !instant.is_evaluated() {
            return vec![];
        }
        let newest = self.history.len() - 1;
        let mut changes = vec![];
        if self.alarm.is_active() {
            if self.is_over() && (!self.rules.latch || self.acknowledged) {
                changes.push(self.set(AlarmState::Cleared));
            }
        } else {
            let window = self
                .evaluated(self.cleared_at)
                .rev()
                .take(self.rules.raise_window as usize);
            let violations = window.filter(|(place, _)| self.violates(*place)).count() as u32;
            if violations >= self.rules.raise_steps {
                self.occurrences += 1;
                changes.push(self.set(AlarmState::Raised));
            } else if (violations > 0) != (self.alarm == AlarmState::Pending) {
                let alarm = if violations > 0 {
                    AlarmState::Pending
                } else {
                    AlarmState::Cleared
                };
                changes.push(self.set(alarm));
            }
        }
        let faulty = Some(instant.record.certainly_faulty);
        let isolates = instant.record.verdict() == Verdict::Isolated && self.violates(newest);
        if self.alarm.is_active() && isolates && self.told != faulty {
            self.told = faulty;
            changes.push(self.set(AlarmState::Isolated));
        }
        changes
    }

    pub fn acknowledge(&mut self) -> Option<Change> {
        if !self.alarm.is_active() || self.acknowledged {
            return None;
        }
        self.acknowledged = true;
        let alarm = if self.is_over() {
            AlarmState::Cleared
        } else {
            self.alarm
        };
        Some(self.set(alarm))
    }

    pub fn reset(&mut self) -> Option<Change> {
        let was = self.alarm;
        self.acknowledged = false;
        let change = self.set(AlarmState::Cleared);
        self.reset_at = self.history.len();
        let flags = alarm_flags::RESET;
        (was != AlarmState::Cleared).then_some(Change { flags, ..change })
    }
}
