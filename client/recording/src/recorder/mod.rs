//! Makes a recording of a running daemon.
//!
//! One thread looks for records and samples every millisecond ([`Stream`]), another one writes them, so that a slow
//! disk makes no losses as long as the queue between them has room. The file is flushed every second.
//!
//! A recording is of one bounds table of the daemon: it ends when it is told to, with the daemon, or when the daemon
//! reads its configuration again or is started anew. [`Stream::next`] is then the stream for the next recording.

mod stream;
mod write;

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::sync_channel;
use std::thread;
use std::time::{Duration, Instant};

use residual_shared::bounds_table::OpenError;
use residual_shared::transport::TransportError;

pub use stream::{Received, Stream};

use crate::totals::{End, Totals};
use crate::writer::{WriteError, Writer};

/// Between two looks: short against the buffers of the inputs (64 samples), long against the cost of a look.
const LOOK_PERIOD: Duration = Duration::from_millis(1);

/// Looks with something new that may wait for the disk.
const QUEUE: usize = 8192;

/// How long to wait for the last records of a daemon that has ended.
const LAST_RECORDS: Duration = Duration::from_millis(300);

/// Why a recording could not be made.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// There is no daemon, or its table cannot be read.
    #[error(transparent)]
    Table(#[from] OpenError),
    /// The daemon has ended.
    #[error("the daemon of instance `{0}` has ended; start it first")]
    NoDaemon(String),
    /// iceoryx2 refused.
    #[error(transparent)]
    Transport(#[from] TransportError),
    /// There is no such diagnoser.
    #[error("the daemon has no diagnoser `{name}`; it has {known}")]
    NoSuchDiagnoser {
        /// The name.
        name: String,
        /// The names there are.
        known: String,
    },
    /// The file cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}

/// Records the diagnosers in `slots`, and the samples if the stream has them, into the new file `path` until `stop`
/// is set, `duration` is over, the daemon ends, or its table is replaced. The file is then whole.
pub fn record(
    stream: &mut Stream,
    path: &Path,
    slots: &[usize],
    duration: Option<Duration>,
    stop: &AtomicBool,
) -> Result<Totals, RecordError> {
    let mut writer = Writer::create(path, stream.header().clone(), slots, stream.has_samples())?;
    writer.go_on_behind(&stream.sample_gaps);
    let (queue, batches) = sync_channel(QUEUE);
    let thread = thread::spawn(move || write::write(writer, &batches));
    let end = look(stream, duration, stop, |batch| queue.send(batch).is_ok());
    drop(queue);
    let (writer, written) = thread.join().map_err(|_| WriteError::Thread)??;
    stream.sample_gaps = writer.sample_gaps();
    let mut totals = Totals {
        topics: written,
        lost_records: stream.lost_records(),
        lost_samples: stream.lost_samples(writer.missing_samples()),
        lost_alarms: stream.lost_alarms(),
        end: Some(end),
    };
    if !stream.has_samples() {
        totals.lost_samples = 0;
    }
    writer.finish(&totals)?;
    Ok(totals)
}

/// Hands all that comes to `take`, until `stop` is set, `duration` is over, the daemon ends, its table is replaced, or
/// `take` wants no more.
pub fn look(
    stream: &mut Stream,
    duration: Option<Duration>,
    stop: &AtomicBool,
    mut take: impl FnMut(Vec<Received>) -> bool,
) -> End {
    let begin = Instant::now();
    let mut ended: Option<Instant> = None;
    loop {
        let asked = stop.load(Ordering::Relaxed) || duration.is_some_and(|limit| begin.elapsed() >= limit);
        let batch = stream.look();
        if !batch.is_empty() {
            // More may be under way. Samples are the drivers', who may go on without a daemon.
            let is_record = |received: &Received| matches!(received, Received::Record { .. });
            if batch.iter().any(is_record) {
                ended = ended.map(|_| Instant::now());
            }
            if !take(batch) {
                return End::Asked;
            }
        }
        if asked {
            return End::Asked;
        }
        if stream.has_later_records() {
            return End::TableReplaced;
        }
        match ended {
            Some(since) if since.elapsed() >= LAST_RECORDS && stream.is_replaced() => {
                return End::TableReplaced;
            }
            Some(since) if since.elapsed() >= LAST_RECORDS => return End::DaemonEnded,
            None if stream.daemon_has_ended() => ended = Some(Instant::now()),
            _ => {}
        }
        thread::sleep(LOOK_PERIOD);
    }
}
