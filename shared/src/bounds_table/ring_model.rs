//! Every interleaving and reordering of the ring, explored by loom, as for the slots in `protocol_model`.
#![cfg(not(miri))] // loom switches stacks by hand, which Miri cannot follow.

use std::panic;

use loom::sync::Arc;
use loom::thread;

use super::protocol_model::{ACQUIRE_FENCE, ALL, PUBLISH_ORDERED, RELEASE_FENCE, Word};
use super::ring::{Ring, RingRead};

/// The newest number and one place of two words: every entry takes the place of the one before.
struct Words<const ORDERINGS: u8>([Word<ORDERINGS>; 3]);

impl<const ORDERINGS: u8> Words<ORDERINGS> {
    fn ring(&self) -> Ring<'_, Word<ORDERINGS>, 2> {
        Ring {
            newest: &self.0[0],
            entries: &self.0[1..],
        }
    }
}

/// A writer of two entries, entry n being n and 10 n, against a reader that asks for both.
fn explore<const ORDERINGS: u8>() {
    loom::model(|| {
        let words = Arc::new(Words::<ORDERINGS>(std::array::from_fn(|_| Word::new())));
        let writer = {
            let words = Arc::clone(&words);
            thread::spawn(move || {
                for number in 1..=2 {
                    assert_eq!(words.ring().append(&[0, 10 * number]), number);
                }
            })
        };
        match words.ring().read(1) {
            RingRead::Entry(entry) => assert_eq!(entry, [1, 10], "torn"),
            RingRead::Waiting | RingRead::Lost => {}
        }
        match words.ring().read(2) {
            RingRead::Entry(entry) => assert_eq!(entry, [2, 20], "torn"),
            RingRead::Waiting => {}
            RingRead::Lost => panic!("lost the newest entry"),
        }
        writer.join().unwrap();
        assert_eq!(words.ring().read(1), RingRead::Lost);
        assert_eq!(words.ring().read(2), RingRead::Entry([2, 20]));
    });
}

fn finds_a_fault<const ORDERINGS: u8>() -> bool {
    panic::catch_unwind(explore::<ORDERINGS>).is_err()
}

#[test]
fn no_reader_sees_a_torn_transition_or_loses_the_newest_one() {
    explore::<ALL>();
}

#[test]
fn the_exploration_of_the_ring_notices_each_ordering_that_is_left_out() {
    assert!(
        finds_a_fault::<{ ALL & !PUBLISH_ORDERED }>(),
        "numbers stored relaxed"
    );
    assert!(finds_a_fault::<{ ALL & !RELEASE_FENCE }>(), "no release fence");
    assert!(finds_a_fault::<{ ALL & !ACQUIRE_FENCE }>(), "no acquire fences");
}
