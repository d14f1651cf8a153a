//! Every interleaving and reordering of the protocol, explored by loom.
//!
//! The orderings come from the word type, so a word type that leaves one of them out shows whether the
//! exploration would notice.
#![cfg(not(miri))] // loom switches stacks by hand, which Miri cannot follow.

use std::panic;

use loom::sync::Arc;
use loom::sync::atomic::{AtomicU64, Ordering, fence};
use loom::thread;

use super::protocol::{Read, ReadWord, Slot, WriteWord};

pub(super) const PUBLISH_ORDERED: u8 = 1;
pub(super) const RELEASE_FENCE: u8 = 2;
pub(super) const ACQUIRE_FENCE: u8 = 4;
pub(super) const ALL: u8 = PUBLISH_ORDERED | RELEASE_FENCE | ACQUIRE_FENCE;

/// A word with the given orderings; those left out are relaxed.
///
/// The writer's look at its own word is kept from loom, which remembers only the latest access of a word when it
/// decides what to reorder: the writer's load would hide the reader's, and nothing would be explored.
pub(super) struct Word<const ORDERINGS: u8> {
    word: AtomicU64,
    own: std::sync::atomic::AtomicU64,
}

impl<const ORDERINGS: u8> Word<ORDERINGS> {
    pub(super) fn new() -> Self {
        Self {
            word: AtomicU64::new(0),
            own: 0.into(),
        }
    }
}

impl<const ORDERINGS: u8> ReadWord for Word<ORDERINGS> {
    fn load(&self) -> u64 {
        self.word.load(Ordering::Relaxed)
    }

    fn acquire_fence() {
        if ORDERINGS & ACQUIRE_FENCE != 0 {
            fence(Ordering::Acquire);
        }
    }
}

impl<const ORDERINGS: u8> WriteWord for Word<ORDERINGS> {
    fn load_own(&self) -> u64 {
        self.own.load(Ordering::Relaxed)
    }

    fn store(&self, value: u64) {
        self.own.store(value, Ordering::Relaxed);
        self.word.store(value, Ordering::Relaxed);
    }

    fn store_release(&self, value: u64) {
        let ordered = ORDERINGS & PUBLISH_ORDERED != 0;
        self.own.store(value, Ordering::Relaxed);
        self.word.store(
            value,
            if ordered {
                Ordering::Release
            } else {
                Ordering::Relaxed
            },
        );
    }

    fn release_fence() {
        if ORDERINGS & RELEASE_FENCE != 0 {
            fence(Ordering::Release);
        }
    }
}

/// Sequence word and two cells of two words.
struct Words<const ORDERINGS: u8>([Word<ORDERINGS>; 5]);

impl<const ORDERINGS: u8> Words<ORDERINGS> {
    fn new() -> Self {
        Self(std::array::from_fn(|_| Word::new()))
    }

    fn slot(&self) -> Slot<'_, Word<ORDERINGS>> {
        Slot {
            sequence: &self.0[0],
            cells: [&self.0[1..3], &self.0[3..5]],
        }
    }
}

/// A writer of `records` records, record n being twice the word n, against a reader of two.
fn explore<const ORDERINGS: u8>(records: u64) {
    loom::model(move || {
        let words = Arc::new(Words::<ORDERINGS>::new());
        let writer = {
            let words = Arc::clone(&words);
            thread::spawn(move || {
                for number in 1..=records {
                    words
                        .slot()
                        .publish(|cell| cell.iter().for_each(|word| word.store(number)));
                }
            })
        };
        let mut newest = 0;
        for _ in 0..2 {
            match words.slot().read(2, |cell| [cell[0].load(), cell[1].load()]) {
                Read::Empty => assert_eq!(newest, 0, "went back to nothing"),
                Read::Whole { number, value } => {
                    assert_eq!(value, [number; 2], "torn");
                    assert!(number >= newest, "went backwards");
                    newest = number;
                }
                Read::Contended => {}
            }
        }
        writer.join().unwrap();
        let last = words.slot().read(1, |cell| [cell[0].load(), cell[1].load()]);
        assert_eq!(
            last,
            Read::Whole {
                number: records,
                value: [records; 2]
            }
        );
    });
}

fn finds_a_fault<const ORDERINGS: u8>() -> bool {
    panic::catch_unwind(|| explore::<ORDERINGS>(3)).is_err()
}

#[test]
fn no_reader_ever_sees_a_torn_record_or_goes_backwards() {
    explore::<ALL>(2);
    explore::<ALL>(3);
}

#[test]
fn the_exploration_notices_each_ordering_that_is_left_out() {
    assert!(
        finds_a_fault::<{ ALL & !PUBLISH_ORDERED }>(),
        "sequence word stored relaxed"
    );
    assert!(finds_a_fault::<{ ALL & !RELEASE_FENCE }>(), "no release fence");
    assert!(finds_a_fault::<{ ALL & !ACQUIRE_FENCE }>(), "no acquire fences");
}
