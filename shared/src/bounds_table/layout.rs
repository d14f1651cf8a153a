//! Where everything lies in the file: word offsets, magic, version, hash and sizes.

use crate::counters::{AlarmStatus, InputCounters, ScheduleCounters};

/// Bytes of one word.
pub const WORD_BYTES: usize = 8;

/// Words of one cache line (64 bytes on every processor this runs on).
pub const LINE_WORDS: usize = 8;

/// First word of every bounds table: the bytes `RESIDUAL`.
pub const MAGIC: u64 = u64::from_ne_bytes(*b"RESIDUAL");

/// Version of the layout; raised with every change that a reader must know of.
pub const VERSION: u64 = 2;

/// Words of a record before its channels.
pub const RECORD_HEAD_WORDS: usize = 9;

/// Words of one channel: lower, residual, upper, ratio.
pub const CHANNEL_WORDS: usize = 4;

/// Words of an alarm transition: two lines, so that writing one disturbs no reader of its neighbours.
pub const ALARM_WORDS: usize = 2 * LINE_WORDS;

/// Word of a transition that holds the slot (low half) and the state.
pub const ALARM_SLOT_WORD: usize = 6;

/// Word offsets in the alarm ring.
pub mod alarm_ring {
    /// Number of the newest whole transition; 0: none. Changes.
    pub const NEWEST: usize = 0;
    /// In its first four bytes the futex word: the low 32 bits of `NEWEST`, written after it. Changes.
    pub const WAKE: usize = 1;
    /// The first transition.
    pub const ENTRIES: usize = super::LINE_WORDS;
}

/// Value of the header word `STATE` while the daemon lives.
pub const STATE_RUNNING: u64 = 1;

/// Value of the header word `STATE` after the daemon has ended or been replaced.
pub const STATE_CLOSED: u64 = 2;

/// Word offsets in the header.
pub mod header {
    /// [`MAGIC`](super::MAGIC).
    pub const MAGIC: usize = 0;
    /// [`VERSION`](super::VERSION).
    pub const VERSION: usize = 1;
    /// [`HASH`](super::HASH).
    pub const HASH: usize = 2;
    /// Size of the whole file, bytes.
    pub const TOTAL_BYTES: usize = 3;
    /// Size of header, entries and texts, bytes: all that is checked by `CHECKSUM`.
    pub const DIRECTORY_BYTES: usize = 4;
    /// FNV-1a of the directory's words, with the words `CHECKSUM`, `STATE` and `HEARTBEAT` taken as 0.
    pub const CHECKSUM: usize = 5;
    /// Number of slots.
    pub const SLOT_COUNT: usize = 6;
    /// Number of inputs.
    pub const INPUT_COUNT: usize = 7;
    /// Offset of the first slot entry.
    pub const SLOT_ENTRIES: usize = 8;
    /// Offset of the first input entry.
    pub const INPUT_ENTRIES: usize = 9;
    /// Text: name of the instance.
    pub const INSTANCE: usize = 10;
    /// Process id of the daemon.
    pub const PID: usize = 11;
    /// Number of this life of the daemon, larger than that of every earlier one.
    pub const EPOCH: usize = 12;
    /// Low half of the boot's id (`/proc/sys/kernel/random/boot_id` as a 128-bit number).
    pub const BOOT_ID_LOW: usize = 13;
    /// High half of the boot's id.
    pub const BOOT_ID_HIGH: usize = 14;
    /// CLOCK_MONOTONIC at which the daemon's time equals it, nanoseconds.
    pub const TIME_ORIGIN_NS: usize = 15;
    /// Speed of the daemon's time, bits of an f64.
    pub const TIME_SPEED: usize = 16;
    /// Origin of the grid of sampling instants, nanoseconds of the daemon's time.
    pub const SCHEDULE_EPOCH_NS: usize = 17;
    /// A record older than this many periods (and the margin) is stale.
    pub const STALE_AFTER_PERIODS: usize = 18;
    /// Offset of the alarm ring.
    pub const ALARM_RING: usize = 19;
    /// How many transitions the ring holds; a power of two.
    pub const ALARM_CAPACITY: usize = 20;
    /// Number of the life of the daemon that wrote transition 1; those after it have gone on counting.
    pub const ALARM_ORIGIN: usize = 21;
    /// [`STATE_RUNNING`](super::STATE_RUNNING) or [`STATE_CLOSED`](super::STATE_CLOSED). Changes.
    pub const STATE: usize = 24;
    /// CLOCK_MONOTONIC of the daemon's last sign of life, nanoseconds. Changes.
    pub const HEARTBEAT: usize = 25;
    /// Words of the header.
    pub const WORDS: usize = 32;
}

