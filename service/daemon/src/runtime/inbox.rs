//! The door of one input: checks every sample, counts every rejection, keeps the samples until they are due.

use residual_shared::counters::InputCounters;
use residual_shared::sample::SampleHeader;
use serde::{Deserialize, Serialize};

/// Who sent the previous sample and which number it carried.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct LastSequence {
    publisher: u128,
    sequence: u64,
}

/// The samples of one input that may still be needed, oldest first, and the counters of its door.
///
/// Everything is allocated at construction. A sample that does not fit is rejected as a whole and counted; a
/// sample is never changed.
#[derive(Debug)]
pub struct Inbox {
    signal_count: usize,
    max_ahead_ns: u64,
    /// How far behind the newest stamp an older one is still taken; 0 without a method that rolls back.
    rollback_ns: u64,
    state: InboxState,
}

/// What an inbox holds and knows.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct InboxState {
    /// Rings of time stamps and numbers, and of `signal_count` elements for each of them, in order of arrival.
    stamps: Vec<u64>,
    sequences: Vec<u64>,
    elements: Vec<f64>,
    first: usize,
    len: usize,
    newest_stamp_ns: Option<u64>,
    last_sequence: Option<LastSequence>,
    /// Latest sampling instant for which this input has been handed out.
    handed_until_ns: u64,
    /// Latest sampling instant for which its newest sample has been looked at.
    seen_until_ns: u64,
    #[serde(with = "counters_as_words")]
    counters: InputCounters,
}

/// The counters of a door among the bytes of a state.
mod counters_as_words {
    use super::{Deserialize, InputCounters, Serialize};
    use serde::{Deserializer, Serializer};

    pub fn serialize<S: Serializer>(counters: &InputCounters, serializer: S) -> Result<S::Ok, S::Error> {
        counters.to_words().serialize(serializer)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<InputCounters, D::Error> {
        Deserialize::deserialize(deserializer).map(InputCounters::from_words)
    }
}

impl Inbox {
    /// An empty inbox for samples of `signal_count` elements that keeps `capacity` of them (at least one) and
    /// refuses stamps more than `max_ahead_ns` in the future.
    pub fn new(signal_count: usize, capacity: usize, max_ahead_ns: u64) -> Self {
        let capacity = capacity.max(1);
        Self {
            signal_count,
            max_ahead_ns,
            rollback_ns: 0,
            state: InboxState {
                stamps: vec![0; capacity],
                sequences: vec![0; capacity],
                elements: vec![0.0; capacity * signal_count],
                first: 0,
                len: 0,
                newest_stamp_ns: None,
                last_sequence: None,
                handed_until_ns: 0,
                seen_until_ns: 0,
                counters: InputCounters::default(),
            },
        }
    }

    /// Takes samples up to `rollback_ns` behind the newest one as well, for methods that go back to them.
    pub fn accept_backward(&mut self, rollback_ns: u64) {
        self.rollback_ns = self.rollback_ns.max(rollback_ns);
    }

    /// Goes back as far as `other` does.
    pub fn accept_backward_like(&mut self, other: &Self) {
        self.rollback_ns = other.rollback_ns;
    }

    /// What it holds and knows.
    pub fn state(&self) -> &InboxState {
        &self.state
    }

    /// Goes on from the state of an inbox of the same size; false if it is of another one, and nothing has
    /// changed then.
    pub fn restore(&mut self, state: InboxState) -> bool {
        let own = &self.state;
        let fits = state.stamps.len() == own.stamps.len()
            && state.sequences.len() == own.sequences.len()
            && state.elements.len() == own.elements.len()
            && state.first < own.stamps.len()
            && state.len <= own.stamps.len()
            && state.counters.accepted >= state.len as u64;
        if fits {
            self.state = state;
        }
        fits
    }

    /// Samples that the inbox keeps.
    pub fn capacity(&self) -> usize {
        self.state.stamps.len()
    }

    /// What happened at the door so far.
    pub fn counters(&self) -> &InputCounters {
        &self.state.counters
    }

