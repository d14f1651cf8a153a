//! The daemon's side of a table.

use std::path::Path;
use std::sync::atomic::Ordering;

use super::alarm_words::encode_alarm;
use super::create::{Access, CreateError, PreparedTable};
use super::directory::Image;
use super::encoding::store_record;
use super::futex;
use super::layout::{STATE_CLOSED, header};
use super::mapping::WritableMapping;
use super::protocol::WriteWord;
use super::spec::TableSpec;
use crate::alarm::{AlarmNumber, AlarmTransition};
use crate::clock::monotonic_ns;
use crate::counters::{AlarmStatus, InputCounters, ScheduleCounters};
use crate::record::StepRecord;

/// The daemon's side of a table.
///
/// Publishing allocates nothing, makes no system call but the wake-up of an alarm, and does not panic: an index outside the specification
/// is a programming error that debug builds report and release builds ignore. Dropping marks the table closed;
/// the file stays, so that a client can say that the daemon has ended.
#[derive(Debug)]
pub struct TableWriter {
    mapping: WritableMapping,
    image: Image,
    epoch: u64,
    /// Of each slot, for its transitions.
    identities: Vec<u64>,
}

impl TableWriter {
    /// Creates the table at `path` and makes it the one that clients find there.
    ///
    /// A complete new file is renamed over whatever lies there; a table of an earlier life is marked closed, its
    /// alarms are taken over, and temporary files that earlier lives left are removed. One daemon at a time may do
    /// this for one path (the instance's lock sees to it). [`PreparedTable`] does it in two steps.
    ///
    /// # Errors
    /// See [`CreateError`]. An older table then stays as it was.
    pub fn create(path: &Path, spec: &TableSpec, access: &Access) -> Result<Self, CreateError> {
        PreparedTable::create(path, spec, access)?.publish()
    }

    /// The writer of a table that clients find by now.
    pub(super) fn new(mapping: WritableMapping, image: Image, epoch: u64, identities: Vec<u64>) -> Self {
        Self {
            mapping,
            image,
            epoch,
            identities,
        }
    }

    /// Number of this life of the daemon.
    pub fn epoch(&self) -> u64 {
        self.epoch
    }

    /// [`SlotSpec::identity`](super::SlotSpec::identity) of the slot with the index `slot`.
    pub fn identity(&self, slot: usize) -> Option<u64> {
        self.identities.get(slot).copied()
    }

    /// The slot with this [`SlotSpec::identity`](super::SlotSpec::identity).
    pub fn slot_with_identity(&self, identity: u64) -> Option<usize> {
        self.identities.iter().position(|other| *other == identity)
    }

    /// Writes a transition of the alarm of the diagnoser in `transition.slot`, wakes everybody who waits for one
    /// (one system call), and gives the transition's number.
    ///
    /// `number` and `written_ns` of `transition` are replaced, and `identity` by that of its slot, if it has one.
    pub fn raise(&mut self, transition: &AlarmTransition) -> AlarmNumber {
        let slot = transition.slot as usize;
        let transition = AlarmTransition {
            number: AlarmNumber {
                epoch: self.epoch,
                number: 0,
            },
            identity: self.identity(slot).unwrap_or(transition.identity),
            written_ns: monotonic_ns(),
            ..*transition
        };
        let futex = self.mapping.futex(self.image.alarms.wake());
        let number = write_transition(self.mapping.words(), &self.image, &transition, |value| {
            futex.store(value, Ordering::Release);
        });
        futex::wake_all(futex);
        AlarmNumber {
            epoch: self.epoch,
            number,
        }
    }

    /// Makes `record` the newest one of the slot with the index `slot`.
    pub fn publish(&mut self, slot: usize, record: &StepRecord) {
        let place = self.image.slots.get(slot);
        debug_assert!(place.is_some(), "no slot {slot}");
        if let Some(place) = place {
            place
                .slot(self.mapping.words())
                .publish(|cell| store_record(cell, record));
        }
    }

    /// Gives a sign of life at the moment `now_ns` of CLOCK_MONOTONIC; due every
    /// [`HEARTBEAT_PERIOD_NS`](super::HEARTBEAT_PERIOD_NS), from the thread whose life it shall prove.
    pub fn heartbeat(&self, now_ns: u64) {
        WriteWord::store(&self.mapping.words()[header::HEARTBEAT], now_ns);
    }

    /// Shows the counters of the slot with the index `slot`. Each counter is whole, all together need not be of
    /// one moment.
    pub fn publish_schedule_counters(&self, slot: usize, counters: &ScheduleCounters) {
        let place = self.image.slots.get(slot);
        debug_assert!(place.is_some(), "no slot {slot}");
        if let Some(place) = place {
            store(self.mapping.words(), place.counters, &counters.to_words());
        }
    }

    /// Shows the counters of the input with the index `input`, as
    /// [`publish_schedule_counters`](Self::publish_schedule_counters) does.
    pub fn publish_input_counters(&self, input: usize, counters: &InputCounters) {
        let place = self.image.inputs.get(input);
        debug_assert!(place.is_some(), "no input {input}");
        if let Some(place) = place {
            store(self.mapping.words(), *place, &counters.to_words());
        }
    }

    /// Marks the table closed, the daemon ends in good order, and wakes whoever waits for an alarm.
    pub fn close(&self) {
        WriteWord::store_release(&self.mapping.words()[header::STATE], STATE_CLOSED);
        futex::wake_all(self.mapping.futex(self.image.alarms.wake()));
    }
}

/// Appends a transition to the ring, puts its number into the futex, and shows it in the status of its slot; gives
/// the number.
///
/// The order matters to whoever finds the table of a daemon that was killed on the way: the ring is ahead of the
/// futex and of the status, never behind.
fn write_transition<W: WriteWord>(
    words: &[W],
    image: &Image,
    transition: &AlarmTransition,
    store_futex: impl FnOnce(u32),
) -> u64 {
    let number = image.alarms.ring(words).append(&encode_alarm(transition));
    store_futex(number as u32);
    if let Some(place) = image.slots.get(transition.slot as usize) {
        let mut written = *transition;
        written.number.number = number;
        store(words, place.alarm, &AlarmStatus::after(&written).to_words());
    }
    number
}

fn store<W: WriteWord>(words: &[W], start: usize, values: &[u64]) {
    for (word, value) in words[start..].iter().zip(values) {
        word.store(*value);
    }
}

impl Drop for TableWriter {
    fn drop(&mut self) {
        self.close();
    }
}

#[cfg(test)]
#[path = "killed_writer.rs"]
mod killed_writer;
