//! A client's side of a table.

use std::path::{Path, PathBuf};
use std::sync::atomic::{Ordering, fence};
use std::time::Duration;

use super::alarm_words::decode_alarm;
use super::create::boot_id;
use super::directory::Image;
use super::encoding::load_record;
use super::futex;
use super::layout::header;
use super::liveness::Liveness;
use super::mapping::ReadOnlyMapping;
use super::open::{FileId, OpenError, file_id, open};
use super::protocol::{READ_ATTEMPTS, Read, ReadWord};
use super::ring::RingRead;
use super::spec::Directory;
use crate::alarm::AlarmTransition;
use crate::counters::{AlarmStatus, InputCounters, ScheduleCounters};
use crate::record::StepRecord;

/// A client's side of a table: one life of the daemon, mapped read-only.
///
/// Reading makes no system call and allocates nothing. The table stays readable after the daemon has died;
/// [`liveness`](Self::liveness) tells. If somebody other than the daemon truncates the file, reading it kills
/// the process with SIGBUS, as with every mapped file; the daemon itself never does that.
#[derive(Debug)]
pub struct TableReader {
    path: PathBuf,
    file: FileId,
    mapping: ReadOnlyMapping,
    directory: Directory,
    image: Image,
    earlier_boot: bool,
}

/// What [`TableReader::read`] found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReadOutcome {
    /// The diagnoser has not written any record yet; the caller's record is as it was.
    NeverWritten,
    /// The caller's record is the newest one.
    Record {
        /// How many records the diagnoser has written with this one; tells a new record from a known one.
        number: u64,
    },
}

/// What [`TableReader::read_alarm`] found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AlarmRead {
    /// There has not been so many transitions yet.
    Waiting,
    /// The transition.
    Transition(AlarmTransition),
    /// It has been overwritten by newer ones, or was lost when the daemon was killed.
    Lost,
}

/// Why a record or counters could not be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ReadError {
    /// The writer overtook every attempt.
    #[error("the writer overtook {READ_ATTEMPTS} attempts to read slot {slot}; try again")]
    Contended {
        /// Index of the slot.
        slot: usize,
    },
    /// There is no such slot.
    #[error("there is no slot {slot}; the table has {count}")]
    NoSuchSlot {
        /// Index asked for.
        slot: usize,
        /// Number of slots.
        count: usize,
    },
    /// There is no such input.
    #[error("there is no input {input}; the table has {count}")]
    NoSuchInput {
        /// Index asked for.
        input: usize,
        /// Number of inputs.
        count: usize,
    },
}

impl TableReader {
    /// Opens the table at `path`.
    ///
    /// # Errors
    /// See [`OpenError`]: no file, no permission, not a table, another layout, cut off, damaged.
    pub fn open(path: &Path) -> Result<Self, OpenError> {
        let opened = open(path)?;
        let here = boot_id();
        let there = opened.directory.boot_id;
        Ok(Self {
            path: path.into(),
            file: opened.file,
            mapping: opened.mapping,
            earlier_boot: here != 0 && there != 0 && here != there,
            directory: opened.directory,
            image: opened.image,
        })
    }

    /// What the table says about itself.
    pub fn directory(&self) -> &Directory {
        &self.directory
    }

    /// Reads the newest record of the slot with the index `slot`.
    ///
    /// # Errors
    /// [`ReadError::NoSuchSlot`]; [`ReadError::Contended`], after which `record` holds a mixture that is of no
    /// use.
    pub fn read(&self, slot: usize, record: &mut StepRecord) -> Result<ReadOutcome, ReadError> {
        let count = self.image.slots.len();
        let place = self
            .image
            .slots
            .get(slot)
            .ok_or(ReadError::NoSuchSlot { slot, count })?;
        match place
            .slot(self.mapping.words())
            .read(READ_ATTEMPTS, |cell| load_record(cell, record))
        {
            Read::Empty => Ok(ReadOutcome::NeverWritten),
            Read::Whole { number, .. } => Ok(ReadOutcome::Record { number }),
            Read::Contended => Err(ReadError::Contended { slot }),
        }
    }

