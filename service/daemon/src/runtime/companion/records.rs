//! Step records on their way to recorders.

use residual_shared::record::StepRecord;
use residual_shared::transport::RecordPublisher;
use tracing::warn;

/// Sends step records to recorders, and counts those that cannot be sent.
pub(super) struct RecordRelay {
    publisher: RecordPublisher,
    undelivered: u64,
}

impl RecordRelay {
    pub(super) fn new(publisher: RecordPublisher) -> Self {
        Self {
            publisher,
            undelivered: 0,
        }
    }

    pub(super) fn send(&mut self, epoch: u64, slot: usize, record: &StepRecord) {
        if let Err(error) = self.publisher.send(epoch, slot, record) {
            if self.undelivered == 0 {
                warn!(%error, "cannot send step records to recorders");
            }
            self.undelivered += 1;
        }
    }

    /// Tells the log what could not be sent.
    pub(super) fn finish(self) {
        if self.undelivered > 0 {
            warn!(
                records = self.undelivered,
                "step records could not be sent to recorders"
            );
        }
    }
}