    /// Takes or rejects one sample that arrived at `now_ns` (daemon's time).
    pub fn accept(&mut self, publisher: u128, header: SampleHeader, elements: &[f64], now_ns: u64) {
        if !self.follow_sequence(publisher, &header) {
            return;
        }
        let stamp = header.timestamp_ns;
        let rejected = if elements.len() != self.signal_count {
            &mut self.state.counters.wrong_length
        } else if !elements.iter().all(|element| element.is_finite()) {
            &mut self.state.counters.non_finite
        } else if stamp > now_ns.saturating_add(self.max_ahead_ns) {
            &mut self.state.counters.too_far_ahead
        } else if self.is_backward(stamp) {
            &mut self.state.counters.backward
        } else {
            self.keep(header, elements);
            return;
        };
        *rejected += 1;
    }

    /// Whether a stamp is neither newer than all others nor within the roll-back window.
    fn is_backward(&self, stamp: u64) -> bool {
        let window_ns = self.rollback_ns;
        self.state.newest_stamp_ns.is_some_and(|newest| {
            stamp <= newest && (window_ns == 0 || stamp.saturating_add(window_ns) <= newest)
        })
    }

    /// Counts losses and changes of the publisher; false when the sample was seen before.
    fn follow_sequence(&mut self, publisher: u128, header: &SampleHeader) -> bool {
        let sequence = header.sequence;
        match self.state.last_sequence {
            Some(last) if last.publisher == publisher => {
                let newer_stamp = self
                    .state
                    .newest_stamp_ns
                    .is_none_or(|newest| header.timestamp_ns > newest);
                if sequence == last.sequence || (sequence < last.sequence && !newer_stamp) {
                    let overtaken = self.rollback_ns > 0 && !self.holds(sequence);
                    if overtaken {
                        // It was taken for lost when a later one arrived before it.
                        self.state.counters.lost = self.state.counters.lost.saturating_sub(1);
                    } else {
                        self.state.counters.duplicate += 1;
                    }
                    return overtaken;
                }
                if sequence < last.sequence {
                    // The driver began to count anew without re-opening its port.
                    self.state.counters.publisher_changes += 1;
                } else if sequence > last.sequence + 1 {
                    self.state.counters.gaps += 1;
                    self.state.counters.lost += sequence - last.sequence - 1;
                }
            }
            Some(_) => self.state.counters.publisher_changes += 1,
            None => {}
        }
        self.state.last_sequence = Some(LastSequence { publisher, sequence });
        true
    }

    fn holds(&self, sequence: u64) -> bool {
        self.places().any(|place| self.state.sequences[place] == sequence)
    }

    /// Places of the samples, oldest arrival first.
    fn places(&self) -> impl DoubleEndedIterator<Item = usize> + use<> {
        let (first, capacity) = (self.state.first, self.state.stamps.len());
        (0..self.state.len).map(move |age| (first + age) % capacity)
    }

    fn keep(&mut self, header: SampleHeader, elements: &[f64]) {
        let stamp = header.timestamp_ns;
        let capacity = self.state.stamps.len();
        if self.state.len == capacity {
            if self.state.stamps[self.state.first] > self.state.handed_until_ns.max(self.state.seen_until_ns)
            {
                self.state.counters.overwritten += 1;
            }
            self.state.first = (self.state.first + 1) % capacity;
            self.state.len -= 1;
        }
        let place = (self.state.first + self.state.len) % capacity;
        self.state.stamps[place] = stamp;
        self.state.sequences[place] = header.sequence;
        self.state.elements[place * self.signal_count..][..self.signal_count].copy_from_slice(elements);
        self.state.len += 1;
        self.state.newest_stamp_ns = self.state.newest_stamp_ns.max(Some(stamp));
        self.state.counters.accepted += 1;
        if stamp <= self.state.handed_until_ns {
            self.state.counters.late += 1;
        }
    }

    /// The newest sample stamped in (`after_ns`, `until_ns`], where `until_ns` is a sampling instant; samples
    /// that arrive later for that instant will count as late.
    pub fn hand_out(&mut self, after_ns: u64, until_ns: u64) -> Option<&[f64]> {
        self.state.handed_until_ns = self.state.handed_until_ns.max(until_ns);
        let place = self.newest_place(until_ns)?;
        let fresh = self.state.stamps[place] > after_ns;
        fresh.then(|| &self.state.elements[place * self.signal_count..][..self.signal_count])
    }

    /// The newest sample stamped at or before the sampling instant `until_ns`, however old, for those who need no
    /// sample of each instant: it does not make later ones late.
    pub fn newest(&mut self, until_ns: u64) -> Option<&[f64]> {
        self.state.seen_until_ns = self.state.seen_until_ns.max(until_ns);
        let place = self.newest_place(until_ns)?;
        Some(&self.state.elements[place * self.signal_count..][..self.signal_count])
    }

