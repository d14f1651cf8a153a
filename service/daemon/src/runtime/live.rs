//! The step thread: waits for the next due step, receives samples, steps, publishes, obeys commands.
//!
//! Between start and stop this loop makes no allocation, takes no lock, writes no log, and makes two kinds of
//! system call: the wait, and the wake-up at an alarm's transition.

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use residual_shared::alarm::AlarmTransition;
use residual_shared::bounds_table::{HEARTBEAT_PERIOD_NS, TableWriter};
use residual_shared::clock::{DaemonTime, monotonic_ns, sleep_until_monotonic};
use residual_shared::counters::{InputCounters, ScheduleCounters};
use residual_shared::record::StepRecord;
use residual_shared::transport::{Node, RecordAudience};
use rtrb::Producer;

use super::command::{COMMANDS_PER_TURN, Command, CommandInbox, Reply};
use super::companion::Message;
use super::engine::{Engine, RecordSink};
use super::exchange::{Reported, Subscription};
use super::inbox::Inbox;
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
    /// Who listens to the step records; none: nobody knows, and every record goes into the queue.
    audience: Option<RecordAudience>,
    /// Whether the records of this turn go into the queue.
    is_recording: bool,
    /// Whether counters tell of a loss or a delay that the log may not know yet.
    troubled: bool,
    next_report_ns: u64,
}

impl RecordSink for Publication {
    fn publish(&mut self, slot: usize, record: &StepRecord) -> bool {
        self.table.publish(slot, record);
        if !self.is_recording {
            return true;
        }
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

    fn counted(&mut self, slot: usize, counters: &ScheduleCounters, troubled: bool) {
        self.table.publish_schedule_counters(slot, counters);
        self.troubled |= troubled;
    }
}

impl Publication {
    /// Publishes into `table` and `queue`; the log knows what is `reported`.
    pub fn new(table: TableWriter, queue: Producer<Message>, reported: Reported) -> Self {
        Self {
            table,
            queue,
            reported,
            audience: None,
            is_recording: true,
            troubled: false,
            next_report_ns: 0,
        }
    }

    /// Sends step records while somebody of this audience listens, and no others: copying them costs more memory
    /// traffic than all else that is published.
    pub fn record_for(&mut self, audience: RecordAudience) {
        self.is_recording = !audience.is_empty();
        self.audience = Some(audience);
    }

    /// Shows all counters in the table; each step shows its own.
    pub fn publish_all_counters(&self, engine: &Engine) {
        for (input, counters) in engine.input_counters().enumerate() {
            self.table.publish_input_counters(input, counters);
        }
        for (slot, counters) in engine.schedule_counters().enumerate() {
            self.table.publish_schedule_counters(slot, counters);
        }
    }

    /// Looks whether there are recorders.
    fn begin_turn(&mut self) {
        if let Some(audience) = &self.audience {
            self.is_recording = !audience.is_empty();
        }
    }

    /// Writes the heartbeat to the table, and at most once a second what was lost or late to the log.
    pub(super) fn keep_up(&mut self, engine: &Engine, monotonic_ns: u64) {
        self.table.heartbeat(monotonic_ns);
        if self.troubled && monotonic_ns >= self.next_report_ns {
            self.next_report_ns = monotonic_ns + REPORT_PERIOD_NS;
            self.troubled = false;
            self.report(engine);
        }
    }

    /// Sends counters of losses and delays to the log; what the queue has no room for is sent with the next report.
    fn report(&mut self, engine: &Engine) {
        for (input, (now, before)) in engine.input_counters().zip(&mut self.reported.inputs).enumerate() {
            let report = CounterReport::Input {
                input,
                before: *before,
                now: *now,
            };
            if now.troubles() != before.troubles() {
                match self.queue.push(Message::Counters(report)) {
                    Ok(()) => *before = *now,
                    Err(_) => self.troubled = true,
                }
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
            if now.troubles() != before.troubles() {
                match self.queue.push(Message::Counters(report)) {
                    Ok(()) => *before = *now,
                    Err(_) => self.troubled = true,
                }
            }
        }
    }
}

/// One turn of the step thread, as the engine sees it.
struct Turn<'a> {
    begin_ns: u64,
    time: DaemonTime,
    subscriptions: &'a mut [Subscription],
    publication: &'a mut Publication,
}

impl RecordSink for Turn<'_> {
    fn publish(&mut self, slot: usize, record: &StepRecord) -> bool {
        self.publication.publish(slot, record)
    }

