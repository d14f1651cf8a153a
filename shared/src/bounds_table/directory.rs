//! The directory of a table as words, and back.
//!
//! Writing is canonical: a directory has one form in words. Reading makes use of it: what was read is written
//! again and must give the same words. That one comparison checks every offset, size, padding and the checksum;
//! before it, each access is checked to lie within the words.

use std::cell::Cell;

use super::layout::{self, LINE_WORDS, WORD_BYTES, header, input_entry, slot_entry};
use super::protocol::Slot;
use super::spec::{ChannelSpec, Directory, InputSpec, MAX_TEXT_BYTES, SlotSpec, SpecError, TableSpec};
use crate::clock::DaemonTime;
use crate::counters::{InputCounters, ScheduleCounters};
use crate::record::{MAX_CHANNELS, MAX_FAULTS};

/// Where the changing parts of one slot lie, as indices of words.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SlotPlace {
    start: usize,
    cell_words: usize,
    /// First of its schedule counters.
    pub(super) counters: usize,
}

impl SlotPlace {
    /// The slot in the table's words.
    pub(super) fn slot<'a, W>(&self, words: &'a [W]) -> Slot<'a, W> {
        let first = self.start + LINE_WORDS;
        let second = first + self.cell_words;
        Slot {
            sequence: &words[self.start],
            cells: [&words[first..second], &words[second..second + self.cell_words]],
        }
    }
}

/// A directory in words, and where the rest of the file lies.
#[derive(Debug)]
pub(super) struct Image {
    /// Header, entries and texts; state and heartbeat are 0.
    pub(super) words: Vec<u64>,
    /// Words of the whole file.
    pub(super) total_words: usize,
    /// One place a slot.
    pub(super) slots: Vec<SlotPlace>,
    /// First counter of each input.
    pub(super) inputs: Vec<usize>,
}

