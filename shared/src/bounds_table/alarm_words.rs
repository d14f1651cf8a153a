//! An alarm transition as the words of a ring entry.
//!
//! | word | content |
//! |---|---|
//! | 0 | number of the transition; 0 while it is written |
//! | 1 | epoch: the life of the daemon that wrote it |
//! | 2 | CLOCK_MONOTONIC when it was written, nanoseconds |
//! | 3, 4 | sampling instant, nanoseconds of the daemon's time, and its step number |
//! | 5 | identity of the diagnoser |
//! | 6 | slot in the low, state in the high 32 bits |
//! | 7 | verdict in the low, flags in the high 32 bits |
//! | 8 | occurrence |
//! | 9, 10 | certainly and possibly faulty: bit j is fault j |
//! | 11 | channel with the largest ratio in the low 32 bits |
//! | 12 | its ratio, bits of an f64 |
//! | 13, 14 | fault estimate and its half width, bits of an f64 |
//! | 15 | 0 |

use super::encoding::{join, split};
use super::layout::ALARM_WORDS;
use crate::alarm::{AlarmNumber, AlarmState, AlarmTransition};

/// The words of a transition.
pub(super) fn encode_alarm(transition: &AlarmTransition) -> [u64; ALARM_WORDS] {
    [
        transition.number.number,
        transition.number.epoch,
        transition.written_ns,
        transition.instant_ns,
        transition.step,
        transition.identity,
        join(transition.slot, transition.state as u32),
        join(transition.verdict, transition.flags),
        transition.occurrence,
        transition.certainly_faulty,
        transition.possibly_faulty,
        u64::from(transition.channel),
        transition.ratio.to_bits(),
        transition.fault_estimate.to_bits(),
        transition.fault_estimate_half_width.to_bits(),
        0,
    ]
}

/// The transition in these words; none if they hold a state that does not exist.
pub(super) fn decode_alarm(words: &[u64; ALARM_WORDS]) -> Option<AlarmTransition> {
    let (slot, state) = split(words[6]);
    let (verdict, flags) = split(words[7]);
    Some(AlarmTransition {
        number: AlarmNumber {
            epoch: words[1],
            number: words[0],
        },
        written_ns: words[2],
        instant_ns: words[3],
        step: words[4],
        identity: words[5],
        slot,
        state: AlarmState::from_number(state)?,
        verdict,
        flags,
        occurrence: words[8],
        certainly_faulty: words[9],
        possibly_faulty: words[10],
        channel: words[11] as u32,
        ratio: f64::from_bits(words[12]),
        fault_estimate: f64::from_bits(words[13]),
        fault_estimate_half_width: f64::from_bits(words[14]),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_transition_survives_its_words_and_a_foreign_state_is_none() {
        let mut words: [u64; ALARM_WORDS] = std::array::from_fn(|index| 1000 + index as u64);
        words[6] = join(7, AlarmState::Isolated as u32);
        words[15] = 0;
        assert_eq!(
            decode_alarm(&words).map(|transition| encode_alarm(&transition)),
            Some(words)
        );
        words[6] = join(7, 4);
        assert_eq!(decode_alarm(&words), None);
    }
}
