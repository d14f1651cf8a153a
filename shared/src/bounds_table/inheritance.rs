//! The alarms that a new table takes over from the one that it replaces.
//!
//! Most of it is copied while the old table's daemon may still be writing to it, so that little is left for the
//! moment of the exchange: [`Inheritance::catch_up`] takes what it has not taken yet.
//!
//! The words of an alarm's status are stored one by one, behind the transition in the ring. A daemon that was
//! killed on the way leaves a status of the transition before, or of both; a transition in the ring that is not
//! older than the status is therefore what counts.

use std::collections::HashMap;
use std::io;
use std::sync::atomic::{Ordering, fence};

use super::alarm_words::{decode_alarm, encode_alarm};
use super::directory::AlarmRing;
use super::encoding::{join, split};
use super::layout::{ALARM_SLOT_WORD, ALARM_WORDS};
use super::old_table::OldTable;
use super::protocol::WriteWord;
use crate::alarm::{AlarmNumber, AlarmState, AlarmTransition, NONE, alarm_flags};
use crate::clock::monotonic_ns;
use crate::counters::AlarmStatus;
use crate::record::Verdict;

/// How many transitions are read with one system call.
const BLOCK: usize = 8;

/// What is known of the alarms of an old table.
pub(super) struct Inheritance {
    slots: Vec<OldSlot>,
    /// Number of the newest transition that was copied.
    copied: u64,
}

/// A diagnoser of the old table.
struct OldSlot {
    identity: u64,
    /// The slot of the same diagnoser in the new table.
    new: Option<u32>,
    status: AlarmStatus,
    /// The newest of its transitions that was copied.
    latest: Option<AlarmTransition>,
}

impl Inheritance {
    /// Nothing has been copied; `identities`: of the slots of the new table.
    pub(super) fn new(old: &OldTable, identities: &[u64]) -> Self {
        let slots = identities
            .iter()
            .zip(0..)
            .map(|(identity, slot)| (*identity, slot));
        let new_slots: HashMap<u64, u32> = slots.collect();
        let old_slot = |identity| OldSlot {
            identity,
            new: new_slots.get(&identity).copied(),
            status: AlarmStatus::default(),
            latest: None,
        };
        Self {
            slots: old.identities().map(old_slot).collect(),
            copied: 0,
        }
    }

    /// Copies the transitions that have come since the last time, as far as `ring` has room for them, and reads how
    /// the alarms stand.
    ///
    /// Their slots become those of the same diagnosers in the new table. Allocates nothing.
    pub(super) fn catch_up<W: WriteWord>(
        &mut self,
        old: &OldTable,
        ring: &AlarmRing<'_, W>,
    ) -> io::Result<()> {
        let newest = old.newest()?;
        // All words of the transitions up to that number are seen below.
        fence(Ordering::Acquire);
        let capacity = old.alarm_capacity();
        let oldest = newest.saturating_sub(ring.capacity().min(capacity)) + 1;
        let mut number = oldest.max(self.copied.saturating_add(1));
        while number <= newest {
            let mut words = [0; BLOCK * ALARM_WORDS];
            let mut again = words;
            let count = old.transitions(number, newest, &mut words)?;
            // As in every reading of the ring: what has its number still, was not overwritten before.
            fence(Ordering::Acquire);
            old.transitions(number, newest, &mut again)?;
            let (entries, _) = words.as_chunks::<ALARM_WORDS>();
            let (entries_again, _) = again.as_chunks::<ALARM_WORDS>();
            for (entry, [number_again, ..]) in entries.iter().zip(entries_again).take(count) {
                if entry[0] == number && *number_again == number {
                    self.copy(entry, ring);
                }
                number += 1;
            }
        }
        self.copied = newest;
        ring.newest.store(newest);
        for (index, slot) in self.slots.iter_mut().enumerate() {
            slot.status = old.status(index)?;
            if let Some(latest) = slot
                .latest
                .filter(|latest| latest.number.number >= slot.status.number)
            {
                slot.status = AlarmStatus::after(&latest);
            }
        }
        Ok(())
    }

    fn copy<W: WriteWord>(&mut self, entry: &[u64; ALARM_WORDS], ring: &AlarmRing<'_, W>) {
        let (slot, state) = split(entry[ALARM_SLOT_WORD]);
        let slot = self.slots.get_mut(slot as usize);
        let new = slot.as_ref().and_then(|slot| slot.new).unwrap_or(NONE);
        if let (Some(slot), Some(transition)) = (slot, decode_alarm(entry)) {
            slot.latest = Some(transition);
        }
        let mut entry = *entry;
        entry[ALARM_SLOT_WORD] = join(new, state);
        ring.put(&entry);
    }

    /// How the alarms stand of diagnosers that both tables have, each with its slot in the new one.
    pub(super) fn status(&self) -> impl Iterator<Item = (usize, AlarmStatus)> {
        let slots = self.slots.iter();
        slots.filter_map(|slot| Some((slot.new? as usize, slot.status)))
    }

    /// Clears the alarms of diagnosers that the new table does not have, by transitions of the life `epoch`: nobody
    /// else could any more, and clients would take them for active for ever.
    pub(super) fn withdraw_gone<W: WriteWord>(&self, ring: &AlarmRing<'_, W>, epoch: u64) {
        let is_cleared = |slot: &OldSlot| slot.status.state == AlarmState::Cleared as u64;
        let gone = self.slots.iter().filter(|slot| slot.new.is_none());
        for slot in gone.filter(|slot| !is_cleared(slot)) {
            ring.append(&encode_alarm(&AlarmTransition {
                number: AlarmNumber { epoch, number: 0 },
                written_ns: monotonic_ns(),
                instant_ns: slot.status.instant_ns,
                step: slot.latest.map_or(0, |latest| latest.step),
                slot: NONE,
                identity: slot.identity,
                state: AlarmState::Cleared,
                flags: alarm_flags::WITHDRAWN,
                verdict: Verdict::NotEvaluated as u32,
                occurrence: slot.status.occurrences,
                certainly_faulty: 0,
                possibly_faulty: 0,
                channel: NONE,
                ratio: f64::NAN,
                fault_estimate: f64::NAN,
                fault_estimate_half_width: f64::NAN,
            }));
        }
    }
}
