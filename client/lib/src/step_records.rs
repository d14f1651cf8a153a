//! Every step record of a daemon, through iceoryx2.

use residual_shared::names::Instance;
use residual_shared::record::StepRecord;
use residual_shared::transport::{Node, RecordHeader, RecordSubscriber, TransportError, open_node};

/// Every step record of one instance, in the order in which its daemon sent them, over all its lives.
///
/// It needs the daemon's own user, and one of the few places that the daemon has for recorders. Whoever only wants to
/// know the newest record takes a [`Monitor`](crate::Monitor), which needs neither.
///
/// The daemon never waits: it keeps about a thousand records for each subscriber and then overwrites the oldest.
/// What was lost shows in [`counts`](Self::counts). Receive every few hundred milliseconds.
pub struct StepRecords {
    subscriber: RecordSubscriber,
    loss: LossCounter,
    /// Keeps the subscription alive.
    _node: Node,
}

/// What became of the records since the subscription.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RecordCounts {
    /// Records received.
    pub received: u64,
    /// Records sent by the daemon and overwritten before they were received, over all epochs of each life.
    pub lost: u64,
    /// Lives of the daemon from which records came.
    pub lives: u64,
}

impl StepRecords {
    /// Subscribes to the records that the daemon sends from now on.
    ///
    /// # Errors
    /// See [`TransportError`]: the daemon has not been started, runs as another user, or has no place left.
    pub fn open(instance: &Instance) -> Result<Self, TransportError> {
        let node = open_node(instance)?;
        Ok(Self {
            subscriber: RecordSubscriber::open(&node, instance)?,
            loss: LossCounter::default(),
            _node: node,
        })
    }

    /// Hands every waiting record to `take`, oldest first, and gives how many there were; never waits.
    ///
    /// The header names the diagnoser: its slot in the bounds table with the header's epoch. The epoch rises when the
    /// daemon reads its configuration again and when it is started anew; the slot of another epoch may be another
    /// diagnoser. Open the table anew before names are told of a new epoch.
    pub fn receive(&mut self, mut take: impl FnMut(RecordHeader, &StepRecord)) -> usize {
        let loss = &mut self.loss;
        self.subscriber
            .receive_with_publisher(|publisher, header, record| {
                loss.count(publisher, header.sequence);
                take(header, record);
            })
    }

    /// What became of the records since the subscription.
    pub fn counts(&self) -> RecordCounts {
        self.loss.counts
    }
}

/// Counts what is missing between the sequence numbers that arrive.
#[derive(Debug, Default)]
struct LossCounter {
    counts: RecordCounts,
    /// The present publisher and the sequence number that it sends next.
    expected: Option<(u128, u64)>,
}

impl LossCounter {
    fn count(&mut self, publisher: u128, sequence: u64) {
        let expected = match self.expected {
            Some((known, expected)) if known == publisher => expected,
            // A later life was heard from its first record on.
            Some(_) => 0,
            // The first one sent some before the subscription.
            None => sequence,
        };
        if self.expected.is_none_or(|(known, _)| known != publisher) {
            self.counts.lives += 1;
        }
        self.counts.received += 1;
        self.counts.lost += sequence.saturating_sub(expected);
        self.expected = Some((publisher, sequence.saturating_add(1)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_missing_between_sequence_numbers_is_lost_and_each_life_begins_with_0() {
        let mut loss = LossCounter::default();
        for (publisher, sequence) in [(1, 7), (1, 8), (1, 11), (2, 0), (2, 1), (3, 4)] {
            loss.count(publisher, sequence);
        }
        let counts = RecordCounts {
            received: 6,
            lost: 2 + 4,
            lives: 3,
        };
        assert_eq!(loss.counts, counts);
    }
}
