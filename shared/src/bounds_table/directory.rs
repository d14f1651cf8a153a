//! The directory of a table as words, and where the rest of the file lies.
//!
//! The form is canonical: a directory gives one sequence of words. Reading relies on it.

use super::layout::{self, ALARM_WORDS, LINE_WORDS, WORD_BYTES, alarm_ring, header, input_entry, slot_entry};
use super::protocol::Slot;
use super::ring::Ring;
use super::spec::{Directory, MAX_TEXT_BYTES, SpecError};
use crate::counters::{AlarmStatus, InputCounters, ScheduleCounters};

/// Where the changing parts of one slot lie, as indices of words.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SlotPlace {
    start: usize,
    channels: usize,
    /// First of its schedule counters.
    pub(super) counters: usize,
    /// First word of its alarm status.
    pub(super) alarm: usize,
}

impl SlotPlace {
    /// The slot in the table's words.
    pub(super) fn slot<'a, W>(&self, words: &'a [W]) -> Slot<'a, W> {
        let first = self.start + LINE_WORDS;
        let second = first + layout::cell_words(self.channels);
        let length = layout::record_words(self.channels);
        Slot {
            sequence: &words[self.start],
            cells: [&words[first..first + length], &words[second..second + length]],
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
    /// Where the alarm ring lies.
    pub(super) alarms: RingPlace,
}

/// Where the alarm ring lies, as an index of words.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct RingPlace {
    start: usize,
    capacity: usize,
}

impl RingPlace {
    /// The ring in the table's words.
    pub(super) fn ring<'a, W>(&self, words: &'a [W]) -> AlarmRing<'a, W> {
        let entries = self.start + alarm_ring::ENTRIES;
        Ring {
            newest: &words[self.start + alarm_ring::NEWEST],
            entries: &words[entries..entries + self.capacity * ALARM_WORDS],
        }
    }

    /// The word that holds the futex.
    pub(super) fn wake(&self) -> usize {
        self.start + alarm_ring::WAKE
    }

    /// First word behind the head of the ring, and how many transitions follow.
    pub(super) fn entries(&self) -> (usize, usize) {
        (self.start + alarm_ring::ENTRIES, self.capacity)
    }
}

/// The ring of the alarm transitions.
pub(super) type AlarmRing<'a, W> = Ring<'a, W, ALARM_WORDS>;

/// Writes a directory as words.
pub(super) fn encode(directory: &Directory) -> Result<Image, SpecError> {
    let Directory {
        spec,
        epoch,
        boot_id,
        pid,
        alarm_origin,
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
            channels,
            counters: take(ScheduleCounters::COUNT),
            alarm: take(AlarmStatus::COUNT),
        };
        let entry = slot_entries + index * slot_entry::WORDS;
        words[entry + slot_entry::SLOT] = bytes(place.start);
        words[entry + slot_entry::CELL_BYTES] = bytes(layout::cell_words(channels));
        words[entry + slot_entry::COUNTERS] = bytes(place.counters);
        words[entry + slot_entry::ALARM] = bytes(place.alarm);
        slots.push(place);
    }
    let mut inputs = Vec::with_capacity(spec.inputs.len());
    for index in 0..spec.inputs.len() {
        let place = take(InputCounters::COUNT);
        words[input_entries + index * input_entry::WORDS + input_entry::COUNTERS] = bytes(place);
        inputs.push(place);
    }

    let capacity = spec.alarm_capacity as usize;
    let alarms = RingPlace {
        start: take(layout::alarm_ring_words(capacity)),
        capacity,
    };

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
        (header::ALARM_RING, bytes(alarms.start)),
        (header::ALARM_CAPACITY, u64::from(spec.alarm_capacity)),
        (header::ALARM_ORIGIN, *alarm_origin),
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
        alarms,
    })
}

fn bytes(words: usize) -> u64 {
    (words * WORD_BYTES) as u64
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
