//! The thread that writes.

use std::collections::BTreeMap;
use std::io::{Seek, Write};
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

use super::Received;
use crate::totals::TopicTotals;
use crate::writer::{WriteError, Writer};

/// Between two flushes: what a killed recorder loses at most.
const FLUSH_PERIOD: Duration = Duration::from_secs(1);

/// A writer with the totals of its topics.
type Written<W> = (Writer<W>, BTreeMap<String, TopicTotals>);

/// Writes all batches and flushes now and then, between batches; gives the writer back.
pub(super) fn write<W: Write + Seek>(
    mut writer: Writer<W>,
    batches: &Receiver<Vec<Received>>,
) -> Result<Written<W>, WriteError> {
    // The header shall be there even if nothing ever comes.
    writer.flush()?;
    let mut flushed = Instant::now();
    let mut unflushed = false;
    loop {
        let left = FLUSH_PERIOD.saturating_sub(flushed.elapsed());
        match batches.recv_timeout(left) {
            Ok(batch) => {
                for received in &batch {
                    match received {
                        Received::Record { message, received_ns } => {
                            writer.write_record(message, *received_ns)?
                        }
                        Received::Alarm {
                            transition,
                            received_ns,
                        } => writer.write_alarm(transition, *received_ns)?,
                        Received::Sample(message) => writer.write_sample(message)?,
                    }
                }
                unflushed = true;
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => break,
        }
        if flushed.elapsed() >= FLUSH_PERIOD {
            if std::mem::take(&mut unflushed) {
                writer.flush()?;
            }
            flushed = Instant::now();
        }
    }
    let topics = writer.topics();
    Ok((writer, topics))
}
