//! What of an alarm survives a restart.

use residual_shared::alarm::{AlarmState, alarm_flags};
use residual_shared::counters::AlarmStatus;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::machine::window_mask;
use super::rules::Rules;

/// Everything of a [`Lifecycle`](super::Lifecycle) that changes from step to step: restored, it goes on exactly.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LifecycleState {
    #[serde(serialize_with = "write_state", deserialize_with = "read_state")]
    pub(super) alarm: AlarmState,
    /// Bit i: the evaluated step i before the newest one violated. Counts while the alarm is not raised.
    pub(super) window: u64,
    /// Quiet evaluated steps in a row, at most c.
    pub(super) quiet_steps: u32,
    pub(super) acknowledged: bool,
    /// How often the alarm has been raised.
    pub(super) occurrences: u64,
    /// The certainly faulty components that were last told; none before any were.
    pub(super) isolated: Option<u64>,
    /// Whether the faulty verdict in force is excused.
    pub(super) excused: bool,
    /// Sampling instants since the first evaluated one; none before it.
    pub(super) instants: Option<u64>,
}

impl LifecycleState {
    /// What the bounds table of an earlier life shows of it; `isolated`: the certainly faulty components of its
    /// latest transition, if that is still known and was an isolation (unknown ones are told once more).
    ///
    /// An active alarm stays active, and so do latch, acknowledgement and count. Steps of the earlier life count
    /// no more: a pending alarm is raised or cleared by those of this life, and start-up suppression begins anew.
    pub fn shown(status: &AlarmStatus, isolated: Option<u64>) -> Self {
        let state = u32::try_from(status.state).ok();
        let alarm = state.and_then(AlarmState::from_number).unwrap_or_default();
        let acknowledged = status.flags & u64::from(alarm_flags::ACKNOWLEDGED) != 0;
        Self {
            alarm,
            acknowledged: alarm.is_active() && acknowledged,
            occurrences: status.occurrences,
            isolated: isolated.filter(|_| alarm == AlarmState::Isolated),
            ..Self::default()
        }
    }

    /// Whether the bounds table shows the same of it.
    pub fn agrees_with(&self, status: &AlarmStatus) -> bool {
        let shown = Self::shown(status, self.isolated);
        let visible = |state: &Self| (state.alarm, state.acknowledged, state.occurrences);
        visible(self) == visible(&shown)
    }

    /// What the bounds table shows of it; no transition is its latest.
    pub fn status(&self) -> AlarmStatus {
        let acknowledged = u64::from(alarm_flags::ACKNOWLEDGED) * u64::from(self.acknowledged);
        AlarmStatus {
            state: self.alarm as u64,
            flags: acknowledged,
            occurrences: self.occurrences,
            ..AlarmStatus::default()
        }
    }

    /// The same for a diagnoser that begins afresh: earlier steps count no more.
    pub fn without_steps(&self) -> Self {
        Self {
            alarm: self.alarm,
            acknowledged: self.acknowledged,
            occurrences: self.occurrences,
            isolated: self.isolated,
            ..Self::default()
        }
    }

    /// The same, as far as other rules permit: they may have changed since.
    pub(super) fn fitting(&self, rules: &Rules) -> Self {
        Self {
            window: self.window & window_mask(rules.raise_window),
            quiet_steps: self.quiet_steps.min(rules.clear_steps),
            ..*self
        }
    }

    pub(super) fn clear(&mut self) {
        *self = Self {
            occurrences: self.occurrences,
            excused: self.excused,
            instants: self.instants,
            ..Self::default()
        };
    }
}

fn write_state<S: Serializer>(state: &AlarmState, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_u32(*state as u32)
}

fn read_state<'de, D: Deserializer<'de>>(deserializer: D) -> Result<AlarmState, D::Error> {
    let number = u32::deserialize(deserializer)?;
    AlarmState::from_number(number)
        .ok_or_else(|| serde::de::Error::custom(format!("{number} is not the number of an alarm state")))
}
