//! The step thread: waits for the next due step, receives samples, steps, publishes, obeys commands.
//!
//! Between start and stop this loop makes no allocation, takes no lock, writes no log, and makes two kinds of
//! system call: the wait, and the wake-up at an alarm's transition.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use residual_shared::alarm::AlarmTransition;
use residual_shared::bounds_table::{HEARTBEAT_PERIOD_NS, TableWriter};
use residual_shared::clock::{DaemonTime, monotonic_ns, sleep_until_monotonic};
use residual_shared::counters::{InputCounters, ScheduleCounters};
use residual_shared::record::StepRecord;
use residual_shared::transport::Node;
use rtrb::Producer;

use super::command::{COMMANDS_PER_TURN, Command, CommandInbox, Reply};
use super::companion::Message;
use super::engine::{Engine, RecordSink};
use super::exchange::{Reported, Subscription};
use super::running::Running;

/// How long a part of a snapshot may keep the steps of a turn waiting, nanoseconds.
const SAVE_WITHIN_NS: u64 = 100_000;

/// Longest sleep while commands are waiting, nanoseconds.
const COMMAND_PAUSE_NS: u64 = 1_000_000;

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
    pub(super) table: TableWriter,
    pub(super) queue: Producer<Message>,
    pub(super) reported: Reported,
    next_report_ns: u64,
}

impl RecordSink for Publication {
    fn publish(&mut self, slot: usize, record: &StepRecord) -> bool {
        self.table.publish(slot, record);
        let message = Message::Record {
            epoch: self.table.epoch(),
            slot,
            record: *record,
        };
        self.queue.push(message).is_ok()
    }

    fn alarm(&mut self, transition: &AlarmTransition) {
        self.table.raise(transition);
    }
}

impl Publication {
    /// Publishes into `table` and `queue`; the log knows what is `reported`.
    pub fn new(table: TableWriter, queue: Producer<Message>, reported: Reported) -> Self {
        Self {
            table,
            queue,
            reported,
            next_report_ns: 0,
        }
    }

    /// Writes heartbeat and counters to the table, and at most once a second what changed to the log.
    pub(super) fn publish_counters(&mut self, engine: &Engine, monotonic_ns: u64) {
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
        for (input, (now, before)) in engine.input_counters().zip(&mut self.reported.inputs).enumerate() {
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
            .zip(&mut self.reported.schedules)
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
    /// The configuration.
    pub running: Arc<Running>,
    /// One subscriber per input.
    pub subscriptions: Vec<Subscription>,
    /// What new inputs are subscribed to with.
    pub node: &'a Node,
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
    /// Runs until `stop` is set; returns the engine, for the final report, and its configuration. The table is closed
    /// then.
    pub fn run(mut self) -> (Engine, Arc<Running>) {
        while !self.stop.load(Ordering::Relaxed) {
            self.wait();
            self.turn();
        }
        (self.engine, self.running)
    }

    /// Sleeps until the next step is due, at most one heartbeat long, and less while commands are waiting.
    fn wait(&self) {
        let longest_ns = if self.commands.has_next() {
            COMMAND_PAUSE_NS
        } else {
            HEARTBEAT_PERIOD_NS
        };
        let latest_ns = monotonic_ns() + longest_ns;
        let due_ns = self
            .engine
            .next_due_ns()
            .map_or(u64::MAX, |due| self.time.to_monotonic(due));
        sleep_until_monotonic(due_ns.min(latest_ns));
    }

    /// Receives every waiting sample, does every due step, publishes, obeys commands.
    pub fn turn(&mut self) {
        let Self {
            engine,
            subscriptions,
            publication,
            time,
            ..
        } = self;
        let now_ns = time.now_ns();
        for Subscription { input, subscriber } in subscriptions {
            subscriber.receive(|publisher, header, elements| {
                engine.accept(*input, publisher, header, elements, now_ns);
            });
        }
        engine.step_due(now_ns, monotonic_ns, publication);
        publication.publish_counters(engine, monotonic_ns());
        self.obey();
    }

    /// Does some of what the companion has asked for, whether or not a step has fallen due meanwhile: a daemon that
    /// is always late obeys as well.
    fn obey(&mut self) {
        for _ in 0..COMMANDS_PER_TURN {
            let Some((ticket, command)) = self.commands.receive() else {
                return;
            };
            let reply = self.execute(command);
            self.commands.reply(ticket, reply);
        }
    }

    fn execute(&mut self, command: Command) -> Reply {
        let (engine, sink) = (&mut self.engine, &mut self.publication);
        match command {
            Command::Reset(identity) => match sink.table.slot_with_identity(identity) {
                Some(slot) if engine.reset(slot, sink) => Reply::Reset,
                _ => Reply::NoSuchDiagnoser,
            },
            Command::Acknowledge(identity, seen) => {
                let Some(slot) = sink.table.slot_with_identity(identity) else {
                    return Reply::NoSuchDiagnoser;
                };
                if seen.is_some_and(|seen| engine.occurrences(slot) != Some(seen)) {
                    // Another one has come since, which nobody has seen.
                    return Reply::Acknowledged(false);
                }
                match engine.acknowledge(slot, sink) {
                    Some(acknowledged) => Reply::Acknowledged(acknowledged),
                    None => Reply::NoSuchDiagnoser,
                }
            }
            Command::Save(mut snapshot) => {
                let end_ns = monotonic_ns() + SAVE_WITHIN_NS;
                let progress = engine.save(&mut snapshot, || monotonic_ns() < end_ns);
                Reply::Saved(snapshot, progress)
            }
            Command::Exchange(mut exchange) => {
                let outcome = self.exchange(&mut exchange);
                Reply::Exchanged(exchange, outcome)
            }
        }
    }
}
