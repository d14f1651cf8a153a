//! How one writer hands numbered entries to any number of readers, none of whom it waits for.
//!
//! Entry n (1, 2, …) lies at the place (n − 1) mod capacity until entry n + capacity takes it. Its first word is
//! its number, and 0 while it is being written; the word `newest` is the number of the newest whole entry. A
//! reader asks for an entry by its number, so it knows whether it got it, has to wait, or came too late.
//!
//! # Why each ordering is needed
//! | where | ordering | without it |
//! |---|---|---|
//! | writer, after it has set the first word to 0 | release fence | a reader sees words of entry n + capacity and then still the number n |
//! | writer, number into the first word | `Release` | a reader sees the number before the words |
//! | writer, number into `newest` | `Release` | a reader sees the number in `newest` but not the entry, and takes it for lost |
//! | reader, between its looks and its copy | acquire fences | the same: they pair with the three above |

use super::protocol::{ReadWord, WriteWord};

/// What the question for one entry gave.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RingRead<const WORDS: usize> {
    /// It has not been written yet.
    Waiting,
    /// The whole entry; its first word is its number.
    Entry([u64; WORDS]),
    /// It is not there any more.
    Lost,
}

/// A ring of entries of `WORDS` words.
#[derive(Debug)]
pub struct Ring<'a, W, const WORDS: usize> {
    /// Number of the newest whole entry; 0: none.
    pub newest: &'a W,
    /// The entries, one behind the other.
    pub entries: &'a [W],
}

impl<W, const WORDS: usize> Ring<'_, W, WORDS> {
    /// How many entries the ring holds.
    pub fn capacity(&self) -> u64 {
        (self.entries.len() / WORDS) as u64
    }

    fn entry(&self, number: u64) -> Option<&[W; WORDS]> {
        let place = number.checked_sub(1)?.checked_rem(self.capacity())? as usize;
        self.entries[place * WORDS..].first_chunk()
    }
}

impl<W: WriteWord, const WORDS: usize> Ring<'_, W, WORDS> {
    /// Writes the next entry and gives its number; the first of `words` is replaced by it.
    ///
    /// There must be one writer at a time. If it dies on the way, readers keep all entries but the one that lay
    /// in this place.
    pub fn append(&self, words: &[u64; WORDS]) -> u64 {
        let number = self.newest.load_own().wrapping_add(1);
        let mut words = *words;
        words[0] = number;
        self.put(&words);
        self.newest.store_release(number);
        number
    }

    /// Writes an entry to the place of its number, `words[0]`, and leaves `newest` alone.
    pub fn put(&self, words: &[u64; WORDS]) {
        if let Some([first, others @ ..]) = self.entry(words[0]).map(|entry| &entry[..]) {
            first.store(0);
            W::release_fence();
            for (word, value) in others.iter().zip(&words[1..]) {
                word.store(*value);
            }
            first.store_release(words[0]);
        }
    }
}

impl<W: ReadWord, const WORDS: usize> Ring<'_, W, WORDS> {
    /// Reads the entry with this number.
    pub fn read(&self, number: u64) -> RingRead<WORDS> {
        if number > self.newest.load() {
            return RingRead::Waiting;
        }
        W::acquire_fence();
        let Some(entry) = self.entry(number) else {
            return RingRead::Lost;
        };
        if entry[0].load() != number {
            return RingRead::Lost;
        }
        W::acquire_fence();
        let words = std::array::from_fn(|index| entry[index].load());
        W::acquire_fence();
        if words[0] == number && entry[0].load() == number {
            RingRead::Entry(words)
        } else {
            RingRead::Lost
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::AtomicU64;

    fn ring<const COUNT: usize>(words: &[AtomicU64; COUNT]) -> Ring<'_, AtomicU64, 2> {
        Ring {
            newest: &words[0],
            entries: &words[1..],
        }
    }

    #[test]
    fn an_entry_is_there_until_the_ring_has_come_round() {
        let words: [AtomicU64; 9] = std::array::from_fn(|_| AtomicU64::new(0));
        let ring = ring(&words);
        assert_eq!(ring.capacity(), 4);
        assert_eq!(ring.read(1), RingRead::Waiting);
        for number in 1..=6 {
            assert_eq!(ring.append(&[99, 10 * number]), number);
            assert_eq!(ring.read(number), RingRead::Entry([number, 10 * number]));
        }
        assert_eq!([ring.read(1), ring.read(2)], [RingRead::Lost; 2]);
        assert_eq!(ring.read(3), RingRead::Entry([3, 30]));
        assert_eq!([ring.read(0), ring.read(7)], [RingRead::Lost, RingRead::Waiting]);
    }

    #[test]
    fn a_ring_without_room_numbers_and_loses_everything() {
        let words: [AtomicU64; 1] = std::array::from_fn(|_| AtomicU64::new(0));
        let ring = ring(&words);
        assert_eq!(ring.append(&[0, 1]), 1);
        assert_eq!(ring.read(1), RingRead::Lost);
    }
}
