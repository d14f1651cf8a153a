//! The companion on its own: the test plays the step thread, and the work that takes long.

use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex};
use std::thread;

use residual_client::{CheckpointOutcome, Control, ControlError, ReloadOutcome, RequestError, Response};
use residual_shared::control::Answer;
use residuald::configuration::Configuration;
use residuald::logging;
use residuald::runtime::command::{self, Command, CommandInbox, Reply};
use residuald::runtime::companion::{Companion, Identity, Introduction, LogNames, Task, Work};
use residuald::runtime::life::Life;
use residuald::runtime::running::Running;
use residuald::runtime::snapshot::Progress;
use residuald::runtime::upkeep::Upkeep;

use super::control;
use super::support::{PATIENCE, Stage, wait_for};

/// What tells the diagnosers `a` and `b` apart, other than their slots.
const A: u64 = 71;
const B: u64 = 72;

/// A companion whose diagnosers are called `a` and `b`, and the step thread's end of its commands.
fn companion(stage: &Stage, work: Work) -> (Companion, CommandInbox) {
    let (_, log) = logging::start("error").unwrap();
    let (commands, inbox) = command::channel();
    let named = |name: &str| residual_client::DiagnoserDescription {
        name: name.into(),
        ..Default::default()
    };
    let control = residuald::runtime::companion::Control {
        commands,
        log,
        work,
        due: Box::new(|| None),
    };
    let introduction = Introduction {
        names: LogNames {
            diagnosers: vec![],
            inputs: vec![],
        },
        identity: Identity {
            program: "test".into(),
            diagnosers: vec![named("a"), named("b")],
            identities: vec![A, B],
        },
    };
    let (_, queue) = rtrb::RingBuffer::new(1);
    let companion = Companion::start(stage.instance.clone(), introduction, queue, control).unwrap();
    (companion, inbox)
}

fn nothing() -> Work {
    Arc::new(|_, _| Err(ControlError::Stopping))
}

/// Asks on a thread of its own.
fn ask<T: Send + 'static>(
    stage: &Stage,
    request: impl FnOnce(&Control) -> Result<T, RequestError> + Send + 'static,
) -> thread::JoinHandle<Result<T, RequestError>> {
    let instance = stage.instance.clone();
    thread::spawn(move || request(&Control::connect(&instance).unwrap().with_timeout(PATIENCE)))
}

/// Obeys the next command.
fn obey(inbox: &mut CommandInbox, reply: impl Fn(&Command) -> Reply) {
    let (ticket, command) = wait_for("a command", || inbox.receive());
    inbox.reply(ticket, reply(&command));
}

#[test]
fn one_task_runs_at_a_time_gives_commands_and_reports_its_outcome_while_other_requests_are_answered() {
    let stage = Stage::new();
    let (begin, begun): (Sender<Task>, Receiver<Task>) = channel();
    let begin = Mutex::new(begin);
    let work: Work = Arc::new(move |task, step_thread| -> Answer {
        begin.lock().unwrap().send(task).unwrap();
        match (task, step_thread.command(Command::Reset(1))?) {
            (Task::Checkpoint, Reply::Reset) => Ok(Response::Checkpoint(CheckpointOutcome {
                path: "there".into(),
                diagnosers: 2,
                bytes: 3,
            })),
            (Task::Reload, Reply::NoSuchDiagnoser) => Ok(Response::Reload(ReloadOutcome::default())),
            _ => panic!("neither a checkpoint nor a reload"),
        }
    });
    let (companion, mut inbox) = companion(&stage, work);
    let first = ask(&stage, Control::checkpoint);
    assert_eq!(begun.recv_timeout(PATIENCE).unwrap(), Task::Checkpoint);
    let control = control(&stage);
    let busy = control.reload().unwrap_err();
    assert!(
        matches!(&busy, RequestError::Refused(ControlError::Busy { with }) if with == "checkpoint"),
        "{busy}"
    );
    assert_eq!(control.list().unwrap().total, 2);
    assert!(!first.is_finished());
    obey(&mut inbox, |command| {
        assert!(matches!(command, Command::Reset(1)));
        Reply::Reset
    });
    assert_eq!(first.join().unwrap().unwrap().path, "there");

    let second = ask(&stage, Control::reload);
    obey(&mut inbox, |_| Reply::NoSuchDiagnoser);
    assert_eq!(second.join().unwrap().unwrap(), ReloadOutcome::default());

    // A task that panics: its request is answered, and the next one can begin.
    let third = ask(&stage, Control::checkpoint);
    obey(&mut inbox, |_| Reply::NoSuchDiagnoser);
    let failed = third.join().unwrap().unwrap_err();
    assert!(
        failed.to_string().contains("the checkpoint ended abnormally"),
        "{failed}"
    );
    let fourth = ask(&stage, Control::reload);
    obey(&mut inbox, |_| Reply::NoSuchDiagnoser);
    fourth.join().unwrap().unwrap();
    assert_eq!(companion.finish().timed_out, 0);
}

