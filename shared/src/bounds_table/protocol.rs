//! How one writer hands the newest of its records to any number of readers without waiting.
//!
//! A slot is a sequence word and two cells. Record n (1, 2, …) lies in cell `n & 1`; the sequence word holds
//! the number of the newest whole record. While the writer fills the other cell for record n+1, readers go on
//! copying record n. Only when it starts on record n+2 does it write where a slow reader of n may still be
//! copying; the sequence word has then left n, and that reader discards its copy and tries again.
//!
//! All accesses are atomic, so a copy that is discarded was never undefined behaviour.
//!
//! # Why each ordering is needed
//! | where | ordering | without it |
//! |---|---|---|
//! | writer, sequence := n+1 after the cell | `Release` | a reader sees n+1 before the cell's words |
//! | reader, after its first look at the sequence | acquire fence | the same: it pairs with that store |
//! | writer, before it writes the cell | release fence | words of n+2 may be seen by a reader who then still finds the sequence word at n |
//! | reader, after the copy | acquire fence | the same: it pairs with the writer's fence |
//!
//! The reader's first look is a relaxed load with a fence behind it, not an acquire load: on a read-only mapping
//! Rust defines relaxed atomic loads only. A test explores the interleavings and reorderings that
//! the memory model allows, and notices when the store's ordering, the release fence or the acquire fences are left
//! out. What needs no file runs under Miri as well:
//! `cargo +nightly miri test -p residual-shared --no-default-features --lib bounds_table`.

use std::hint;
use std::sync::atomic::{AtomicU64, Ordering, fence};

/// How often [`Slot::read`] tries before it gives up.
///
/// One attempt fails only if the writer finishes a record within a copy (10 to 150 ns). A periodic writer does not
/// do that twice in a row; the limit is there so that a client's reading time stays
/// bounded (about 10 µs) against any writer.
pub const READ_ATTEMPTS: u32 = 100;

/// A word that can be read while another thread or process writes it.
pub trait ReadWord {
    /// A relaxed load.
    fn load(&self) -> u64;
    /// A fence of acquire ordering.
    fn acquire_fence();
}

/// A word that the one writer may change.
pub trait WriteWord: ReadWord {
    /// The value that the writer itself stored last.
    fn load_own(&self) -> u64 {
        self.load()
    }
    /// A relaxed store.
    fn store(&self, value: u64);
    /// A store of release ordering.
    fn store_release(&self, value: u64);
    /// A fence of release ordering.
    fn release_fence();
}

impl ReadWord for AtomicU64 {
    fn load(&self) -> u64 {
        self.load(Ordering::Relaxed)
    }

    fn acquire_fence() {
        fence(Ordering::Acquire);
    }
}

impl WriteWord for AtomicU64 {
    fn store(&self, value: u64) {
        self.store(value, Ordering::Relaxed);
    }

    fn store_release(&self, value: u64) {
        self.store(value, Ordering::Release);
    }

    fn release_fence() {
        fence(Ordering::Release);
    }
}

/// What an attempt to read a slot gave.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Read<T> {
    /// Nothing has been written yet.
    Empty,
    /// A whole record and its number.
    Whole {
        /// Number of the record, 1 for the first.
        number: u64,
        /// What was read of it.
        value: T,
    },
    /// The writer overtook every attempt.
    Contended,
}

/// One slot: a sequence word and two cells of equal length.
#[derive(Debug)]
pub struct Slot<'a, W> {
    /// Number of the newest whole record; 0: none.
    pub sequence: &'a W,
    /// Record n lies in `cells[n & 1]`.
    pub cells: [&'a [W]; 2],
}

impl<W: WriteWord> Slot<'_, W> {
    /// Lets `write` fill the cell of the next record, and makes it the newest one.
    ///
    /// There must be one writer at a time. If `write` never returns, readers keep the record before.
    pub fn publish(&self, write: impl FnOnce(&[W])) {
        let next = self.sequence.load_own().wrapping_add(1);
        // Everything stored before (above all the sequence word of the last record) is seen by a reader that
        // sees any word stored below.
        W::release_fence();
        write(self.cells[(next & 1) as usize]);
        self.sequence.store_release(next);
    }
}

impl<W: ReadWord> Slot<'_, W> {
    /// Lets `copy` copy the newest record out of its cell, at most `attempts` times, until the copy is whole.
    ///
    /// `copy` sees mixed words of two records in attempts that are then discarded.
    pub fn read<T>(&self, attempts: u32, mut copy: impl FnMut(&[W]) -> T) -> Read<T> {
        for _ in 0..attempts {
            let number = self.sequence.load();
            if number == 0 {
                return Read::Empty;
            }
            // All words of record `number` are seen by the loads below.
            W::acquire_fence();
            let value = copy(self.cells[(number & 1) as usize]);
            // If a load above saw a word of record `number + 2`, the load below sees `number + 1` or more.
            W::acquire_fence();
            if self.sequence.load() == number {
                return Read::Whole { number, value };
            }
            hint::spin_loop();
        }
        Read::Contended
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::array;

    fn words() -> [AtomicU64; 5] {
        array::from_fn(|_| AtomicU64::new(0))
    }

    fn slot(words: &[AtomicU64; 5]) -> Slot<'_, AtomicU64> {
        Slot {
            sequence: &words[0],
            cells: [&words[1..3], &words[3..5]],
        }
    }

    fn copy(cell: &[AtomicU64]) -> [u64; 2] {
        [ReadWord::load(&cell[0]), ReadWord::load(&cell[1])]
    }

    #[test]
    fn an_unwritten_slot_is_empty_and_a_written_one_gives_the_newest_record() {
        let words = words();
        let slot = slot(&words);
        assert_eq!(slot.read(1, copy), Read::Empty);
        for number in 1..=5 {
            slot.publish(|cell| cell.iter().for_each(|word| WriteWord::store(word, 10 * number)));
            assert_eq!(
                slot.read(1, copy),
                Read::Whole {
                    number,
                    value: [10 * number; 2]
                }
            );
        }
    }

    #[test]
    fn a_writer_that_dies_in_its_cell_leaves_the_last_record() {
        let words = words();
        let slot = slot(&words);
        slot.publish(|cell| cell.iter().for_each(|word| WriteWord::store(word, 7)));
        let death = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
            slot.publish(|cell| {
                WriteWord::store(&cell[0], 8);
                std::panic::resume_unwind(Box::new("killed"));
            });
        }));
        assert!(death.is_err());
        assert_eq!(
            slot.read(1, copy),
            Read::Whole {
                number: 1,
                value: [7; 2]
            }
        );
    }

    #[test]
    fn a_reader_that_is_overtaken_in_every_attempt_gives_up() {
        let words = words();
        let slot = slot(&words);
        slot.publish(|_| ());
        let mut attempts = 0;
        let outcome = slot.read(9, |cell| {
            attempts += 1;
            slot.publish(|_| ());
            copy(cell)
        });
        assert_eq!((outcome, attempts), (Read::Contended, 9));
    }
}
