//! Reading a directory of which nothing is known yet.
//!
//! Each access is checked to lie within the words. What was read is then written again and must give the same
//! words: that one comparison checks every offset, size, padding and the checksum.

use std::cell::Cell;

use super::directory::{Image, encode};
use super::layout::{WORD_BYTES, header, input_entry, slot_entry};
use super::spec::{ChannelSpec, Directory, InputSpec, MAX_TEXT_BYTES, SlotSpec, TableSpec};
use crate::clock::DaemonTime;
use crate::record::{MAX_CHANNELS, MAX_FAULTS};

/// Reads a directory from `words` (header, entries and texts, magic and version already checked).
///
/// The error says what was found to be wrong.
pub(super) fn decode(words: &[u64]) -> Result<(Directory, Image), String> {
    let source = Source {
        words,
        text_words_left: Cell::new(words.len()),
    };
    let count = |field: usize, what: &str| {
        usize::try_from(source.at(field)?).map_err(|_| format!("the number of {what} is absurd"))
    };
    let slot_entries = source.word_index(header::SLOT_ENTRIES)?;
    let slots = (0..count(header::SLOT_COUNT, "slots")?)
        .map(|index| source.slot(entry_at(slot_entries, index, slot_entry::WORDS)?))
        .collect::<Result<_, _>>()?;
    let input_entries = source.word_index(header::INPUT_ENTRIES)?;
    let inputs = (0..count(header::INPUT_COUNT, "inputs")?)
        .map(|index| source.input(entry_at(input_entries, index, input_entry::WORDS)?))
        .collect::<Result<_, _>>()?;
    let spec = TableSpec {
        instance: source.text(header::INSTANCE)?,
        slots,
        inputs,
        time: DaemonTime {
            origin_ns: source.at(header::TIME_ORIGIN_NS)?,
            speed: f64::from_bits(source.at(header::TIME_SPEED)?),
        },
        schedule_epoch_ns: source.at(header::SCHEDULE_EPOCH_NS)?,
        stale_after_periods: source.small(header::STALE_AFTER_PERIODS, u32::MAX as usize)? as u32,
        alarm_capacity: source.small(header::ALARM_CAPACITY, u32::MAX as usize)? as u32,
    };
    let directory = Directory {
        spec,
        epoch: source.at(header::EPOCH)?,
        boot_id: u128::from(source.at(header::BOOT_ID_LOW)?)
            | u128::from(source.at(header::BOOT_ID_HIGH)?) << 64,
        pid: source.small(header::PID, u32::MAX as usize)? as u32,
        alarm_origin: source.at(header::ALARM_ORIGIN)?,
    };
    let image = encode(&directory).map_err(|error| error.to_string())?;
    let differs = (0..words.len().max(image.words.len())).find(|index| {
        words.get(*index) != image.words.get(*index) && !matches!(*index, header::STATE | header::HEARTBEAT)
    });
    match differs {
        None => Ok((directory, image)),
        Some(header::CHECKSUM) => Err("its checksum is wrong".into()),
        Some(index) => Err(format!("the word at byte {} is wrong", index * WORD_BYTES)),
    }
}

fn entry_at(first: usize, index: usize, size: usize) -> Result<usize, String> {
    index
        .checked_mul(size)
        .and_then(|offset| first.checked_add(offset))
        .ok_or_else(|| "an entry lies outside the directory".into())
}

/// Words of which nothing is known yet.
struct Source<'a> {
    words: &'a [u64],
    /// Texts do not share words, so all of them together are not longer than the directory. This keeps a
    /// forged one from filling the reader's memory.
    text_words_left: Cell<usize>,
}

impl Source<'_> {
    fn at(&self, index: usize) -> Result<u64, String> {
        let word = self.words.get(index).copied();
        word.ok_or_else(|| {
            format!(
                "it refers to byte {}, outside itself",
                index.saturating_mul(WORD_BYTES)
            )
        })
    }

    /// The byte offset at `index`, as the index of a word.
    fn word_index(&self, index: usize) -> Result<usize, String> {
        let offset = usize::try_from(self.at(index)?).map_err(|error| error.to_string())?;
        if offset % WORD_BYTES != 0 {
            return Err(format!("the offset {offset} is not a multiple of {WORD_BYTES}"));
        }
        Ok(offset / WORD_BYTES)
    }

    /// The number at `index`, at most `limit`.
    fn small(&self, index: usize, limit: usize) -> Result<usize, String> {
        let number = self.at(index)?;
        let small = usize::try_from(number).ok().filter(|number| *number <= limit);
        small.ok_or_else(|| {
            format!(
                "the number {number} at byte {} is above {limit}",
                index * WORD_BYTES
            )
        })
    }

    /// The text to which the word at `index` refers.
    fn text(&self, index: usize) -> Result<String, String> {
        let reference = self.at(index)?;
        let (offset, length) = (reference as u32 as usize, (reference >> 32) as usize);
        if offset % WORD_BYTES != 0 || length > MAX_TEXT_BYTES {
            return Err(format!("no text lies at byte {offset} with {length} bytes"));
        }
        let left = self.text_words_left.get().checked_sub(length / WORD_BYTES + 1);
        self.text_words_left.set(left.ok_or("its texts overlap")?);
        let first = offset / WORD_BYTES;
        let mut text = Vec::with_capacity(length.next_multiple_of(WORD_BYTES));
        for index in first..first + length.div_ceil(WORD_BYTES) {
            text.extend(self.at(index)?.to_ne_bytes());
        }
        text.truncate(length);
        String::from_utf8(text).map_err(|_| format!("the text at byte {offset} is not UTF-8"))
    }

    /// The list of `count` texts to whose start the word at `index` refers.
    fn texts(&self, index: usize, count: usize) -> Result<Vec<String>, String> {
        let first = self.word_index(index)?;
        (0..count).map(|number| self.text(first + number)).collect()
    }

    fn slot(&self, entry: usize) -> Result<SlotSpec, String> {
        let channel_count = self.small(entry + slot_entry::CHANNEL_COUNT, MAX_CHANNELS)?;
        let texts = self.texts(entry + slot_entry::CHANNELS, 2 * channel_count)?;
        let (pairs, _) = texts.as_chunks::<2>();
        let channel = |[name, unit]: &[String; 2]| ChannelSpec {
            name: name.clone(),
            unit: unit.clone(),
        };
        let fault_count = self.small(entry + slot_entry::FAULT_COUNT, MAX_FAULTS)?;
        Ok(SlotSpec {
            name: self.text(entry + slot_entry::NAME)?,
            method: self.text(entry + slot_entry::METHOD)?,
            period_ns: self.at(entry + slot_entry::PERIOD_NS)?,
            phase_ns: self.at(entry + slot_entry::PHASE_NS)?,
            margin_ns: self.at(entry + slot_entry::MARGIN_NS)?,
            channels: pairs.iter().map(channel).collect(),
            faults: self.texts(entry + slot_entry::FAULTS, fault_count)?,
        })
    }

    fn input(&self, entry: usize) -> Result<InputSpec, String> {
        let signal_count = self.small(entry + input_entry::SIGNAL_COUNT, self.words.len())?;
        Ok(InputSpec {
            name: self.text(entry + input_entry::NAME)?,
            signals: self.texts(entry + input_entry::SIGNALS, signal_count)?,
        })
    }
}
