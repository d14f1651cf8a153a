//! A step record as the words of a cell.
//!
//! | word | content |
//! |---|---|
//! | 0 | step number |
//! | 1 | sampling instant, nanoseconds of the daemon's time |
//! | 2, 3 | certainly and possibly faulty: bit j is fault j |
//! | 4 | valid input elements: bit i is element i |
//! | 5, 6 | fault estimate and its half width, bits of an f64 |
//! | 7 | verdict in the low, flags in the high 32 bits |
//! | 8 | skipped instants in the low, number of channels in the high 32 bits |
//! | 9 + 4i … | lower bound, residual, upper bound, ratio of channel i, bits of an f64 |
//!
//! Only the channels in use are written and read.

use super::layout::{CHANNEL_WORDS, RECORD_HEAD_WORDS};
use super::protocol::{ReadWord, WriteWord};
use crate::record::{Channel, StepRecord};

pub(super) fn join(low: u32, high: u32) -> u64 {
    u64::from(low) | u64::from(high) << 32
}

pub(super) fn split(word: u64) -> (u32, u32) {
    (word as u32, (word >> 32) as u32)
}

/// Writes `record` to `cell`. Channels for which the cell has no room are left out.
pub fn store_record<W: WriteWord>(cell: &[W], record: &StepRecord) {
    let Some((head, body)) = cell.split_at_checked(RECORD_HEAD_WORDS) else {
        return;
    };
    let room = body.len() / CHANNEL_WORDS;
    let channels = &record.channels()[..record.channels().len().min(room)];
    let words: [u64; RECORD_HEAD_WORDS] = [
        record.step,
        record.instant_ns,
        record.certainly_faulty,
        record.possibly_faulty,
        record.inputs_valid,
        record.fault_estimate.to_bits(),
        record.fault_estimate_half_width.to_bits(),
        join(record.verdict, record.flags),
        join(record.skipped_instants, channels.len() as u32),
    ];
    for (word, value) in head.iter().zip(words) {
        word.store(value);
    }
    for (words, channel) in body.chunks_exact(CHANNEL_WORDS).zip(channels) {
        let values = [channel.lower, channel.residual, channel.upper, channel.ratio];
        for (word, value) in words.iter().zip(values) {
            word.store(value.to_bits());
        }
    }
}

/// Reads `record` from `cell`. Channels from `channel_count` on are left as they are.
///
/// Any words give some record: a count larger than the cell's room is cut down to it.
pub fn load_record<W: ReadWord>(cell: &[W], record: &mut StepRecord) {
    let Some((head, body)) = cell.split_at_checked(RECORD_HEAD_WORDS) else {
        return;
    };
    let room = (body.len() / CHANNEL_WORDS).min(record.channels.len()) as u32;
    record.step = head[0].load();
    record.instant_ns = head[1].load();
    record.certainly_faulty = head[2].load();
    record.possibly_faulty = head[3].load();
    record.inputs_valid = head[4].load();
    record.fault_estimate = f64::from_bits(head[5].load());
    record.fault_estimate_half_width = f64::from_bits(head[6].load());
    (record.verdict, record.flags) = split(head[7].load());
    let (skipped_instants, channel_count) = split(head[8].load());
    record.skipped_instants = skipped_instants;
    record.channel_count = channel_count.min(room);
    for (words, channel) in body.chunks_exact(CHANNEL_WORDS).zip(record.channels_mut()) {
        let value = |index: usize| f64::from_bits(words[index].load());
        *channel = Channel {
            lower: value(0),
            residual: value(1),
            upper: value(2),
            ratio: value(3),
        };
    }
}

#[cfg(test)]
mod tests {
    use super::super::layout::cell_words;
    use super::*;
    use crate::record::MAX_CHANNELS;
    use proptest::prelude::*;
    use std::sync::atomic::AtomicU64;

    fn cell(words: usize) -> Vec<AtomicU64> {
        (0..words).map(|_| AtomicU64::new(u64::MAX)).collect()
    }

    fn record_of(words: &[u64]) -> StepRecord {
        let cell: Vec<AtomicU64> = words.iter().map(|&word| AtomicU64::new(word)).collect();
        let mut record = StepRecord::new(0);
        load_record(&cell, &mut record);
        record
    }

    proptest! {
        // Miri is slow and has no files to keep failures in.
        #![proptest_config(ProptestConfig {
            cases: if cfg!(miri) { 4 } else { 256 },
            failure_persistence: None,
            ..ProptestConfig::default()
        })]

        #[test]
        fn a_record_survives_its_cell_in_every_bit(
            count in 0..=MAX_CHANNELS,
            words in proptest::collection::vec(any::<u64>(), cell_words(MAX_CHANNELS)),
        ) {
            let mut record = record_of(&words);
            record.channel_count = count as u32;
            let cell = cell(cell_words(count));
            store_record(&cell, &record);
            let mut back = StepRecord::new(3);
            load_record(&cell, &mut back);
            prop_assert!(back.same_bits(&record));
        }

        #[test]
        fn any_words_of_any_length_give_a_record_within_its_limits(
            words in proptest::collection::vec(any::<u64>(), 0..300),
        ) {
            prop_assert!(record_of(&words).channel_count as usize <= MAX_CHANNELS);
        }
    }

    #[test]
    fn channels_without_room_are_left_out() {
        let cell = cell(RECORD_HEAD_WORDS + CHANNEL_WORDS);
        let mut record = StepRecord::new(2);
        record.channels_mut()[0] = Channel::two_sided(0.5, 1.0);
        store_record(&cell, &record);
        let mut back = StepRecord::new(0);
        load_record(&cell, &mut back);
        assert_eq!(back.channels(), &record.channels()[..1]);
    }
}
