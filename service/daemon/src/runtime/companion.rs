//! The companion thread: everything slow that the step thread must not do.
//!
//! It takes the step records from a lock-free queue, sends them to recorders, writes changes of verdict and of
//! the counters to the log, and clears away dead iceoryx2 nodes.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use residual_shared::counters::{InputCounters, ScheduleCounters};
use residual_shared::names::Instance;
use residual_shared::record::{StepRecord, Verdict, fault_names};
use residual_shared::transport::{self, RecordPublisher, TransportError};
use rtrb::Consumer;
use tracing::{info, warn};

use super::live::CounterReport;

/// How long the thread sleeps when its queue is empty: recorders see a record at most this much later.
const IDLE: Duration = Duration::from_millis(5);

/// How often dead nodes are cleared: a scan costs about a millisecond.
const CLEANING_PERIOD: Duration = Duration::from_secs(5);

/// Names for the log.
#[derive(Clone, Debug)]
pub struct LogNames {
    /// Diagnosers by slot, each with its fault names.
    pub diagnosers: Vec<(String, Vec<String>)>,
    /// Inputs in order.
    pub inputs: Vec<String>,
}

/// What the step thread sends over.
#[derive(Clone, Copy)]
#[expect(
    clippy::large_enum_variant,
    reason = "a record is copied once into the queue, never moved on"
)]
pub enum Message {
    /// The record of the diagnoser in a slot.
    Record(usize, StepRecord),
    /// New counters of one input or one diagnoser.
    Counters(CounterReport),
}

/// The running companion thread; dropping it lets the thread work off its queue and ends it.
pub struct Companion {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Companion {
    /// Starts the thread; returns when its services stand.
    pub fn start(
        instance: Instance,
        names: LogNames,
        queue: Consumer<Message>,
    ) -> Result<Self, TransportError> {
        let stop = Arc::new(AtomicBool::new(false));
        let (ready, wait_ready) = std::sync::mpsc::sync_channel(1);
        let asked_to_stop = Arc::clone(&stop);
        let thread = thread::spawn(move || {
            // iceoryx2's ports belong to one thread, so they are made here.
            let services = transport::open_node(&instance)
                .and_then(|node| RecordPublisher::create(&node, &instance).map(|records| (node, records)));
            match services {
                Ok((node, records)) => {
                    let _ = ready.send(Ok(()));
                    Worker::new(node, records, names, queue).run(&asked_to_stop);
                }
                Err(error) => {
                    let _ = ready.send(Err(error));
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
}

impl Drop for Companion {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Release);
        if let Some(Err(_)) = self.thread.take().map(JoinHandle::join) {
            warn!("the companion thread ended abnormally");
        }
    }
}

struct Worker {
    node: transport::Node,
    records: RecordPublisher,
    names: LogNames,
    queue: Consumer<Message>,
    last_verdicts: Vec<Option<(Verdict, u64)>>,
    undelivered: u64,
}

impl Worker {
    fn new(
        node: transport::Node,
        records: RecordPublisher,
        names: LogNames,
        queue: Consumer<Message>,
    ) -> Self {
        let last_verdicts = vec![None; names.diagnosers.len()];
        Self {
            node,
            records,
            names,
            queue,
            last_verdicts,
            undelivered: 0,
        }
    }

    fn run(mut self, stop: &AtomicBool) {
        let mut cleaned = Instant::now();
        loop {
            let stopping = stop.load(Ordering::Acquire);
            while let Ok(message) = self.queue.pop() {
                match message {
                    Message::Record(slot, record) => self.record(slot, &record),
                    Message::Counters(report) => self.counters(&report),
                }
            }
            if stopping {
                break;
            }
            if cleaned.elapsed() >= CLEANING_PERIOD {
                self.node.try_cleanup_dead_nodes();
                cleaned = Instant::now();
            }
            thread::sleep(IDLE);
        }
        if self.undelivered > 0 {
            warn!(
                records = self.undelivered,
                "step records could not be sent to recorders"
            );
        }
    }

    fn record(&mut self, slot: usize, record: &StepRecord) {
        if let Err(error) = self.records.send(slot, record) {
            if self.undelivered == 0 {
                warn!(%error, "cannot send step records to recorders");
            }
            self.undelivered += 1;
        }
        let now = (record.verdict(), record.certainly_faulty);
        let (Some(last), Some((name, faults))) =
            (self.last_verdicts.get_mut(slot), self.names.diagnosers.get(slot))
        else {
            return;
        };
        if last.replace(now) == Some(now) {
            return;
        }
        let faulty: Vec<&str> = fault_names(faults, record.certainly_faulty).collect();
        let (step, verdict) = (record.step, now.0.name());
        match now.0 {
            Verdict::Fault | Verdict::Isolated | Verdict::GuaranteeLost => {
                let possibly: Vec<&str> = fault_names(faults, record.possibly_faulty).collect();
                warn!(diagnoser = name, step, verdict, ?faulty, ?possibly);
            }
            _ => info!(diagnoser = name, step, verdict),
        }
    }

    fn counters(&self, report: &CounterReport) {
        match report {
            CounterReport::Input { input, before, now } => {
                let name = self.names.inputs.get(*input).map_or("?", String::as_str);
                for (counter, from, to) in changes(InputCounters::NAMES, &before.to_words(), &now.to_words())
                {
                    if counter != "accepted" {
                        warn!(input = name, counter, added = to - from, total = to);
                    }
                }
            }
            CounterReport::Schedule { slot, before, now } => {
                let name = self
                    .names
                    .diagnosers
                    .get(*slot)
                    .map_or("?", |(name, _)| name.as_str());
                for (counter, from, to) in
                    changes(ScheduleCounters::NAMES, &before.to_words(), &now.to_words())
                {
                    if matches!(counter, "overruns" | "skipped" | "records_dropped") {
                        warn!(diagnoser = name, counter, added = to - from, total = to);
                    }
                }
            }
        }
    }
}

fn changes<'a>(
    names: &'a [&'static str],
    before: &'a [u64],
    now: &'a [u64],
) -> impl Iterator<Item = (&'static str, u64, u64)> + 'a {
    names
        .iter()
        .zip(before.iter().zip(now))
        .filter(|(_, (from, to))| from != to)
        .map(|(&name, (&from, &to))| (name, from, to))
}