#[test]
fn a_step_thread_that_does_not_obey_is_reported_and_its_late_reply_disturbs_nothing() {
    let stage = Stage::new();
    let (companion, mut inbox) = companion(&stage, nothing());
    let control = control(&stage);
    let error = control.reset_all().unwrap_err();
    assert!(
        matches!(
            error,
            RequestError::Refused(ControlError::NotObeyed { waited_ms: 3000 })
        ),
        "{error}"
    );
    let next = ask(&stage, |control| control.acknowledge("b"));
    for number in 0..3 {
        obey(&mut inbox, |command| match (number, command) {
            (0, Command::Reset(A)) | (1, Command::Reset(B)) => Reply::Reset,
            (2, Command::Acknowledge(B, None)) => Reply::Acknowledged(true),
            _ => panic!("another command, or out of order"),
        });
    }
    assert!(next.join().unwrap().unwrap());
    let counters = companion.finish();
    assert_eq!((counters.answered, counters.timed_out), (1, 1));
}

#[test]
fn a_diagnoser_that_a_reload_took_away_before_its_command_was_obeyed_is_an_error_for_who_named_it() {
    let stage = Stage::new();
    let (companion, mut inbox) = companion(&stage, nothing());
    for request in [Control::reset, |control: &Control, name: &str| {
        control.acknowledge(name).map(drop)
    }] {
        let asked = ask(&stage, move |control| request(control, "b"));
        obey(&mut inbox, |_| Reply::NoSuchDiagnoser);
        let error = asked.join().unwrap().unwrap_err().to_string();
        assert!(
            error.contains("another configuration") && error.contains("`b`"),
            "{error}"
        );
    }
    let all = ask(&stage, Control::reset_all);
    obey(&mut inbox, |_| Reply::Reset);
    obey(&mut inbox, |_| Reply::NoSuchDiagnoser);
    assert_eq!(all.join().unwrap().unwrap(), 1);
    companion.finish();
}

#[test]
fn a_checkpoint_that_ended_in_the_middle_does_not_keep_later_ones_from_being_made() {
    let mut stage = Stage::new();
    let file = stage.files.path().join("state");
    stage.set("daemon", "checkpoint_file", file.display().to_string());
    let loaded = Configuration::from_text("test", &stage.configuration.to_string()).unwrap();
    let diagnosers = loaded.build_diagnosers().unwrap();
    let life = Life::begin(&loaded.configuration.daemon, 1.0);
    let running = Arc::new(Running::new(loaded.configuration, &diagnosers));
    let (_, log) = logging::start("error").unwrap();
    let upkeep = Upkeep::new(None, log, running, Arc::default());
    upkeep.begin(life.grid);
    let (companion, mut inbox) = companion(&stage, upkeep.work());
    let first = ask(&stage, Control::checkpoint);
    obey(&mut inbox, |_| Reply::NoSuchDiagnoser);
    first.join().unwrap().unwrap_err();
    let second = ask(&stage, Control::checkpoint);
    let (ticket, command) = wait_for("a command", || inbox.receive());
    let Command::Save(snapshot) = command else {
        panic!("another command")
    };
    inbox.reply(ticket, Reply::Saved(snapshot, Progress::Whole));
    let outcome = second.join().unwrap().unwrap();
    assert_eq!(outcome.bytes, std::fs::metadata(&file).unwrap().len());
    companion.finish();
}

#[test]
fn what_is_pending_when_the_daemon_stops_is_answered() {
    let stage = Stage::new();
    let (companion, inbox) = companion(
        &stage,
        Arc::new(|_, step_thread| {
            step_thread
                .command(Command::Reset(0))
                .map(|_| Response::Reload(ReloadOutcome::default()))
        }),
    );
    let pending = [
        ask(&stage, |control| control.reset("a")),
        ask(&stage, |control| control.reload().map(drop)),
    ];
    thread::sleep(super::SHORT);
    let counters = companion.finish();
    for pending in pending {
        let error = pending.join().unwrap().unwrap_err();
        assert!(
            matches!(error, RequestError::Refused(ControlError::Stopping)),
            "{error}"
        );
    }
    assert_eq!(counters.answered, 2);
    drop(inbox);
}
