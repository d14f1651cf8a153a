//! Alarm transitions: every change in the life of a fault, numbered without gaps.
//!
//! ```text
//!             violation              n of m violate             the faulty component is known
//!   Cleared ─────────────▶ Pending ─────────────────▶ Raised ─────────────────────────────────▶ Isolated
//!      ▲                      │                          │                                         │
//!      └──────────────────────┴──── violation over ──────┴─────────────────────────────────────────┘
//! ```
//!
//! From cleared it goes to raised, and further to isolated, at once where one violation is enough. A change of the
//! known components is a transition from isolated to isolated, and an acknowledgement that does not clear the alarm
//! one to the state that it has, with the flag [`alarm_flags::ACKNOWLEDGED`].
//!
//! A diagnoser has one alarm. The daemon writes each change of it as a transition into the alarm ring of the
//! bounds table ([`crate::bounds_table`]).
//!
//! # Numbers
//! Transitions are numbered 1, 2, 3, … over all diagnosers and over all lives of the daemon since the machine's
//! boot: a new life goes on with the next number and takes over the transitions that the ring still holds. Each
//! carries the number of the life that wrote it, its epoch. A consumer keeps the [`AlarmNumber`] of the last
//! transition it has seen; whatever is not in the ring any more shows as a gap in the numbers.

use std::fmt;
use std::str::FromStr;

/// Where the alarm of one diagnoser stands.
#[repr(u32)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum AlarmState {
    /// No fault.
    #[default]
    Cleared = 0,
    /// Violations, but not yet often enough.
    Pending = 1,
    /// A fault.
    Raised = 2,
    /// A fault of known components.
    Isolated = 3,
}

impl AlarmState {
    /// The state with this number, if there is one.
    pub fn from_number(number: u32) -> Option<Self> {
        Some(match number {
            0 => Self::Cleared,
            1 => Self::Pending,
            2 => Self::Raised,
            3 => Self::Isolated,
            _ => return None,
        })
    }

    /// The name shown to people and written to files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Cleared => "cleared",
            Self::Pending => "pending",
            Self::Raised => "raised",
            Self::Isolated => "isolated",
        }
    }

    /// Whether a fault is reported: raised or isolated.
    pub fn is_active(self) -> bool {
        matches!(self, Self::Raised | Self::Isolated)
    }
}

/// Bits of [`AlarmTransition::flags`].
pub mod alarm_flags {
    /// The alarm stays until it is acknowledged.
    pub const LATCHED: u32 = 1 << 0;
    /// An acknowledgement caused or preceded the transition.
    pub const ACKNOWLEDGED: u32 = 1 << 1;
    /// A reset of the diagnoser caused the transition.
    pub const RESET: u32 = 1 << 2;
    /// The diagnoser was removed from the configuration, or replaced by another one of its name.
    pub const WITHDRAWN: u32 = 1 << 3;

    /// The names of the flags that are set, as shown to people and written to files.
    pub fn names(set: u32) -> impl Iterator<Item = &'static str> {
        let names = [
            (LATCHED, "latched"),
            (ACKNOWLEDGED, "acknowledged"),
            (RESET, "reset"),
            (WITHDRAWN, "withdrawn"),
        ];
        names
            .into_iter()
            .filter(move |(flag, _)| set & flag != 0)
            .map(|(_, name)| name)
    }
}

/// The name of a transition for ever: its number and the life of the daemon that wrote it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct AlarmNumber {
    /// Number of the life of the daemon (nanoseconds of the wall clock at its start, always rising).
    pub epoch: u64,
    /// Number of the transition, 1 for the first.
    pub number: u64,
}

impl fmt::Display for AlarmNumber {
    /// `EPOCH.NUMBER`, as `residual alarms --since` takes it.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}.{}", self.epoch, self.number)
    }
}

/// Why a text is no alarm number.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{text}` is no alarm number; write EPOCH.NUMBER, as in 1760000000000000000.17")]
pub struct AlarmNumberError {
    /// The text.
    pub text: String,
}

impl FromStr for AlarmNumber {
    type Err = AlarmNumberError;

    /// Reads what [`Display`](fmt::Display) writes.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let digits = |part: &str| part.bytes().all(|byte| byte.is_ascii_digit());
        (text.split_once('.'))
            .filter(|(epoch, number)| digits(epoch) && digits(number))
            .and_then(|(epoch, number)| {
                Some(Self {
                    epoch: epoch.parse().ok()?,
                    number: number.parse().ok()?,
                })
            })
            .ok_or_else(|| AlarmNumberError { text: text.into() })
    }
}

/// Value of [`AlarmTransition::slot`] and [`AlarmTransition::channel`] for none.
pub const NONE: u32 = u32::MAX;

/// One change in the life of a fault.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AlarmTransition {
    /// Number and epoch.
    pub number: AlarmNumber,
    /// CLOCK_MONOTONIC when it was written, nanoseconds.
    pub written_ns: u64,
    /// The sampling instant that caused it, nanoseconds of the daemon's time.
    pub instant_ns: u64,
    /// Number of that sampling instant.
    pub step: u64,
    /// The diagnoser: its slot in the bounds table that holds the transition; [`NONE`] if that table has no
    /// diagnoser with this name and these channels and faults.
    pub slot: u32,
    /// [`SlotSpec::identity`](crate::bounds_table::SlotSpec::identity) of the diagnoser.
    pub identity: u64,
    /// The new state.
    pub state: AlarmState,
    /// Bits of [`alarm_flags`].
    pub flags: u32,
    /// [`Verdict`](crate::record::Verdict) of the step, as a number.
    pub verdict: u32,
    /// How often the alarm of this diagnoser has been raised, this time included.
    pub occurrence: u64,
    /// Faults that are certainly present: bit j is fault j.
    pub certainly_faulty: u64,
    /// Faults that may be present.
    pub possibly_faulty: u64,
    /// The channel with the largest ratio at the step; [`NONE`] if none was evaluated.
    pub channel: u32,
    /// Its ratio; NaN for none.
    pub ratio: f64,
    /// Estimate of the isolated fault; NaN for none.
    pub fault_estimate: f64,
    /// Half width or standard deviation of the estimate; NaN for none.
    pub fault_estimate_half_width: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_state_survives_its_number() {
        for number in 0..4 {
            assert_eq!(
                AlarmState::from_number(number).map(|state| state as u32),
                Some(number)
            );
        }
        assert_eq!(AlarmState::from_number(4), None);
    }

    #[test]
    fn numbers_are_ordered_by_life_first() {
        let number = |epoch, number| AlarmNumber { epoch, number };
        assert!(number(2, 1) > number(1, 9));
    }

    #[test]
    fn a_number_survives_its_text_and_other_texts_are_refused() {
        for number in
            [(7, 3), (0, 0), (u64::MAX, u64::MAX)].map(|(epoch, number)| AlarmNumber { epoch, number })
        {
            assert_eq!(number.to_string().parse(), Ok(number));
        }
        for bad in [
            "",
            "7",
            "7.",
            ".3",
            "7.3.1",
            "+7.3",
            "7.-3",
            "7. 3",
            "18446744073709551616.1",
        ] {
            assert_eq!(
                bad.parse::<AlarmNumber>(),
                Err(AlarmNumberError { text: bad.into() })
            );
        }
    }
}
