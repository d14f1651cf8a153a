//! Counters that make every rejected, lost or late sample and every skipped instant visible.

use crate::alarm::AlarmTransition;

/// Declares a struct of `u64` counters together with their names and their conversion to and from words.
macro_rules! counters {
    ($(#[$outer:meta])* $name:ident { $($(#[$inner:meta])* $field:ident,)* }) => {
        $(#[$outer])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
        pub struct $name { $($(#[$inner])* pub $field: u64,)* }

        impl $name {
            /// Names of the counters, in the order of [`Self::to_words`].
            pub const NAMES: &'static [&'static str] = &[$(stringify!($field),)*];
            /// Number of counters.
            pub const COUNT: usize = Self::NAMES.len();

            /// The counters in the order of [`Self::NAMES`].
            pub fn to_words(&self) -> [u64; Self::COUNT] {
                [$(self.$field,)*]
            }

            /// The counters from words in the order of [`Self::NAMES`].
            pub fn from_words(words: [u64; Self::COUNT]) -> Self {
                let [$($field,)*] = words;
                Self { $($field,)* }
            }
        }
    };
}

counters! {
    /// What happened at the door of one input.
    InputCounters {
        /// Samples taken into the inbox.
        accepted,
        /// Rejected: an element is NaN or infinite.
        non_finite,
        /// Rejected: the number of elements is not the number of signals.
        wrong_length,
        /// Rejected: the sequence number was seen before.
        duplicate,
        /// Rejected: the time stamp is not later than that of the previous sample.
        backward,
        /// Rejected: the time stamp lies further in the future than `max_ahead_s` allows.
        too_far_ahead,
        /// Interruptions of the sequence numbers.
        gaps,
        /// Samples missing in those interruptions.
        lost,
        /// Accepted too late for a sampling instant that had been stepped already.
        late,
        /// Pushed out of a full inbox before any diagnoser was due to see them.
        overwritten,
        /// How often another publisher took over.
        publisher_changes,
    }
}

counters! {
    /// How one diagnoser was scheduled.
    ScheduleCounters {
        /// Steps done.
        steps,
        /// Steps that began later than one period after their instant.
        overruns,
        /// Instants given up because the catch-up limit was reached.
        skipped,
        /// Steps with at least one missing input element.
        input_missing,
        /// Largest delay of a step behind its due time (instant + margin), nanoseconds.
        max_lateness_ns,
        /// Longest step, nanoseconds.
        max_step_ns,
        /// Step records that the recorder queue had no room for.
        records_dropped,
    }
}

impl InputCounters {
    /// How often something was rejected, lost, late or changed: the sum of all counters but `accepted`.
    pub fn troubles(&self) -> u64 {
        self.to_words()
            .iter()
            .skip(1)
            .fold(0, |sum, count| sum.wrapping_add(*count))
    }
}

impl ScheduleCounters {
    /// How often something was late or lost by the daemon's own doing: overruns, skipped instants, dropped records.
    pub fn troubles(&self) -> u64 {
        self.overruns
            .wrapping_add(self.skipped)
            .wrapping_add(self.records_dropped)
    }
}

counters! {
    /// Where the alarm of one diagnoser stands.
    AlarmStatus {
        /// [`AlarmState`](crate::alarm::AlarmState) as a number.
        state,
        /// Bits of [`alarm_flags`](crate::alarm::alarm_flags).
        flags,
        /// How often it has been raised.
        occurrences,
        /// Number of its latest transition; 0: none.
        number,
        /// Sampling instant of its latest transition, nanoseconds of the daemon's time.
        instant_ns,
    }
}

impl AlarmStatus {
    /// Where the alarm stands after this transition.
    pub fn after(transition: &AlarmTransition) -> Self {
        Self {
            state: transition.state as u64,
            flags: u64::from(transition.flags),
            occurrences: transition.occurrence,
            number: transition.number.number,
            instant_ns: transition.instant_ns,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counters_survive_their_words() {
        let words: Vec<u64> = (1..=InputCounters::COUNT as u64).collect();
        let counters = InputCounters::from_words(words.clone().try_into().unwrap());
        assert_eq!(counters.to_words().to_vec(), words);
        assert_eq!(counters.accepted, 1);
        assert_eq!(InputCounters::NAMES[0], "accepted");
    }
}