    fn newest_place(&self, until_ns: u64) -> Option<usize> {
        let mut due = self
            .places()
            .rev()
            .filter(|&place| self.state.stamps[place] <= until_ns);
        match self.rollback_ns {
            0 => due.next(),
            _ => due.max_by_key(|&place| self.state.stamps[place]),
        }
    }

    /// The packets for the sampling instant `until_ns` of a diagnoser whose last one was `after_ns`: those stamped
    /// in between, and older ones that arrived late, after the diagnoser had seen `seen` accepted samples.
    pub fn packets(
        &self,
        after_ns: u64,
        until_ns: u64,
        seen: u64,
    ) -> impl Iterator<Item = (SampleHeader, &[f64])> {
        let first_arrival = self.state.counters.accepted - self.state.len as u64;
        (first_arrival..)
            .zip(self.places())
            .filter(move |&(arrival, place)| {
                let stamp = self.state.stamps[place];
                stamp <= until_ns && (stamp > after_ns || arrival >= seen)
            })
            .map(|(_, place)| {
                let header = SampleHeader {
                    sequence: self.state.sequences[place],
                    timestamp_ns: self.state.stamps[place],
                };
                (
                    header,
                    &self.state.elements[place * self.signal_count..][..self.signal_count],
                )
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOW: u64 = 1_000;

    fn inbox() -> Inbox {
        Inbox::new(2, 4, 100)
    }

    fn send(inbox: &mut Inbox, sequence: u64, timestamp_ns: u64, elements: &[f64]) {
        inbox.accept(
            1,
            SampleHeader {
                sequence,
                timestamp_ns,
            },
            elements,
            NOW,
        );
    }

    #[test]
    fn a_window_gets_its_newest_sample_and_an_empty_window_none() {
        let mut inbox = inbox();
        send(&mut inbox, 0, 10, &[1.0, 1.0]);
        send(&mut inbox, 1, 20, &[2.0, 2.0]);
        send(&mut inbox, 2, 31, &[3.0, 3.0]);
        assert_eq!(inbox.hand_out(0, 9), None);
        assert_eq!(inbox.hand_out(0, 20), Some(&[2.0, 2.0][..]));
        assert_eq!(inbox.hand_out(20, 30), None);
        assert_eq!(inbox.hand_out(30, 40), Some(&[3.0, 3.0][..]));
        assert_eq!(
            inbox.counters(),
            &InputCounters {
                accepted: 3,
                ..Default::default()
            }
        );
    }

    #[test]
    fn each_kind_of_bad_sample_is_rejected_and_counted() {
        let mut inbox = inbox();
        send(&mut inbox, 0, 10, &[1.0, 1.0]);
        send(&mut inbox, 0, 11, &[1.0, 1.0]);
        send(&mut inbox, 1, 12, &[1.0]);
        send(&mut inbox, 2, 13, &[1.0, f64::NAN]);
        send(&mut inbox, 3, 14, &[f64::INFINITY, 1.0]);
        send(&mut inbox, 4, 9, &[1.0, 1.0]);
        send(&mut inbox, 5, NOW + 101, &[1.0, 1.0]);
        let expected = InputCounters {
            accepted: 1,
            duplicate: 1,
            wrong_length: 1,
            non_finite: 2,
            backward: 1,
            too_far_ahead: 1,
            ..Default::default()
        };
        assert_eq!(inbox.counters(), &expected);
        assert_eq!(inbox.hand_out(0, NOW), Some(&[1.0, 1.0][..]));
    }

    #[test]
    fn a_gap_in_the_numbers_is_a_counted_loss_also_when_rejected_samples_lie_around_it() {
        let mut inbox = inbox();
        send(&mut inbox, 7, 10, &[1.0, 1.0]);
        send(&mut inbox, 11, 20, &[1.0, f64::NAN]);
        send(&mut inbox, 12, 30, &[1.0, 1.0]);
        assert_eq!((inbox.counters().gaps, inbox.counters().lost), (1, 3));
    }

    #[test]
    fn a_new_publisher_and_a_renumbered_one_go_on_and_are_counted() {
        let mut inbox = inbox();
        send(&mut inbox, 50, 10, &[1.0, 1.0]);
        inbox.accept(
            2,
            SampleHeader {
                sequence: 0,
                timestamp_ns: 20,
            },
            &[2.0, 2.0],
            NOW,
        );
        inbox.accept(
            2,
            SampleHeader {
                sequence: 9,
                timestamp_ns: 30,
            },
            &[2.0, 2.0],
            NOW,
        );
        inbox.accept(
            2,
            SampleHeader {
                sequence: 0,
                timestamp_ns: 40,
            },
            &[2.0, 2.0],
            NOW,
        );
        assert_eq!(inbox.counters().publisher_changes, 2);
        assert_eq!(inbox.counters().accepted, 4);
        assert_eq!(inbox.counters().lost, 8);
    }

    #[test]
    fn a_sample_for_a_stepped_instant_counts_as_late() {
        let mut inbox = inbox();
        send(&mut inbox, 0, 10, &[1.0, 1.0]);
        inbox.hand_out(0, 20);
        send(&mut inbox, 1, 20, &[1.0, 1.0]);
        send(&mut inbox, 2, 21, &[1.0, 1.0]);
        assert_eq!((inbox.counters().late, inbox.counters().accepted), (1, 3));
    }

    #[test]
    fn the_newest_sample_is_given_however_old_and_makes_nothing_late() {
        let mut inbox = inbox();
        assert_eq!(inbox.newest(5), None);
        send(&mut inbox, 0, 10, &[1.0, 2.0]);
        assert_eq!(inbox.newest(9), None);
        assert_eq!(inbox.newest(500), Some(&[1.0, 2.0][..]));
        for sequence in 1..9 {
            send(&mut inbox, sequence, 20 + sequence, &[sequence as f64, 0.0]);
        }
        assert_eq!(inbox.newest(25), Some(&[5.0, 0.0][..]));
        assert_eq!((inbox.counters().late, inbox.counters().overwritten), (0, 0));
    }

    #[test]
    fn a_full_inbox_drops_the_oldest_and_counts_it_only_if_nobody_had_seen_it() {
        let mut inbox = inbox();
        for sequence in 0..4 {
            send(&mut inbox, sequence, 10 + sequence, &[sequence as f64, 0.0]);
        }
        inbox.hand_out(0, 11);
        for sequence in 4..7 {
            send(&mut inbox, sequence, 10 + sequence, &[sequence as f64, 0.0]);
        }
        assert_eq!(inbox.counters().overwritten, 1);
        assert_eq!(inbox.hand_out(11, 12), None);
        assert_eq!(inbox.hand_out(12, 13), Some(&[3.0, 0.0][..]));
    }

    #[test]
    fn overtaken_samples_are_taken_within_the_roll_back_window_only() {
        let mut inbox = inbox();
        inbox.accept_backward(15);
        for (sequence, stamp) in [(0, 10), (2, 30), (1, 20), (1, 20), (5, 60), (4, 50), (3, 40)] {
            send(&mut inbox, sequence, stamp, &[stamp as f64, 0.0]);
        }
        let counters = inbox.counters();
        assert_eq!(
            (counters.accepted, counters.duplicate, counters.backward),
            (5, 1, 1)
        );
        // Number 3 was rejected, so that only number 1 and 4 had been taken for lost wrongly.
        assert_eq!((counters.gaps, counters.lost), (2, 0));
        assert_eq!(inbox.hand_out(0, 55), Some(&[50.0, 0.0][..]));
    }

    #[test]
    fn packets_are_handed_out_once_and_late_ones_with_the_next_instant() {
        let mut inbox = inbox();
        inbox.accept_backward(100);
        let numbers = |inbox: &Inbox, after, until, seen| -> Vec<u64> {
            inbox
                .packets(after, until, seen)
                .map(|(header, _)| header.sequence)
                .collect()
        };
        send(&mut inbox, 0, 5, &[0.0; 2]);
        send(&mut inbox, 1, 8, &[0.0; 2]);
        send(&mut inbox, 3, 12, &[0.0; 2]);
        assert_eq!(numbers(&inbox, 0, 10, 0), [0, 1]);
        let seen = inbox.counters().accepted;
        send(&mut inbox, 2, 9, &[0.0; 2]);
        assert_eq!(numbers(&inbox, 10, 20, seen), [3, 2]);
        assert_eq!(
            numbers(&inbox, 20, 30, inbox.counters().accepted),
            Vec::<u64>::new()
        );
    }
}
