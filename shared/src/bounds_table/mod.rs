//! The bounds table: a small file in shared memory in which any number of clients poll the step records.
//!
//! # Principles
//! - The daemon owns the file and is the only one who writes. Clients map it read-only: they need no
//!   permission to write, take no place, and nothing has to be cleaned up when one of them is killed.
//! - A reader makes no system call, a writer neither waits nor looks for readers; its cost does not depend on
//!   their number.
//! - A daemon killed in the middle of a write leaves the last whole record readable ([`protocol`]).
//! - The daemon never changes the size of a table that somebody may have mapped (memory behind a truncated
//!   file kills its readers with SIGBUS). A new life of the daemon is a new file renamed over the old one;
//!   the old one is then marked closed, which tells its readers to open the path again.
//! - A reader trusts nothing: magic, layout, sizes and the whole directory are checked before any use, on a
//!   private copy, and a damaged or foreign file gives an error ([`OpenError`]).
//!
//! # Layout
//! The file is an array of 64-bit words of the machine's byte order. Offsets and sizes in it count bytes from
//! the start of the file and are multiples of 8. A *text* is one word: offset in the low, length in bytes
//! (UTF-8, without the closing zero byte) in the high 32 bits.
//!
//! | part | begins at | words |
//! |---|---|---|
//! | header | 0 | [`layout::header`] |
//! | slot entries | header word `SLOT_ENTRIES` | [`layout::slot_entry`]`::WORDS` each |
//! | input entries | header word `INPUT_ENTRIES` | [`layout::input_entry`]`::WORDS` each |
//! | texts and lists of texts | behind the entries | as long as they are |
//! | slot blocks | entry word `SLOT` | sequence line, cell 0, cell 1 |
//! | schedule counters | entry word `COUNTERS` | [`ScheduleCounters::NAMES`](crate::counters::ScheduleCounters::NAMES) in this order |
//! | alarm status | entry word `ALARM` | [`AlarmStatus::NAMES`](crate::counters::AlarmStatus::NAMES) in this order |
//! | input counters | entry word `COUNTERS` | [`InputCounters::NAMES`](crate::counters::InputCounters::NAMES) in this order |
//!
//! | alarm ring | header word `ALARM_RING` | [`layout::alarm_ring`], then `ALARM_CAPACITY` transitions of [`layout::ALARM_WORDS`] words |
//!
//! Everything above the slot blocks, but for the header words `STATE` and `HEARTBEAT`, never changes after the
//! file has appeared. Every slot block, cell and group of counters begins on a cache line of its own, so the
//! writing of one slot never disturbs the readers of another.
//!
//! A cell holds one record: [`layout::RECORD_HEAD_WORDS`] words and four for each channel ([`encoding`]).
//!
//! # Reading from another language
//! Read the sequence word `n` (0: no record yet), then an acquire fence; copy the cell `n & 1`; then another
//! acquire fence; read the sequence word again. The copy is a record if the word is still `n`.
//!
//! # Alarms in another language
//! Transition n lies at the place (n − 1) mod `ALARM_CAPACITY` ([`ring`], words as in the module `alarm_words`). It has
//! been written when `NEWEST` is n or more, read before an acquire fence. Read its first word, then an acquire
//! fence; copy its words; then another acquire fence; read its first word again. The copy is transition n if the
//! first word was n both times; otherwise it has been overwritten. To sleep until there is one above n: read the
//! 32 bits of the word `WAKE`, then an acquire fence; if `NEWEST` is n, `FUTEX_WAIT` (not private) on `WAKE` with
//! the value that was read (a daemon that was killed may have left another one there than the low half of n), with
//! a timeout of some 100 ms, after which to look at `STATE` and `HEARTBEAT`: a daemon that was killed wakes nobody.
//!
//! # Notation
//! | symbol | meaning |
//! |---|---|
//! | word | one 64-bit integer of the file, accessed atomically |
//! | line | 64 bytes, the unit in which processors share memory |
//! | slot | the place of one diagnoser |
//! | cell | the place of one record; a slot has two, written in turn |
//! | n | number of the newest record of a slot, 1 for the first |

mod alarm_words;
mod create;
mod decode;
mod directory;
pub mod encoding;
mod futex;
mod inheritance;
pub mod layout;
mod liveness;
mod mapping;
mod old_table;
mod open;
pub mod protocol;
#[cfg(test)]
mod protocol_model;
mod reader;
pub mod ring;
#[cfg(test)]
mod ring_model;
mod spec;
mod writer;

pub use create::{Access, CreateError, PreparedTable, boot_id};
pub use liveness::{HEARTBEAT_PERIOD_NS, HUNG_AFTER_NS, Liveness};
pub use open::OpenError;
pub use reader::{AlarmRead, ReadError, ReadOutcome, TableReader};
pub use spec::{
    ChannelSpec, Directory, InputSpec, MAX_ALARM_CAPACITY, MIN_ALARM_CAPACITY, SlotSpec, SpecError, TableSpec,
};
pub use writer::TableWriter;
