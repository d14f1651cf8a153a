//! What an [`AlarmListener`](crate::AlarmListener) hears.

use std::sync::Arc;

use residual_shared::alarm::{AlarmNumber, AlarmTransition};
use residual_shared::bounds_table::{ChannelSpec, SlotSpec};

/// What an [`AlarmListener`](crate::AlarmListener) hears.
#[derive(Clone, Debug, PartialEq)]
pub enum AlarmEvent {
    /// The next transition.
    Transition(Alarm),
    /// Transitions that have been overwritten, or were lost when the daemon was killed, before this listener came
    /// to read them. Each missing number lies in exactly one gap.
    Gap {
        /// Number of the first missing transition.
        first: u64,
        /// Number of the last missing transition.
        last: u64,
    },
    /// The numbers have begun anew, with 1: the machine was booted, or the daemon found its old table missing or
    /// damaged. How many transitions behind `previous` were missed nobody knows.
    NewNumbering {
        /// The last transition of the old numbering that this listener knew.
        previous: AlarmNumber,
        /// The life of the daemon with which the new numbering began.
        origin: u64,
    },
}

/// An alarm transition with the names of what it speaks of.
#[derive(Clone, Debug, PartialEq)]
pub struct Alarm {
    /// The transition.
    pub transition: AlarmTransition,
    /// The diagnoser; none if the daemon's present configuration has none with this name and these channels and
    /// faults, so that its names are not known any more.
    pub diagnoser: Option<Arc<SlotSpec>>,
}

impl Alarm {
    /// Name of the diagnoser, if it is known.
    pub fn diagnoser_name(&self) -> Option<&str> {
        self.diagnoser.as_ref().map(|diagnoser| diagnoser.name.as_str())
    }

    /// The channel with the largest ratio, if one was evaluated and its name is known.
    pub fn channel(&self) -> Option<&ChannelSpec> {
        let channels = &self.diagnoser.as_ref()?.channels;
        channels.get(usize::try_from(self.transition.channel).ok()?)
    }

    /// Names of the faults that are certainly present.
    pub fn certainly_faulty(&self) -> impl Iterator<Item = &str> {
        self.faults(self.transition.certainly_faulty)
    }

    /// Names of the faults that may be present.
    pub fn possibly_faulty(&self) -> impl Iterator<Item = &str> {
        self.faults(self.transition.possibly_faulty)
    }

    /// The names of the faults in a set: bit j is fault j.
    fn faults(&self, set: u64) -> impl Iterator<Item = &str> {
        let names = self.diagnoser.iter().flat_map(|diagnoser| &diagnoser.faults);
        let is_member = move |index: usize| {
            u32::try_from(index).is_ok_and(|index| set.checked_shr(index).unwrap_or(0) & 1 == 1)
        };
        names
            .enumerate()
            .filter_map(move |(index, name)| is_member(index).then_some(name.as_str()))
    }
}
