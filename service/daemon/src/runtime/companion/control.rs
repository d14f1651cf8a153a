//! Answers control requests.
//!
//! What the companion knows is answered at once. What only the step thread can do becomes commands; the request is
//! pending until each of them has its reply. What takes long is a [`task`](super::task).

use std::time::{Duration, Instant};

use residual_shared::alarm::{AlarmNumber, NONE};
use residual_shared::bounds_table::{AlarmRead, TableReader};
use residual_shared::control::{
    Alarms, Answer, ControlCounters, ControlError, Counter, DiagnoserDescription, DiagnoserEntry, LIST_PAGE,
    Listing, Request, Response, Which,
};
use residual_shared::counters::ScheduleCounters;
use residual_shared::names::Instance;
use residual_shared::transport::{Asker, ControlServer};
use tracing::{debug, info, warn};

use super::task::{Due, RunningTask, Task, Work};
use crate::logging::LogFilter;
use crate::runtime::command::{Command, CommandSender, Reply, Ticket};

/// How long the step thread may take for the commands of a request: it takes the first ones at its next heartbeat, at
/// the latest after 100 ms, and some every millisecond from then on. Clients wait longer by default, so that they get this answer.
const OBEY_WITHIN: Duration = Duration::from_secs(3);

/// Shortest time between two lines of the log about rejected requests, so that a flood of them does not fill it.
const REPORT_PERIOD: Duration = Duration::from_secs(1);

/// Most names of diagnosers in an error.
const NAMES_IN_ERROR: usize = 20;

/// What the daemon says of itself.
#[derive(Clone, Debug)]
pub struct Identity {
    /// Version of the program.
    pub program: String,
    /// The diagnosers by slot; their counters are filled in when asked for.
    pub diagnosers: Vec<DiagnoserDescription>,
    /// [`SlotSpec::identity`](residual_shared::bounds_table::SlotSpec::identity) of each diagnoser: by it, the step
    /// thread knows them over every reload.
    pub identities: Vec<u64>,
}

/// What control requests act on.
pub struct Control {
    /// The way to the step thread.
    pub commands: CommandSender,
    /// The filter of the log.
    pub log: LogFilter,
    /// Does what takes long.
    pub work: Work,
    /// What is to be done without a request.
    pub due: Due,
}

/// A request whose commands are on the way.
struct Pending {
    ticket: Ticket,
    asker: Asker,
    since: Instant,
    /// Commands without reply.
    outstanding: usize,
    /// Commands that did something.
    done: u32,
    /// The diagnoser that is asked for by its name or its alarm.
    named: Option<String>,
    /// Whether it was gone when its command was to be obeyed.
    gone: bool,
    /// The answer, from the number above.
    answer: fn(u32) -> Response,
}

/// Answers control requests.
pub(super) struct ControlDesk {
    server: ControlServer,
    instance: Instance,
    pub(super) identity: Identity,
    control: Control,
    pending: Vec<Pending>,
    task: Option<RunningTask>,
    reported_rejections: u64,
    report_at: Instant,
}

impl ControlDesk {
    pub(super) fn new(
        server: ControlServer,
        instance: Instance,
        identity: Identity,
        control: Control,
    ) -> Self {
        Self {
            server,
            instance,
            identity,
            control,
            pending: Vec::new(),
            task: None,
            reported_rejections: 0,
            report_at: Instant::now(),
        }
    }

    /// Takes new requests, and goes on with those that are not answered yet. Waits for nothing.
    pub(super) fn serve(&mut self) {
        for (request, asker) in self.server.receive() {
            self.take(request, asker);
        }
        if let Some(task) = &self.task {
            task.pass_commands(&mut self.control.commands);
        }
        while let Some((ticket, reply)) = self.control.commands.reply() {
            self.pass_reply(ticket, reply);
        }
        self.answer_pending();
        if let Some(outcome) = self.task.as_ref().and_then(RunningTask::outcome)
            && let Some(task) = self.task.take()
        {
            match task.asker {
                Some(asker) => self.answer(asker, &outcome, task.task.name()),
                None => report(&outcome, task.task.name()),
            }
        }
        if self.task.is_none()
            && let Some(task) = (self.control.due)()
        {
            self.begin(task, None);
        }
        self.report_rejections();
    }

