//! The table that a new one replaces.
//!
//! It is read and written through the file, not through its memory: it may be damaged, and a mapping of it could
//! fault.

use std::fs::{File, OpenOptions};
use std::io;
use std::os::unix::fs::{FileExt, MetadataExt, OpenOptionsExt};
use std::path::Path;

use nix::fcntl::OFlag;

use super::decode::decode;
use super::directory::Image;
use super::futex;
use super::layout::{
    ALARM_WORDS, HASH, LINE_WORDS, MAGIC, STATE_CLOSED, VERSION, WORD_BYTES, alarm_ring, header,
};
use super::mapping::ReadOnlyMapping;
use super::spec::{Directory, SlotSpec};
use crate::counters::AlarmStatus;

/// Numbers of transitions from here on are signs of damage: no daemon lives for so many.
const ABSURD_NUMBER: u64 = 1 << 63;

/// A table at the path before, written by the same user.
pub(super) struct OldTable {
    file: File,
    pub(super) epoch: u64,
    /// What stands in it, if it has this program's layout and is not damaged.
    contents: Option<(Directory, Image)>,
    /// Only to give the kernel the address of the futex: nothing is read or written through it.
    futex: Option<ReadOnlyMapping>,
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
            .and_then(|words| decode(&read_words(&file, 0, words).ok()?).ok())
            .filter(|(_, image)| (image.total_words * WORD_BYTES) as u64 <= metadata.len());
        let mut table = Self {
            epoch: head[header::EPOCH],
            futex: (contents.as_ref())
                .and_then(|(_, image)| ReadOnlyMapping::new(&file, image.total_words).ok()),
            file,
            contents,
        };
        if table.newest().is_ok_and(|newest| newest >= ABSURD_NUMBER) {
            table.contents = None;
        }
        Some(table)
    }

    /// Where its numbering of the alarms began, if that can go on.
    pub(super) fn alarm_origin(&self) -> Option<u64> {
        self.contents
            .as_ref()
            .map(|(directory, _)| directory.alarm_origin)
    }

    /// [`SlotSpec::identity`] of each of its slots; none if nothing can be taken over from it.
    pub(super) fn identities(&self) -> impl Iterator<Item = u64> {
        let slots = self
            .contents
            .iter()
            .flat_map(|(directory, _)| &directory.spec.slots);
        slots.map(SlotSpec::identity)
    }

    /// How many transitions its ring holds.
    pub(super) fn alarm_capacity(&self) -> u64 {
        (self.contents.as_ref()).map_or(0, |(_, image)| image.alarms.entries().1 as u64)
    }

    /// Number of the newest transition.
    pub(super) fn newest(&self) -> io::Result<u64> {
        let mut newest = [0];
        if let Some((_, image)) = &self.contents {
            let ring = image.alarms.entries().0 - alarm_ring::ENTRIES;
            read(&self.file, ring + alarm_ring::NEWEST, &mut newest)?;
        }
        Ok(newest[0])
    }

    /// Reads what lies in the places of the transitions `first` to at most `last`, as many as `words` has room for
    /// and as lie one behind the other, and gives how many.
    pub(super) fn transitions(&self, first: u64, last: u64, words: &mut [u64]) -> io::Result<usize> {
        let Some((_, image)) = &self.contents else {
            return Ok(0);
        };
        let (start, capacity) = image.alarms.entries();
        let place = (first.saturating_sub(1) % capacity as u64) as usize;
        let count = (words.len() / ALARM_WORDS)
            .min(capacity - place)
            .min((last - first).saturating_add(1) as usize);
        let start = start + place * ALARM_WORDS;
        read(&self.file, start, &mut words[..count * ALARM_WORDS])?;
        Ok(count)
    }

    /// What its words say about the alarm of the slot with the index `slot`.
    pub(super) fn status(&self, slot: usize) -> io::Result<AlarmStatus> {
        let mut words = [0; AlarmStatus::COUNT];
        if let Some(place) = (self.contents.as_ref()).and_then(|(_, image)| image.slots.get(slot)) {
            read(&self.file, place.alarm, &mut words)?;
        }
        Ok(AlarmStatus::from_words(words))
    }

    /// Marks it closed and wakes whoever waits for an alarm.
    pub(super) fn close(&self) -> io::Result<()> {
        let state = (header::STATE * WORD_BYTES) as u64;
        self.file.write_all_at(&STATE_CLOSED.to_ne_bytes(), state)?;
        if let (Some(mapping), Some((_, image))) = (&self.futex, &self.contents) {
            futex::wake_all(mapping.futex(image.alarms.wake()));
        }
        Ok(())
    }
}

fn read_words(file: &File, start: usize, count: usize) -> io::Result<Vec<u64>> {
    let mut words = vec![0; count];
    read(file, start, &mut words)?;
    Ok(words)
}

/// Reads words from the word `start` on. Allocates nothing.
fn read(file: &File, start: usize, words: &mut [u64]) -> io::Result<()> {
    const BLOCK: usize = 16 * LINE_WORDS;
    for (block, words) in words.chunks_mut(BLOCK).enumerate() {
        let mut bytes = [0; BLOCK * WORD_BYTES];
        let bytes = &mut bytes[..words.len() * WORD_BYTES];
        file.read_exact_at(bytes, ((start + block * BLOCK) * WORD_BYTES) as u64)?;
        let (values, _) = bytes.as_chunks::<WORD_BYTES>();
        for (word, value) in words.iter_mut().zip(values) {
            *word = u64::from_ne_bytes(*value);
        }
    }
    Ok(())
}
