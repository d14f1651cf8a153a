//! The states of a running engine as bytes, written part by part so that no step has to wait.
//!
//! ```text
//! snapshot = part of diagnoser 0 | part of diagnoser 1 | … | part of input 0 | …
//! part     = length (u64) | state of the engine's share (bincode) | state of the diagnoser (its own envelope)
//! ```
//!
//! The step thread writes into room that the companion made; where it does not suffice, the companion makes more.
//! Each part is of one moment. Between two parts the engine may do steps: what it does not know of a diagnoser's
//! later instants shows as a gap when the snapshot is restored.

use bincode::config::{Configuration, Fixint, LittleEndian, NoLimit};
use bincode::enc::write::SizeWriter;
use residual_shared::counters::ScheduleCounters;
use serde::{Deserialize, Serialize, de::DeserializeOwned};

use super::assembler::AssemblerState;
use super::engine::Engine;
use super::unit::Unit;
use crate::lifecycle::LifecycleState;

/// What of a diagnoser's unit outlasts a step, beside the diagnoser's own state.
#[derive(Debug, Serialize, Deserialize)]
pub struct UnitState<A> {
    /// Number of the next sampling instant.
    pub next_step: u64,
    /// Whether its time has begun.
    pub begun: bool,
    /// Whether it was reset since its last record.
    pub was_reset: bool,
    /// Its schedule counters.
    pub counters: [u64; ScheduleCounters::COUNT],
    /// Its alarm.
    pub lifecycle: LifecycleState,
    /// What its assembler keeps.
    pub assembler: A,
}

/// Bytes and how far they have been written.
#[derive(Debug, Default)]
pub struct Snapshot {
    bytes: Vec<u8>,
    parts: usize,
    /// Of the engine whose states these are.
    generation: u64,
    /// Bytes that the next part needs and that there is no room for.
    missing: usize,
}

/// How far a snapshot came.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// It is whole.
    Whole,
    /// There was no time for more.
    Unfinished,
    /// The next part needs more room: [`Snapshot::grow`].
    NoRoom,
}

/// How all that is not a diagnoser's own state is written.
pub(super) const fn encoding() -> Configuration<LittleEndian, Fixint, NoLimit> {
    bincode::config::legacy()
}

impl Snapshot {
    /// Makes room for the part that had none, and for as much again as there is.
    pub fn grow(&mut self) {
        self.bytes.reserve(self.missing + self.bytes.len());
    }

    /// What has been written.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Forgets what has been written and keeps the room.
    pub fn clear(&mut self) {
        self.bytes.clear();
        self.parts = 0;
    }

    /// Writes one part: `head` and what `write` appends, which are `tail` bytes. False: there is no room for it.
    fn put(&mut self, head: &impl Serialize, tail: usize, write: impl FnOnce(&mut Vec<u8>)) -> bool {
        let mut size = SizeWriter::default();
        let counted = bincode::serde::encode_into_writer(head, &mut size, encoding());
        let length = size.bytes_written + tail;
        self.missing = length + size_of::<u64>();
        if self.bytes.capacity() - self.bytes.len() < self.missing {
            return false;
        }
        self.bytes.extend_from_slice(&(length as u64).to_le_bytes());
        let written = bincode::serde::encode_into_std_write(head, &mut self.bytes, encoding());
        debug_assert!(counted.is_ok() && written.is_ok(), "{counted:?} {written:?}");
        write(&mut self.bytes);
        self.parts += 1;
        true
    }
}

impl Engine {
    /// Goes on with a snapshot: writes at least one part, and more as long as `go_on` says so.
    ///
    /// A snapshot of another engine begins anew. No allocation.
    pub fn save(&self, snapshot: &mut Snapshot, mut go_on: impl FnMut() -> bool) -> Progress {
        if snapshot.generation != self.generation {
            snapshot.clear();
            snapshot.generation = self.generation;
        }
        loop {
            let put = if let Some(unit) = self.units.get(snapshot.parts) {
                let size = unit.diagnoser.state_size();
                snapshot.put(&unit.state(), size, |bytes| unit.diagnoser.save(bytes))
            } else if let Some(inbox) = self.inboxes.get(snapshot.parts - self.units.len()) {
                snapshot.put(inbox.state(), 0, |_| {})
            } else {
                return Progress::Whole;
            };
            if !put {
                return Progress::NoRoom;
            }
            if !go_on() {
                return Progress::Unfinished;
            }
        }
    }
}

impl Unit {
    fn state(&self) -> UnitState<&AssemblerState> {
        UnitState {
            next_step: self.next_step,
            begun: self.begun,
            was_reset: self.was_reset,
            lifecycle: self.lifecycle.save(),
            counters: self.counters.to_words(),
            assembler: self.assembler.state(),
        }
    }
}

/// The parts of a snapshot; `None` if the bytes end within one.
pub fn parts(mut bytes: &[u8]) -> Option<Vec<&[u8]>> {
    let mut parts = Vec::new();
    while !bytes.is_empty() {
        let (length, rest) = bytes.split_first_chunk()?;
        let length = usize::try_from(u64::from_le_bytes(*length)).ok()?;
        let (part, rest) = rest.split_at_checked(length)?;
        parts.push(part);
        bytes = rest;
    }
    Some(parts)
}

/// The head of a part and what follows it.
pub fn read<S: DeserializeOwned>(part: &[u8]) -> Option<(S, &[u8])> {
    let (head, used) = bincode::serde::decode_from_slice(part, encoding()).ok()?;
    Some((head, part.get(used..)?))
}
