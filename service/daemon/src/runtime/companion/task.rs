//! Work for a control request that takes long: a thread of its own, one at a time.
//!
//! The thread cannot reach the step thread itself; its commands go through the companion.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::thread;

use residual_shared::control::{Answer, ControlError};
use residual_shared::transport::Asker;

use crate::runtime::command::{Command, CommandSender, Reply, Ticket};

/// The requests that take long.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Task {
    /// Save the state of all diagnosers.
    Checkpoint,
    /// Read the configuration again and go on with it.
    Reload,
}

impl Task {
    /// The name, as in `residual ctl`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Checkpoint => "checkpoint",
            Self::Reload => "reload",
        }
    }
}

/// Does a task, on a thread of its own, and gives the answer to the request.
pub type Work = Arc<dyn Fn(Task, &StepThread) -> Answer + Send + Sync>;

/// Says what is to be done now though nobody asked for it.
pub type Due = Box<dyn FnMut() -> Option<Task> + Send>;

/// The way of a task to the step thread.
#[derive(Debug)]
pub struct StepThread {
    commands: Sender<Command>,
    replies: Receiver<Reply>,
}

impl StepThread {
    /// Sends a command to the step thread and waits for its reply.
    ///
    /// # Errors
    /// [`ControlError::Stopping`] if the daemon ends before.
    pub fn command(&self, command: Command) -> Result<Reply, ControlError> {
        self.commands.send(command).map_err(|_| ControlError::Stopping)?;
        self.replies.recv().map_err(|_| ControlError::Stopping)
    }
}

/// A task at work, as the companion sees it.
#[derive(Debug)]
pub(super) struct RunningTask {
    pub(super) task: Task,
    /// Who asked for it; nobody if it was due.
    pub(super) asker: Option<Asker>,
    pub(super) ticket: Ticket,
    commands: Receiver<Command>,
    replies: Sender<Reply>,
    outcome: Receiver<Answer>,
}

impl RunningTask {
    pub(super) fn start(task: Task, asker: Option<Asker>, ticket: Ticket, work: &Work) -> Self {
        let (commands, command_receiver) = channel();
        let (reply_sender, replies) = channel();
        let (outcome_sender, outcome) = channel();
        let work = Arc::clone(work);
        let step_thread = StepThread { commands, replies };
        thread::spawn(move || {
            // Nobody waits for the outcome any more when the daemon is stopping.
            let _ = outcome_sender.send(work(task, &step_thread));
        });
        Self {
            task,
            asker,
            ticket,
            commands: command_receiver,
            replies: reply_sender,
            outcome,
        }
    }

    /// Passes the task's commands on to the step thread.
    pub(super) fn pass_commands(&self, sender: &mut CommandSender) {
        for command in self.commands.try_iter() {
            sender.send(self.ticket, command);
        }
    }

    /// Passes a reply of the step thread on to the task.
    pub(super) fn pass_reply(&self, reply: Reply) {
        let _ = self.replies.send(reply);
    }

    /// The outcome, once there is one.
    pub(super) fn outcome(&self) -> Option<Answer> {
        match self.outcome.try_recv() {
            Ok(answer) => Some(answer),
            Err(TryRecvError::Empty) => None,
            Err(TryRecvError::Disconnected) => Some(Err(ControlError::Refused {
                reason: format!(
                    "the {} ended abnormally; the log says more, and the daemon goes on as before",
                    self.task.name()
                ),
            })),
        }
    }
}
