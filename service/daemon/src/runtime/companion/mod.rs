//! The companion thread: everything slow that the step thread must not do.
//!
//! | module | what |
//! |---|---|
//! | [`records`] | sends the step records, which come through a lock-free queue, to recorders |
//! | [`log`] | writes changes of the counters to the log |
//! | [`control`] | answers control requests, through commands to the step thread where need be |
//! | [`task`] | work for a control request that takes long, on a thread of its own |
//!
//! It tells alarms to the log and to listeners of iceoryx2 ([`alarms`]), which wake it at once,
//! and clears away dead iceoryx2 nodes.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use residual_shared::control::ControlCounters;
use residual_shared::names::Instance;
use residual_shared::record::StepRecord;
use residual_shared::transport::{self, AlarmNotifier, ControlServer, RecordPublisher, TransportError};
use rtrb::Consumer;
use tracing::warn;

use super::live::CounterReport;
use alarms::AlarmWatch;
use control::ControlDesk;
use log::ChangeLog;
use records::RecordRelay;

mod alarms;
mod control;
mod log;
mod records;
mod task;

pub use control::{Control, Identity};
pub use log::LogNames;
pub use task::{Due, StepThread, Task, Work};

/// How long the thread sleeps without an alarm: recorders see a record, and requests are seen, at most this
/// much later.
const IDLE: Duration = Duration::from_millis(5);

/// How often dead nodes are cleared: a scan costs about a millisecond.
const CLEANING_PERIOD: Duration = Duration::from_secs(5);

/// What the step thread sends over.
#[expect(
    clippy::large_enum_variant,
    reason = "a record is copied once into the queue, never moved on"
)]
pub enum Message {
    /// A step record.
    Record {
        /// Epoch of the table that the slot belongs to.
        epoch: u64,
        /// The diagnoser's slot.
        slot: usize,
        /// The record.
        record: StepRecord,
    },
    /// New counters of one input or one diagnoser.
    Counters(CounterReport),
    /// What follows is of another configuration.
    Reloaded(Box<Introduction>),
}

/// What the companion has to know of a configuration.
#[derive(Clone, Debug)]
pub struct Introduction {
    /// Names for the log.
    pub names: LogNames,
    /// What the daemon says of itself.
    pub identity: Identity,
}

/// The running companion thread; dropping it lets the thread work off its queue and ends it.
pub struct Companion {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<ControlCounters>>,
}

impl Companion {
    /// Starts the thread; returns when its services stand.
    ///
    /// # Errors
    /// See [`TransportError`].
    pub fn start(
        instance: Instance,
        introduction: Introduction,
        queue: Consumer<Message>,
        control: Control,
    ) -> Result<Self, TransportError> {
        let stop = Arc::new(AtomicBool::new(false));
        let (ready, wait_ready) = std::sync::mpsc::sync_channel(1);
        let asked_to_stop = Arc::clone(&stop);
        let thread = thread::spawn(move || {
            // iceoryx2's ports belong to one thread, so they are made here.
            match Worker::new(&instance, introduction, queue, control) {
                Ok(worker) => {
                    let _ = ready.send(Ok(()));
                    worker.run(&asked_to_stop)
                }
                Err(error) => {
                    let _ = ready.send(Err(error));
                    ControlCounters::default()
                }
            }
        });
        match wait_ready.recv() {
            Ok(Ok(())) => Ok(Self {
                stop,
                thread: Some(thread),
            }),
            Ok(Err(error)) => Err(error),
            Err(_) => Err(TransportError::Node {
                instance: "companion".into(),
                reason: "the companion thread ended while starting".into(),
            }),
        }
    }

    /// Lets the thread work off its queue and ends it; what became of the control requests.
    pub fn finish(mut self) -> ControlCounters {
        self.join()
    }

    fn join(&mut self) -> ControlCounters {
        self.stop.store(true, Ordering::Release);
        let Some(thread) = self.thread.take() else {
            return ControlCounters::default();
        };
        thread.join().unwrap_or_else(|_| {
            warn!("the companion thread ended abnormally");
            ControlCounters::default()
        })
    }
}

impl Drop for Companion {
    fn drop(&mut self) {
        self.join();
    }
}

struct Worker {
    queue: Consumer<Message>,
    records: RecordRelay,
    log: ChangeLog,
    control: ControlDesk,
    alarms: AlarmWatch,
    // Last, so that it outlives its ports.
    node: transport::Node,
}

impl Worker {
    fn new(
        instance: &Instance,
        introduction: Introduction,
        queue: Consumer<Message>,
        control: Control,
    ) -> Result<Self, TransportError> {
        let node = transport::open_node(instance)?;
        let Introduction { names, identity } = introduction;
        let server = ControlServer::create(&node, instance)?;
        Ok(Self {
            queue,
            alarms: AlarmWatch::new(instance.clone(), AlarmNotifier::create(&node, instance)?),
            records: RecordRelay::new(RecordPublisher::create(&node, instance)?),
            log: ChangeLog::new(names),
            control: ControlDesk::new(server, instance.clone(), identity, control),
            node,
        })
    }

    fn run(mut self, stop: &AtomicBool) -> ControlCounters {
        let mut cleaned = Instant::now();
        loop {
            let stopping = stop.load(Ordering::Acquire);
            self.alarms.look();
            while let Ok(message) = self.queue.pop() {
                match message {
                    Message::Record { epoch, slot, record } => self.records.send(epoch, slot, &record),
                    Message::Counters(report) => self.log.counters(&report),
                    Message::Reloaded(introduction) => {
                        self.log = ChangeLog::new(introduction.names);
                        self.control.identity = introduction.identity;
                    }
                }
            }
            self.control.serve();
            if stopping {
                break;
            }
            if cleaned.elapsed() >= CLEANING_PERIOD {
                self.node.try_cleanup_dead_nodes();
                cleaned = Instant::now();
            }
            self.alarms.wait(IDLE);
        }
        self.records.finish();
        self.control.finish()
    }
}
