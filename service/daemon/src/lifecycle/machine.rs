//! The states of an alarm and their transitions.

use residual_shared::alarm::{AlarmState, alarm_flags};
use residual_shared::record::{StepRecord, Verdict};

use super::rules::{MAX_WINDOW, Rules};
use super::state::LifecycleState;

/// A new state of an alarm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Change {
    /// The state.
    pub state: AlarmState,
    /// Bits of [`alarm_flags`].
    pub flags: u32,
    /// How often the alarm has been raised, this time included.
    pub occurrence: u64,
}

/// What one step changed, in order: at most raised and isolated at once.
pub type Changes = std::iter::Flatten<std::array::IntoIter<Option<Change>, 2>>;

/// What one evaluated step means for the alarm.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Judgement {
    /// It counts for raising.
    Violation,
    /// It counts neither for raising nor for clearing.
    Neither,
    /// It counts for clearing.
    Quiet,
}

/// The alarm of one diagnoser.
#[derive(Clone, Debug)]
pub struct Lifecycle {
    rules: Rules,
    state: LifecycleState,
}

impl Lifecycle {
    /// A cleared alarm that has never been raised.
    pub fn new(rules: Rules) -> Self {
        let raise_window = rules.raise_window.clamp(1, MAX_WINDOW);
        Self {
            rules: Rules {
                raise_window,
                raise_steps: rules.raise_steps.clamp(1, raise_window),
                clear_steps: rules.clear_steps.max(1),
                ..rules
            },
            state: LifecycleState::default(),
        }
    }

    /// Where it stands.
    pub fn state(&self) -> AlarmState {
        self.state.alarm
    }

    /// Everything that changes from step to step.
    pub fn save(&self) -> LifecycleState {
        self.state
    }

    /// Goes on from a saved or shown state.
    pub fn restore(&mut self, state: &LifecycleState) {
        self.state = state.fitting(&self.rules);
    }

    /// Takes the next record; bit i of `enabled`: channel i is enabled at its instant.
    pub fn advance(&mut self, record: &StepRecord, enabled: u64) -> Changes {
        let verdict = record.verdict();
        let evaluated = !matches!(verdict, Verdict::Starting | Verdict::NotEvaluated);
        let suppressed = self.is_suppressed(record, evaluated);
        if !evaluated {
            return none();
        }
        let judgement = self.judge(record, enabled, suppressed);
        let violates = judgement == Judgement::Violation;
        let (rules, state) = (self.rules, &mut self.state);
        state.window = (state.window << 1 | u64::from(violates)) & window_mask(rules.raise_window);
        state.quiet_steps = match judgement {
            Judgement::Quiet => (state.quiet_steps + 1).min(rules.clear_steps),
            _ => 0,
        };
        let first = match state.alarm {
            AlarmState::Cleared | AlarmState::Pending => {
                if violates && state.window.count_ones() >= rules.raise_steps {
                    state.occurrences += 1;
                    self.change(AlarmState::Raised)
                } else if state.alarm == AlarmState::Cleared && state.window != 0 {
                    self.change(AlarmState::Pending)
                } else if state.alarm == AlarmState::Pending && state.window == 0 {
                    self.change(AlarmState::Cleared)
                } else {
                    None
                }
            }
            AlarmState::Raised | AlarmState::Isolated => self.clear_if_over(),
        };
        let faulty = Some(record.certainly_faulty);
        let isolates = violates && verdict == Verdict::Isolated && self.state.alarm.is_active();
        let second = if isolates && self.state.isolated != faulty {
            self.state.isolated = faulty;
            self.change(AlarmState::Isolated)
        } else {
            None
        };
        [first, second].into_iter().flatten()
    }

    /// How often the alarm has been raised.
    pub fn occurrences(&self) -> u64 {
        self.state.occurrences
    }

    /// Goes on counting where the alarm of an earlier diagnoser of the same name has stopped.
    pub fn count_from(&mut self, occurrences: u64) {
        self.state.occurrences = occurrences;
    }