/// Writes a directory as words.
pub(super) fn encode(directory: &Directory) -> Result<Image, SpecError> {
    let Directory {
        spec,
        epoch,
        boot_id,
        pid,
    } = directory;
    spec.check()?;
    let slot_entries = header::WORDS;
    let input_entries = slot_entries + spec.slots.len() * slot_entry::WORDS;
    let mut words = vec![0; input_entries + spec.inputs.len() * input_entry::WORDS];
    for (index, slot) in spec.slots.iter().enumerate() {
        let channels = slot
            .channels
            .iter()
            .flat_map(|channel| [&channel.name, &channel.unit]);
        let entry = [
            (slot_entry::NAME, push_text(&mut words, &slot.name)?),
            (slot_entry::METHOD, push_text(&mut words, &slot.method)?),
            (slot_entry::PERIOD_NS, slot.period_ns),
            (slot_entry::PHASE_NS, slot.phase_ns),
            (slot_entry::MARGIN_NS, slot.margin_ns),
            (slot_entry::CHANNEL_COUNT, slot.channels.len() as u64),
            (slot_entry::CHANNELS, push_texts(&mut words, channels)?),
            (slot_entry::FAULT_COUNT, slot.faults.len() as u64),
            (slot_entry::FAULTS, push_texts(&mut words, &slot.faults)?),
        ];
        for (field, word) in entry {
            words[slot_entries + index * slot_entry::WORDS + field] = word;
        }
    }
    for (index, input) in spec.inputs.iter().enumerate() {
        let entry = [
            (input_entry::NAME, push_text(&mut words, &input.name)?),
            (input_entry::SIGNAL_COUNT, input.signals.len() as u64),
            (input_entry::SIGNALS, push_texts(&mut words, &input.signals)?),
        ];
        for (field, word) in entry {
            words[input_entries + index * input_entry::WORDS + field] = word;
        }
    }
    let instance = push_text(&mut words, &spec.instance)?;
    words.resize(layout::whole_lines(words.len()), 0);
    if u32::try_from(words.len() * WORD_BYTES).is_err() {
        return Err(SpecError::TooLarge(words.len() * WORD_BYTES));
    }

    let mut end = words.len();
    let mut take = |count: usize| {
        let start = end;
        end += layout::whole_lines(count);
        start
    };
    let mut slots = Vec::with_capacity(spec.slots.len());
    for (index, slot) in spec.slots.iter().enumerate() {
        let channels = slot.channels.len();
        let place = SlotPlace {
            start: take(layout::slot_words(channels)),
            cell_words: layout::cell_words(channels),
            counters: take(ScheduleCounters::COUNT),
        };
        let entry = slot_entries + index * slot_entry::WORDS;
        words[entry + slot_entry::SLOT] = bytes(place.start);
        words[entry + slot_entry::CELL_BYTES] = bytes(place.cell_words);
        words[entry + slot_entry::COUNTERS] = bytes(place.counters);
        slots.push(place);
    }
    let mut inputs = Vec::with_capacity(spec.inputs.len());
    for index in 0..spec.inputs.len() {
        let place = take(InputCounters::COUNT);
        words[input_entries + index * input_entry::WORDS + input_entry::COUNTERS] = bytes(place);
        inputs.push(place);
    }

    let head = [
        (header::MAGIC, layout::MAGIC),
        (header::VERSION, layout::VERSION),
        (header::HASH, layout::HASH),
        (header::TOTAL_BYTES, bytes(end)),
        (header::DIRECTORY_BYTES, bytes(words.len())),
        (header::SLOT_COUNT, spec.slots.len() as u64),
        (header::INPUT_COUNT, spec.inputs.len() as u64),
        (header::SLOT_ENTRIES, bytes(slot_entries)),
        (header::INPUT_ENTRIES, bytes(input_entries)),
        (header::INSTANCE, instance),
        (header::PID, u64::from(*pid)),
        (header::EPOCH, *epoch),
        (header::BOOT_ID_LOW, *boot_id as u64),
        (header::BOOT_ID_HIGH, (*boot_id >> 64) as u64),
        (header::TIME_ORIGIN_NS, spec.time.origin_ns),
        (header::TIME_SPEED, spec.time.speed.to_bits()),
        (header::SCHEDULE_EPOCH_NS, spec.schedule_epoch_ns),
        (header::STALE_AFTER_PERIODS, u64::from(spec.stale_after_periods)),
    ];
    for (field, word) in head {
        words[field] = word;
    }
    words[header::CHECKSUM] = layout::fnv(layout::FNV_START, &words);
    Ok(Image {
        words,
        total_words: end,
        slots,
        inputs,
    })
}

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
    };
    let directory = Directory {
        spec,
        epoch: source.at(header::EPOCH)?,
        boot_id: u128::from(source.at(header::BOOT_ID_LOW)?)
            | u128::from(source.at(header::BOOT_ID_HIGH)?) << 64,
        pid: source.small(header::PID, u32::MAX as usize)? as u32,
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

fn bytes(words: usize) -> u64 {
    (words * WORD_BYTES) as u64
}

fn entry_at(first: usize, index: usize, size: usize) -> Result<usize, String> {
    index
        .checked_mul(size)
        .and_then(|offset| first.checked_add(offset))
        .ok_or_else(|| "an entry lies outside the directory".into())
}

/// Appends a text, zero byte and padding included; gives the word that refers to it.
fn push_text(words: &mut Vec<u64>, text: &str) -> Result<u64, SpecError> {
    if text.len() > MAX_TEXT_BYTES || text.contains('\0') {
        return Err(SpecError::Text { text: text.into() });
    }
    let reference = bytes(words.len()) | (text.len() as u64) << 32;
    let mut padded = text.as_bytes().to_vec();
    padded.resize((text.len() + 1).next_multiple_of(WORD_BYTES), 0);
    let (chunks, _) = padded.as_chunks::<WORD_BYTES>();
    words.extend(chunks.iter().map(|chunk| u64::from_ne_bytes(*chunk)));
    Ok(reference)
}

/// Appends texts and then the list of the words that refer to them; gives the offset of the list.
fn push_texts<'a>(
    words: &mut Vec<u64>,
    texts: impl IntoIterator<Item = &'a String>,
) -> Result<u64, SpecError> {
    let list: Vec<u64> = texts
        .into_iter()
        .map(|text| push_text(words, text))
        .collect::<Result<_, _>>()?;
    let offset = bytes(words.len());
    words.extend(list);
    Ok(offset)
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