    /// Answers what is still pending, and gives the counters.
    pub(super) fn finish(mut self) -> ControlCounters {
        let pending = self.pending.drain(..).map(|pending| pending.asker);
        for asker in pending.chain(self.task.take().and_then(|task| task.asker)) {
            self.server.answer(asker, &Err(ControlError::Stopping));
        }
        let ControlCounters {
            answered,
            rejected,
            timed_out,
        } = self.server.counters();
        if answered + rejected + timed_out > 0 {
            info!(answered, rejected, timed_out, "control requests");
        }
        self.server.counters()
    }

    fn take(&mut self, request: Request, asker: Asker) {
        let (name, outcome) = match request {
            Request::List { first } => ("list", Ok(Outcome::answer(Response::List(self.list(first))))),
            Request::Describe { diagnoser } => ("describe", self.describe(&diagnoser)),
            Request::Reset { which } => ("reset", self.reset(which)),
            Request::Acknowledge { alarms } => ("acknowledge", self.acknowledge(alarms)),
            Request::Checkpoint => return self.start(Task::Checkpoint, asker),
            Request::Reload => return self.start(Task::Reload, asker),
            Request::SetLogLevel { filter } => ("set-log-level", self.set_log_level(&filter)),
        };
        match outcome {
            Ok(Outcome::Answer(response)) => self.answer(asker, &Ok(*response), name),
            Err(error) => self.answer(asker, &Err(error), name),
            Ok(Outcome::Commands(commands)) => self.send(asker, commands),
        }
    }

    fn answer(&mut self, asker: Asker, answer: &Answer, request: &str) {
        report(answer, request);
        self.server.answer(asker, answer);
    }

    fn list(&self, first: u32) -> Listing {
        let diagnosers = &self.identity.diagnosers;
        let table = self.table();
        let entry = |diagnoser: &DiagnoserDescription| DiagnoserEntry {
            name: diagnoser.name.clone(),
            method: diagnoser.method.clone(),
            period_ns: diagnoser.period_ns,
            channels: diagnoser.channels.len() as u32,
            faults: diagnoser.faults.len() as u32,
            steps: counters(table.as_ref(), &diagnoser.name).steps,
        };
        let from = (first as usize).min(diagnosers.len());
        Listing {
            instance: self.instance.name.to_string(),
            program: self.identity.program.clone(),
            pid: std::process::id(),
            epoch: table.as_ref().map_or(0, |table| table.directory().epoch),
            log: self.control.log.current(),
            requests: self.server.counters(),
            total: diagnosers.len() as u32,
            first,
            diagnosers: diagnosers[from..].iter().take(LIST_PAGE).map(entry).collect(),
        }
    }

    fn describe(&self, name: &str) -> Result<Outcome, ControlError> {
        let mut description = self.identity.diagnosers[self.slot_of(name)?].clone();
        let counters = counters(self.table().as_ref(), name).to_words();
        description.counters = ScheduleCounters::NAMES
            .iter()
            .zip(counters)
            .map(|(&name, value)| Counter {
                name: name.into(),
                value,
            })
            .collect();
        Ok(Outcome::answer(Response::Description(description)))
    }

    fn reset(&self, which: Which) -> Result<Outcome, ControlError> {
        let answer = |diagnosers| Response::Reset { diagnosers };
        let (list, named) = match which {
            Which::All => (self.to_all(Command::Reset), None),
            Which::Diagnoser(name) => (vec![Command::Reset(self.identity_of(&name)?)], Some(name)),
        };
        Ok(Outcome::Commands(Commands { list, named, answer }))
    }