    /// Somebody has seen the alarm: it is marked acknowledged, and cleared if only the latch still held it.
    ///
    /// None if no fault is reported or it is acknowledged already.
    pub fn acknowledge(&mut self) -> Option<Change> {
        if !self.state.alarm.is_active() || self.state.acknowledged {
            return None;
        }
        self.state.acknowledged = true;
        self.clear_if_over().or_else(|| self.change(self.state.alarm))
    }

    /// The diagnoser begins anew, and so does everything here but the count of occurrences; the change if there
    /// was anything to clear.
    pub fn reset(&mut self) -> Option<Change> {
        let was_cleared = self.state.alarm == AlarmState::Cleared;
        let occurrences = self.state.occurrences;
        self.state = LifecycleState {
            occurrences,
            ..LifecycleState::default()
        };
        (!was_cleared).then_some(Change {
            state: AlarmState::Cleared,
            flags: alarm_flags::RESET,
            occurrence: occurrences,
        })
    }

    /// The diagnoser is gone, and with it its alarm; the change if there was anything to clear.
    pub fn withdraw(&mut self) -> Option<Change> {
        let change = self.reset()?;
        Some(Change {
            flags: alarm_flags::WITHDRAWN,
            ..change
        })
    }

    /// Whether start-up suppression covers the instant of `record`, which is counted.
    fn is_suppressed(&mut self, record: &StepRecord, evaluated: bool) -> bool {
        let instants = &mut self.state.instants;
        *instants = match *instants {
            Some(before) => Some(before.saturating_add(1 + u64::from(record.skipped_instants))),
            None => evaluated.then_some(0),
        };
        instants.is_none_or(|instant| instant < self.rules.suppressed_instants)
    }

    fn judge(&mut self, record: &StepRecord, enabled: u64, suppressed: bool) -> Judgement {
        let above = |ratio: f64| {
            let channels = record.channels().iter().enumerate();
            channels
                .filter(|(_, channel)| channel.ratio > ratio)
                .fold(0_u64, |set, (index, _)| set | 1 << index)
        };
        let faulty = matches!(
            record.verdict(),
            Verdict::Fault | Verdict::Isolated | Verdict::GuaranteeLost
        );
        let beyond = above(1.0);
        if !faulty {
            self.state.excused = false;
        } else if beyond != 0 {
            self.state.excused = beyond & enabled == 0;
        }
        if faulty && !self.state.excused {
            if suppressed {
                Judgement::Neither
            } else {
                Judgement::Violation
            }
        } else if above(self.rules.clear_ratio) & enabled != 0 {
            Judgement::Neither
        } else {
            Judgement::Quiet
        }
    }

    /// Clears an active alarm after enough quiet steps, unless it is latched and nobody has acknowledged it.
    fn clear_if_over(&mut self) -> Option<Change> {
        let held = self.rules.latch && !self.state.acknowledged;
        let over = self.state.quiet_steps >= self.rules.clear_steps;
        (over && !held)
            .then(|| self.change(AlarmState::Cleared))
            .flatten()
    }

    fn change(&mut self, alarm: AlarmState) -> Option<Change> {
        let state = &mut self.state;
        let latched = self.rules.latch && alarm.is_active();
        let flags = [
            (latched, alarm_flags::LATCHED),
            (state.acknowledged, alarm_flags::ACKNOWLEDGED),
        ];
        let flags = flags.iter().filter(|(set, _)| *set);
        let change = Change {
            state: alarm,
            flags: flags.fold(0, |flags, (_, flag)| flags | flag),
            occurrence: state.occurrences,
        };
        if alarm == AlarmState::Cleared {
            state.clear();
        }
        state.alarm = alarm;
        Some(change)
    }
}

fn none() -> Changes {
    [None, None].into_iter().flatten()
}

/// The last `steps` steps of a window.
pub(super) fn window_mask(steps: u32) -> u64 {
    u64::MAX >> (MAX_WINDOW - steps.clamp(1, MAX_WINDOW))
}
