//! The step thread: waits for the next due step, obeys commands, receives samples, steps, publishes.
//!
//! Between start and stop this loop makes no allocation, takes no lock, writes no log, and makes one kind of
//! system call: the wait.

use std::sync::atomic::{AtomicBool, Ordering};

use residual_shared::bounds_table::{HEARTBEAT_PERIOD_NS, TableWriter};
use residual_shared::clock::{DaemonTime, monotonic_ns, sleep_until_monotonic};
use residual_shared::counters::{InputCounters, ScheduleCounters};
use residual_shared::record::StepRecord;
use residual_shared::transport::SampleSubscriber;
use rtrb::Producer;

use super::command::{Command, CommandInbox, Reply};
use super::companion::Message;
use super::engine::{Engine, RecordSink};

/// Shortest time between two reports of the same counters to the log.
const REPORT_PERIOD_NS: u64 = 1_000_000_000;

/// Counters of one input or diagnoser at two moments, for the log.
#[derive(Clone, Copy, Debug)]
pub enum CounterReport {
    /// Door counters of an input.
    Input {
        /// The input.
        input: usize,
        /// At the last report.
        before: InputCounters,
        /// Now.
        now: InputCounters,
    },
    /// Schedule counters of a diagnoser.
    Schedule {
        /// The diagnoser's slot.
        slot: usize,
        /// At the last report.
        before: ScheduleCounters,
        /// Now.
        now: ScheduleCounters,
    },
}

/// Where records and counters go: the bounds table, and the companion's queue.
pub struct Publication {
    table: TableWriter,
    queue: Producer<Message>,
    reported_inputs: Vec<InputCounters>,
    reported_schedules: Vec<ScheduleCounters>,
    next_report_ns: u64,
}

impl RecordSink for Publication {
    fn publish(&mut self, slot: usize, record: &StepRecord) -> bool {
        self.table.publish(slot, record);
        self.queue.push(Message::Record(slot, *record)).is_ok()
    }
}

impl Publication {
    /// Publishes into `table` and `queue`; the engine has `inputs` inputs and `diagnosers` diagnosers.
    pub fn new(table: TableWriter, queue: Producer<Message>, inputs: usize, diagnosers: usize) -> Self {
        Self {
            table,
            queue,
            reported_inputs: vec![InputCounters::default(); inputs],
            reported_schedules: vec![ScheduleCounters::default(); diagnosers],
            next_report_ns: 0,
        }
    }

    /// Writes heartbeat and counters to the table, and at most once a second what changed to the log.
    fn publish_counters(&mut self, engine: &Engine, monotonic_ns: u64) {
        self.table.heartbeat(monotonic_ns);
        for (input, counters) in engine.input_counters().enumerate() {
            self.table.publish_input_counters(input, counters);
        }
        for (slot, counters) in engine.schedule_counters().enumerate() {
            self.table.publish_schedule_counters(slot, counters);
        }
        if monotonic_ns >= self.next_report_ns {
            self.next_report_ns = monotonic_ns + REPORT_PERIOD_NS;
            self.report(engine);
        }
    }

    /// Sends changed counters to the log; what the queue has no room for is sent with the next report.
    fn report(&mut self, engine: &Engine) {
        for (input, (now, before)) in engine.input_counters().zip(&mut self.reported_inputs).enumerate() {
            let report = CounterReport::Input {
                input,
                before: *before,
                now: *now,
            };
            if now != before && self.queue.push(Message::Counters(report)).is_ok() {
                *before = *now;
            }
        }
        for (slot, (now, before)) in engine
            .schedule_counters()
            .zip(&mut self.reported_schedules)
            .enumerate()
        {
            let report = CounterReport::Schedule {
                slot,
                before: *before,
                now: *now,
            };
            if now != before && self.queue.push(Message::Counters(report)).is_ok() {
                *before = *now;
            }
        }
    }
}

/// The loop of the step thread.
pub struct StepLoop<'a> {
    /// Inboxes, schedule, diagnosers.
    pub engine: Engine,
    /// One subscriber per input, in order.
    pub subscribers: Vec<SampleSubscriber>,
    /// Where records go.
    pub publication: Publication,
    /// Commands of the companion.
    pub commands: CommandInbox,
    /// The daemon's time.
    pub time: DaemonTime,
    /// Set when the daemon shall stop.
    pub stop: &'a AtomicBool,
}

impl StepLoop<'_> {
    /// Runs until `stop` is set; returns the engine for the final report. The table is closed then.
    pub fn run(mut self) -> Engine {
        while !self.stop.load(Ordering::Relaxed) {
            self.wait();
            self.turn();
        }
        self.engine
    }

    /// Sleeps until the next step is due, at most one heartbeat long.
    fn wait(&self) {
        let heartbeat_ns = monotonic_ns() + HEARTBEAT_PERIOD_NS;
        let due_ns = self
            .engine
            .next_due_ns()
            .map_or(u64::MAX, |due| self.time.to_monotonic(due));
        sleep_until_monotonic(due_ns.min(heartbeat_ns));
    }

    /// Obeys commands, receives every waiting sample, does every due step, publishes.
    pub fn turn(&mut self) {
        self.obey();
        let Self {
            engine,
            subscribers,
            publication,
            time,
            ..
        } = self;
        let now_ns = time.now_ns();
        for (input, subscriber) in subscribers.iter().enumerate() {
            subscriber.receive(|publisher, header, elements| {
                engine.accept(input, publisher, header, elements, now_ns);
            });
        }
        engine.step_due(now_ns, monotonic_ns, publication);
        publication.publish_counters(engine, monotonic_ns());
    }

    /// Does what the companion has asked for: before any sample or step of this turn.
    fn obey(&mut self) {
        let engine = &mut self.engine;
        self.commands.take(|command| match command {
            Command::Reset(slot) if engine.reset(slot) => Reply::Reset,
            Command::Reset(_) => Reply::NoSuchSlot,
            Command::Acknowledge(slot) => match engine.acknowledge(slot) {
                Some(acknowledged) => Reply::Acknowledged(acknowledged),
                None => Reply::NoSuchSlot,
            },
        });
    }
}