    fn acknowledge(&self, alarms: Alarms) -> Result<Outcome, ControlError> {
        let answer = |alarms| Response::Acknowledged { alarms };
        let (list, named) = match alarms {
            Alarms::All => (self.to_all(|identity| Command::Acknowledge(identity, None)), None),
            Alarms::Diagnoser(name) => (
                vec![Command::Acknowledge(self.identity_of(&name)?, None)],
                Some(name),
            ),
            Alarms::Number { epoch, number } => {
                let (name, command) = self.acknowledgement_of(AlarmNumber { epoch, number })?;
                (vec![command], Some(name))
            }
        };
        Ok(Outcome::Commands(Commands { list, named, answer }))
    }

    fn to_all(&self, command: impl Fn(u64) -> Command) -> Vec<Command> {
        self.identity.identities.iter().copied().map(command).collect()
    }

    fn identity_of(&self, name: &str) -> Result<u64, ControlError> {
        let slot = self.slot_of(name)?;
        let identity = self.identity.identities.get(slot).copied();
        identity.ok_or_else(|| exchanged(name))
    }

    fn set_log_level(&self, filter: &str) -> Result<Outcome, ControlError> {
        let before = self.control.log.current();
        self.control
            .log
            .set(filter)
            .map_err(|error| ControlError::LogFilter {
                filter: filter.chars().take(200).collect(),
                reason: error.to_string(),
            })?;
        let now = self.control.log.current();
        Ok(Outcome::answer(Response::LogLevel { before, now }))
    }

    fn slot_of(&self, name: &str) -> Result<usize, ControlError> {
        let diagnosers = &self.identity.diagnosers;
        diagnosers
            .iter()
            .position(|diagnoser| diagnoser.name == name)
            .ok_or_else(|| {
                let names = diagnosers.iter().take(NAMES_IN_ERROR);
                let mut known: Vec<String> = names.map(|diagnoser| format!("`{}`", diagnoser.name)).collect();
                if diagnosers.len() > NAMES_IN_ERROR {
                    known.push(format!("{} more", diagnosers.len() - NAMES_IN_ERROR));
                }
                ControlError::NoSuchDiagnoser {
                    name: name.into(),
                    known: known.join(", "),
                }
            })
    }

    /// The diagnoser of the alarm that a transition belongs to, and the command that acknowledges this alarm, if it
    /// is still the one of its diagnoser.
    fn acknowledgement_of(&self, number: AlarmNumber) -> Result<(String, Command), ControlError> {
        let unknown = || ControlError::NoSuchAlarm {
            number: number.to_string(),
        };
        let table = self.table().ok_or_else(unknown)?;
        let transition = match table.read_alarm(number.number) {
            AlarmRead::Transition(transition) if transition.number == number && transition.slot != NONE => {
                transition
            }
            _ => return Err(unknown()),
        };
        let slot = transition.slot as usize;
        let status = table.read_alarm_status(slot).map_err(|_| unknown())?;
        let diagnoser = table.directory().spec.slots.get(slot).ok_or_else(unknown)?;
        if status.occurrences != transition.occurrence {
            return Err(ControlError::AlarmSuperseded {
                number: number.to_string(),
                diagnoser: diagnoser.name.clone(),
            });
        }
        let command = Command::Acknowledge(transition.identity, Some(transition.occurrence));
        Ok((diagnoser.name.clone(), command))
    }

    /// The daemon's own table; none while it is starting.
    fn table(&self) -> Option<TableReader> {
        let table = TableReader::open(&self.instance.bounds_path()).ok()?;
        (table.directory().pid == std::process::id()).then_some(table)
    }

    fn send(&mut self, asker: Asker, commands: Commands) {
        let Commands { list, named, answer } = commands;
        let ticket = self.control.commands.ticket();
        self.pending.push(Pending {
            ticket,
            asker,
            since: Instant::now(),
            outstanding: list.len(),
            done: 0,
            named,
            gone: false,
            answer,
        });
        for command in list {
            self.control.commands.send(ticket, command);
        }
    }

    fn start(&mut self, task: Task, asker: Asker) {
        if let Some(running) = &self.task {
            let busy = ControlError::Busy {
                with: running.task.name().into(),
            };
            return self.answer(asker, &Err(busy), task.name());
        }
        info!(request = task.name(), "control: begins");
        self.begin(task, Some(asker));
    }