/// Word offsets in the entry of one slot.
pub mod slot_entry {
    /// Text: name of the diagnoser.
    pub const NAME: usize = 0;
    /// Text: its method.
    pub const METHOD: usize = 1;
    /// Period, nanoseconds.
    pub const PERIOD_NS: usize = 2;
    /// Phase, nanoseconds.
    pub const PHASE_NS: usize = 3;
    /// Margin between sampling instant and step, nanoseconds.
    pub const MARGIN_NS: usize = 4;
    /// Number of channels.
    pub const CHANNEL_COUNT: usize = 5;
    /// Offset of the list of channel texts: name and unit in turn.
    pub const CHANNELS: usize = 6;
    /// Number of faults.
    pub const FAULT_COUNT: usize = 7;
    /// Offset of the list of fault names (texts).
    pub const FAULTS: usize = 8;
    /// Offset of the slot block: sequence word; cell 0 one line further; cell 1 `CELL_BYTES` further.
    pub const SLOT: usize = 9;
    /// Bytes from cell 0 to cell 1.
    pub const CELL_BYTES: usize = 10;
    /// Offset of the schedule counters.
    pub const COUNTERS: usize = 11;
    /// Offset of the alarm status.
    pub const ALARM: usize = 12;
    /// Words of one entry.
    pub const WORDS: usize = 16;
}

/// Word offsets in the entry of one input.
pub mod input_entry {
    /// Text: name of the input.
    pub const NAME: usize = 0;
    /// Number of signals.
    pub const SIGNAL_COUNT: usize = 1;
    /// Offset of the list of signal names (texts).
    pub const SIGNALS: usize = 2;
    /// Offset of the input counters.
    pub const COUNTERS: usize = 3;
    /// Words of one entry.
    pub const WORDS: usize = 8;
}

/// The least number of words that fills whole lines and is not below `words`.
pub const fn whole_lines(words: usize) -> usize {
    words.next_multiple_of(LINE_WORDS)
}

/// Words of a record with `channels` channels.
pub const fn record_words(channels: usize) -> usize {
    RECORD_HEAD_WORDS + CHANNEL_WORDS * channels
}

/// Words of a cell for a record with `channels` channels, filled up to whole lines.
pub const fn cell_words(channels: usize) -> usize {
    whole_lines(record_words(channels))
}

/// Words of a slot block: the line of the sequence word and two cells.
pub const fn slot_words(channels: usize) -> usize {
    LINE_WORDS + 2 * cell_words(channels)
}

/// Words of the alarm ring.
pub const fn alarm_ring_words(capacity: usize) -> usize {
    alarm_ring::ENTRIES + capacity * ALARM_WORDS
}

/// Hash of the layout: a change of any size or counter that was made without a new version shows here.
pub const HASH: u64 = {
    let numbers = [
        VERSION,
        header::WORDS as u64,
        slot_entry::WORDS as u64,
        input_entry::WORDS as u64,
        RECORD_HEAD_WORDS as u64,
        CHANNEL_WORDS as u64,
        LINE_WORDS as u64,
        ALARM_WORDS as u64,
    ];
    let hash = names(ScheduleCounters::NAMES, fnv(FNV_START, &numbers));
    let hash = names(AlarmStatus::NAMES, hash);
    names(InputCounters::NAMES, hash)
};

/// Where an FNV-1a hash begins.
pub const FNV_START: u64 = 0xcbf2_9ce4_8422_2325;

/// Its factor.
pub const FNV_PRIME: u64 = 0x0000_0100_0000_01b3;

/// FNV-1a over words instead of bytes, going on from `hash`.
pub const fn fnv(mut hash: u64, words: &[u64]) -> u64 {
    let mut index = 0;
    while index < words.len() {
        hash = (hash ^ words[index]).wrapping_mul(FNV_PRIME);
        // A word's high bits reach only high bits of the product; bring them down for the next word.
        hash ^= hash >> 32;
        index += 1;
    }
    hash
}

const fn names(names: &[&str], mut hash: u64) -> u64 {
    let mut index = 0;
    while index < names.len() {
        hash = fnv_text(hash, names[index]);
        index += 1;
    }
    hash
}

/// [`fnv`] over the length and the bytes of a text.
pub const fn fnv_text(mut hash: u64, text: &str) -> u64 {
    let bytes = text.as_bytes();
    hash = fnv(hash, &[bytes.len() as u64]);
    let mut at = 0;
    while at < bytes.len() {
        hash = fnv(hash, &[bytes[at] as u64]);
        at += 1;
    }
    hash
}