    fn alarm(&mut self, transition: &AlarmTransition) {
        self.publication.alarm(transition);
    }

    fn counted(&mut self, slot: usize, counters: &ScheduleCounters, troubled: bool) {
        self.publication.counted(slot, counters, troubled);
    }

    /// Receives what waits for an input, once a turn.
    fn fill(&mut self, input: usize, inbox: &mut Inbox) {
        let Some(subscription) = self.subscriptions.get_mut(input) else {
            return;
        };
        if std::mem::replace(&mut subscription.received_ns, self.begin_ns) == self.begin_ns {
            return;
        }
        let troubles = inbox.counters().troubles();
        let mut now_ns = None;
        let received = subscription.subscriber.receive(|publisher, header, elements| {
            let now_ns = *now_ns.get_or_insert_with(|| self.time.now_ns());
            inbox.accept(publisher, header, elements, now_ns);
        });
        if received > 0 {
            let counters = inbox.counters();
            self.publication.table.publish_input_counters(input, counters);
            self.publication.troubled |= counters.troubles() != troubles;
        }
    }
}

/// Goes round all inputs once a heartbeat period, for those on which no step falls due for long.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sweep {
    next: usize,
    last_ns: u64,
}

impl Sweep {
    /// The part of `inputs` inputs whose turn has come since the last call, as two ranges.
    fn due(&mut self, inputs: usize, now_ns: u64) -> [Range<usize>; 2] {
        let elapsed_ns = now_ns.saturating_sub(self.last_ns).min(HEARTBEAT_PERIOD_NS);
        let count = (inputs as u64 * elapsed_ns / HEARTBEAT_PERIOD_NS) as usize;
        if count == 0 {
            return [0..0, 0..0];
        }
        self.last_ns = now_ns;
        let begin = if self.next < inputs { self.next } else { 0 };
        let (end, wrapped) = (
            (begin + count).min(inputs),
            (begin + count).saturating_sub(inputs),
        );
        self.next = if wrapped > 0 { wrapped } else { end };
        [begin..end, 0..wrapped]
    }
}

/// The loop of the step thread.
pub struct StepLoop<'a> {
    /// Inboxes, schedule, diagnosers.
    pub engine: Engine,
    /// The configuration.
    pub running: Arc<Running>,
    /// One subscriber per input, in their order.
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
    /// Inputs on which no step falls due for long.
    pub sweep: Sweep,
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
        let now_ns = monotonic_ns();
        let due_ns = self
            .engine
            .next_due_ns()
            .map_or(u64::MAX, |due| self.time.to_monotonic(due));
        if due_ns > now_ns {
            sleep_until_monotonic(due_ns.min(now_ns + longest_ns));
        }
    }

    /// Receives the samples of every due step and does it, publishes, obeys commands.
    pub fn turn(&mut self) {
        let Self {
            engine,
            subscriptions,
            publication,
            time,
            sweep,
            ..
        } = self;
        let begin_ns = monotonic_ns();
        publication.begin_turn();
        let rested = sweep.due(subscriptions.len(), begin_ns);
        let mut turn = Turn {
            begin_ns,
            time: *time,
            subscriptions,
            publication,
        };
        engine.step_due(time.from_monotonic(begin_ns), monotonic_ns, &mut turn);
        for input in rested.into_iter().flatten() {
            if turn.subscriptions[input].received_ns + HEARTBEAT_PERIOD_NS <= begin_ns {
                engine.receive(input, &mut turn);
            }
        }
        publication.keep_up(engine, monotonic_ns());
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
