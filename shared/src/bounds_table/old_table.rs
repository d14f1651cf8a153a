//! The table that a new one replaces: its epoch, and the alarms that the new one takes over from it.
//!
//! It is read and written through the file, not through its memory: it may be damaged, and a mapping of it could
//! fault.

use std::fs::{File, OpenOptions};
use std::io;
use std::os::unix::fs::{FileExt, MetadataExt, OpenOptionsExt};
use std::path::Path;

use nix::fcntl::OFlag;

use super::decode::decode;
use super::directory::{AlarmRing, Image};
use super::encoding::{join, split};
use super::layout::{
    ALARM_SLOT_WORD, ALARM_WORDS, HASH, MAGIC, STATE_CLOSED, VERSION, WORD_BYTES, alarm_ring, header,
};
use super::protocol::WriteWord;
use super::spec::{Directory, TableSpec};
use crate::alarm::NONE;
use crate::counters::AlarmStatus;

/// A table at the path before, written by the same user.
pub(super) struct OldTable {
    file: File,
    pub(super) epoch: u64,
    /// What stands in it, if it has this program's layout and is not damaged.
    contents: Option<(Directory, Image)>,
}

impl OldTable {
    /// Opens what lies at `path` if it is a table of this user.
    pub(super) fn open(path: &Path) -> Option<Self> {
        let flags = OFlag::O_NOFOLLOW | OFlag::O_NONBLOCK;
        let file = OpenOptions::new()
            .read(true)
            .write(true)
            .custom_flags(flags.bits())
            .open(path)
            .ok()?;
        let metadata = file.metadata().ok()?;
        if !metadata.is_file() || metadata.uid() != nix::unistd::geteuid().as_raw() {
            return None;
        }
        let head = read_words(&file, 0, header::WORDS).ok()?;
        if head[header::MAGIC] != MAGIC {
            return None;
        }
        let own_layout = head[header::VERSION] == VERSION && head[header::HASH] == HASH;
        let contents = Some(head[header::DIRECTORY_BYTES].min(metadata.len()) as usize / WORD_BYTES)
            .filter(|_| own_layout)
            .and_then(|words| decode(&read_words(&file, 0, words).ok()?).ok());
        Some(Self {
            file,
            epoch: head[header::EPOCH],
            contents,
        })
    }

    /// Where its numbering of the alarms began, if that can go on.
    pub(super) fn alarm_origin(&self) -> Option<u64> {
        self.contents
            .as_ref()
            .map(|(directory, _)| directory.alarm_origin)
    }

    /// For each diagnoser of `spec`: where its alarm stood, if the old table had the same diagnoser.
    pub(super) fn alarm_status(&self, spec: &TableSpec) -> Vec<Option<AlarmStatus>> {
        let status = |identity: u64| {
            let (directory, image) = self.contents.as_ref()?;
            let slot = directory
                .spec
                .slots
                .iter()
                .position(|slot| slot.identity() == identity)?;
            let words = read_words(&self.file, image.slots[slot].alarm, AlarmStatus::COUNT).ok()?;
            Some(AlarmStatus::from_words(words.try_into().ok()?))
        };
        spec.slots.iter().map(|slot| status(slot.identity())).collect()
    }

    /// Copies the transitions that `ring` has room for, newest last, and gives the number of the newest one.
    ///
    /// Their slots become those of the diagnosers with the same identity in `spec`.
    pub(super) fn hand_over<W: WriteWord>(
        &self,
        spec: &TableSpec,
        ring: &AlarmRing<'_, W>,
    ) -> io::Result<u64> {
        let Some((directory, image)) = &self.contents else {
            return Ok(0);
        };
        let slots: Vec<u32> = (directory.spec.slots.iter())
            .map(|old| spec.slots.iter().position(|new| new.identity() == old.identity()))
            .map(|slot| slot.map_or(NONE, |slot| slot as u32))
            .collect();
        let (start, capacity) = image.alarms.entries();
        let newest = read_words(&self.file, start - alarm_ring::ENTRIES + alarm_ring::NEWEST, 1)?[0];
        let words = read_words(&self.file, start, capacity * ALARM_WORDS)?;
        let (entries, _) = words.as_chunks::<ALARM_WORDS>();
        let count = newest.min(ring.capacity()).min(entries.len() as u64);
        for number in newest - count + 1..=newest {
            let mut entry = entries[((number - 1) % entries.len() as u64) as usize];
            if entry[0] != number {
                continue;
            }
            let (slot, state) = split(entry[ALARM_SLOT_WORD]);
            let slot = slots.get(slot as usize).copied().unwrap_or(NONE);
            entry[ALARM_SLOT_WORD] = join(slot, state);
            ring.put(&entry);
        }
        ring.newest.store(newest);
        Ok(newest)
    }

    /// Marks it closed.
    pub(super) fn close(&self) -> io::Result<()> {
        self.file
            .write_all_at(&STATE_CLOSED.to_ne_bytes(), (header::STATE * WORD_BYTES) as u64)
    }
}

fn read_words(file: &File, start: usize, count: usize) -> io::Result<Vec<u64>> {
    let mut bytes = vec![0; count * WORD_BYTES];
    file.read_exact_at(&mut bytes, (start * WORD_BYTES) as u64)?;
    let (words, _) = bytes.as_chunks::<WORD_BYTES>();
    Ok(words.iter().map(|word| u64::from_ne_bytes(*word)).collect())
}
