//! The daemon's side of a table.

use std::path::Path;

use super::create::{Access, CreateError, create};
use super::directory::Image;
use super::encoding::store_record;
use super::layout::{STATE_CLOSED, header};
use super::mapping::WritableMapping;
use super::protocol::WriteWord;
use super::spec::TableSpec;
use crate::counters::{InputCounters, ScheduleCounters};
use crate::record::StepRecord;

/// The daemon's side of a table.
///
/// Publishing allocates nothing, makes no system call and does not panic: an index outside the specification
/// is a programming error that debug builds report and release builds ignore. Dropping marks the table closed;
/// the file stays, so that a client can say that the daemon has ended.
#[derive(Debug)]
pub struct TableWriter {
    mapping: WritableMapping,
    image: Image,
}

impl TableWriter {
    /// Creates the table at `path` and makes it the one that clients find there.
    ///
    /// A complete new file is renamed over whatever lies there; a table of an earlier life is marked closed, and
    /// temporary files that earlier lives left are removed. One daemon at a time may do this for one path (the
    /// instance's lock sees to it).
    ///
    /// # Errors
    /// See [`CreateError`]. An older table then stays as it was.
    pub fn create(path: &Path, spec: &TableSpec, access: &Access) -> Result<Self, CreateError> {
        create(path, spec, access).map(|(mapping, image)| Self { mapping, image })
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
            self.store(place.counters, &counters.to_words());
        }
    }

    /// Shows the counters of the input with the index `input`, as
    /// [`publish_schedule_counters`](Self::publish_schedule_counters) does.
    pub fn publish_input_counters(&self, input: usize, counters: &InputCounters) {
        let place = self.image.inputs.get(input);
        debug_assert!(place.is_some(), "no input {input}");
        if let Some(place) = place {
            self.store(*place, &counters.to_words());
        }
    }

    /// Marks the table closed: the daemon ends in good order.
    pub fn close(&self) {
        WriteWord::store_release(&self.mapping.words()[header::STATE], STATE_CLOSED);
    }

    fn store(&self, start: usize, values: &[u64]) {
        for (word, value) in self.mapping.words()[start..].iter().zip(values) {
            WriteWord::store(word, *value);
        }
    }
}

impl Drop for TableWriter {
    fn drop(&mut self) {
        self.close();
    }
}