    /// Reads the schedule counters of the slot with the index `slot`; each is whole, all together need not be
    /// of one moment.
    ///
    /// # Errors
    /// [`ReadError::NoSuchSlot`].
    pub fn read_schedule_counters(&self, slot: usize) -> Result<ScheduleCounters, ReadError> {
        let count = self.image.slots.len();
        let place = self
            .image
            .slots
            .get(slot)
            .ok_or(ReadError::NoSuchSlot { slot, count })?;
        Ok(ScheduleCounters::from_words(self.load(place.counters)))
    }

    /// Reads the counters of the input with the index `input`; each is whole, all together need not be of one
    /// moment.
    ///
    /// # Errors
    /// [`ReadError::NoSuchInput`].
    pub fn read_input_counters(&self, input: usize) -> Result<InputCounters, ReadError> {
        let count = self.image.inputs.len();
        let place = self
            .image
            .inputs
            .get(input)
            .ok_or(ReadError::NoSuchInput { input, count })?;
        Ok(InputCounters::from_words(self.load(*place)))
    }

    /// Where the alarm of the diagnoser in `slot` stands; each number is whole, all together need not be of one
    /// moment.
    ///
    /// # Errors
    /// [`ReadError::NoSuchSlot`].
    pub fn read_alarm_status(&self, slot: usize) -> Result<AlarmStatus, ReadError> {
        let count = self.image.slots.len();
        let place = (self.image.slots.get(slot)).ok_or(ReadError::NoSuchSlot { slot, count })?;
        Ok(AlarmStatus::from_words(self.load(place.alarm)))
    }

    /// Number of the newest alarm transition; 0: there has not been any.
    pub fn newest_alarm(&self) -> u64 {
        self.image.alarms.ring(self.mapping.words()).newest.load()
    }

    /// Reads the alarm transition with this number.
    pub fn read_alarm(&self, number: u64) -> AlarmRead {
        match self.image.alarms.ring(self.mapping.words()).read(number) {
            RingRead::Waiting => AlarmRead::Waiting,
            RingRead::Lost => AlarmRead::Lost,
            RingRead::Entry(words) => decode_alarm(&words).map_or(AlarmRead::Lost, AlarmRead::Transition),
        }
    }

    /// Sleeps until there is a transition newer than the number `seen`, the table is closed, or `timeout` is over;
    /// may return earlier, and does at once unless `seen` is the newest one. A daemon that was killed wakes nobody: use a short timeout and look at
    /// [`liveness`](Self::liveness).
    pub fn wait_for_alarm(&self, seen: u64, timeout: Duration) {
        let futex = self.mapping.futex(self.image.alarms.wake());
        // Not the low half of `seen`: a daemon that was killed between `newest` and the futex has left that behind,
        // and a sleep on a value that the futex does not hold is over at once.
        let value = futex.load(Ordering::Relaxed);
        // The daemon stores `newest` before the futex: whoever has seen the new futex sees the new number below.
        fence(Ordering::Acquire);
        if self.newest_alarm() == seen {
            futex::wait(futex, value, timeout);
        }
    }

    /// Whether the daemon behind this table lives, at the moment `now_ns` of CLOCK_MONOTONIC.
    pub fn liveness(&self, now_ns: u64) -> Liveness {
        if self.earlier_boot {
            return Liveness::Closed;
        }
        let words = self.mapping.words();
        Liveness::judge(
            words[header::STATE].load(),
            words[header::HEARTBEAT].load(),
            now_ns,
        )
    }

    /// Time since the daemon's last sign of life, at the moment `now_ns` of CLOCK_MONOTONIC.
    pub fn heartbeat_age(&self, now_ns: u64) -> Duration {
        let heartbeat_ns = self.mapping.words()[header::HEARTBEAT].load();
        Duration::from_nanos(now_ns.saturating_sub(heartbeat_ns))
    }

    /// Whether the path leads to another file by now (one system call): the daemon has been started again.
    pub fn is_replaced(&self) -> bool {
        file_id(&self.path).is_ok_and(|file| file != self.file)
    }

    fn load<const COUNT: usize>(&self, start: usize) -> [u64; COUNT] {
        let words = &self.mapping.words()[start..start + COUNT];
        std::array::from_fn(|index| words[index].load())
    }
}