    /// Begins a task; its outcome is told to the asker, if there is one, and to the log.
    fn begin(&mut self, task: Task, asker: Option<Asker>) {
        let ticket = self.control.commands.ticket();
        self.task = Some(RunningTask::start(task, asker, ticket, &self.control.work));
    }

    fn pass_reply(&mut self, ticket: Ticket, reply: Reply) {
        if let Some(task) = self.task.as_ref().filter(|task| task.ticket == ticket) {
            return task.pass_reply(reply);
        }
        // A request that was given up has no entry any more.
        let Some(pending) = self.pending.iter_mut().find(|pending| pending.ticket == ticket) else {
            return;
        };
        pending.outstanding -= 1;
        match reply {
            Reply::Reset | Reply::Acknowledged(true) => pending.done += 1,
            Reply::NoSuchDiagnoser => pending.gone = true,
            Reply::Acknowledged(false) | Reply::Saved(..) | Reply::Exchanged(..) => {}
        }
    }

    /// Answers the requests whose commands are all obeyed, or have not been for too long.
    fn answer_pending(&mut self) {
        let (over, pending): (Vec<_>, Vec<_>) = self
            .pending
            .drain(..)
            .partition(|pending| pending.outstanding == 0 || pending.since.elapsed() >= OBEY_WITHIN);
        self.pending = pending;
        for pending in over {
            self.control.commands.cancel(pending.ticket);
            let answer = match (pending.outstanding, &pending.named) {
                (0, Some(name)) if pending.gone => Err(exchanged(name)),
                (0, _) => Ok((pending.answer)(pending.done)),
                _ => Err(ControlError::NotObeyed {
                    waited_ms: OBEY_WITHIN.as_millis() as u64,
                }),
            };
            self.answer(pending.asker, &answer, "command");
        }
    }

    fn report_rejections(&mut self) {
        let total = self.server.counters().rejected;
        if total > self.reported_rejections && Instant::now() >= self.report_at {
            let added = total - self.reported_rejections;
            warn!(
                added,
                total, "control requests rejected: malformed, too long or of another version"
            );
            self.reported_rejections = total;
            self.report_at = Instant::now() + REPORT_PERIOD;
        }
    }
}

/// Writes to the log what became of a request.
fn report(answer: &Answer, request: &str) {
    match answer {
        // Looking changes nothing.
        Ok(Response::List(_) | Response::Description(_)) => {}
        // There may be one every second.
        Ok(Response::Checkpoint(outcome)) => debug!(?outcome, "checkpoint"),
        Ok(response) => info!(request, ?response, "control"),
        Err(error) => warn!(request, %error, "control"),
    }
}

/// How a request goes on.
enum Outcome {
    /// It is done.
    Answer(Box<Response>),
    /// The step thread has to do these.
    Commands(Commands),
}

/// What the step thread has to do for a request.
struct Commands {
    list: Vec<Command>,
    /// The diagnoser that is asked for by its name or its alarm; without it the request has failed.
    named: Option<String>,
    /// The answer, from the number of commands that did something.
    answer: fn(u32) -> Response,
}

impl Outcome {
    fn answer(response: Response) -> Self {
        Self::Answer(Box::new(response))
    }
}

/// A reload came before the command was obeyed.
fn exchanged(name: &str) -> ControlError {
    ControlError::Refused {
        reason: format!(
            "another configuration has come in between, in which `{name}` is not what it was; look at it and ask again"
        ),
    }
}

/// Counters of the diagnoser with this name: in the newest table it may have another slot than here.
fn counters(table: Option<&TableReader>, name: &str) -> ScheduleCounters {
    let read = |table: &TableReader| {
        let slots = &table.directory().spec.slots;
        let slot = slots.iter().position(|slot| slot.name == name)?;
        table.read_schedule_counters(slot).ok()
    };
    table.and_then(read).unwrap_or_default()
}
