//! Commands from the companion to the step thread, and what became of them.
//!
//! ```text
//! companion: CommandSender ──(ticket, command)──▶ wait-free queue ──▶ CommandInbox: step thread, between two
//!                          ◀──(ticket, reply)──── wait-free queue ◀──               sampling instants
//! ```
//!
//! The step thread takes at most [`COMMANDS_PER_TURN`] commands at the end of a turn. It neither allocates nor
//! drops anything for them: whatever a command brought, or replaced, goes back in its reply. A command is taken
//! only when there is room for its reply, so no reply is ever lost.

use std::collections::VecDeque;

use rtrb::{Consumer, Producer, RingBuffer};

use super::exchange::{Exchange, ExchangeError};
use super::snapshot::{Progress, Snapshot};

/// Commands the step thread takes in one turn, so that a flood of them cannot make a step late.
pub const COMMANDS_PER_TURN: usize = 4;

/// Commands on the way to the step thread; more of them wait on the companion's side.
const QUEUE: usize = 64;

/// Names the request that a command belongs to. The commands of one request may share a ticket; each gets its
/// own reply.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Ticket(u64);

/// What the step thread shall do between two sampling instants.
pub enum Command {
    /// Return the diagnoser with this identity to the state right after its construction.
    ///
    /// [`SlotSpec::identity`](residual_shared::bounds_table::SlotSpec::identity): until the command is obeyed, a
    /// reload may have given its slot to another one.
    Reset(u64),
    /// Acknowledge the alarm of the diagnoser with this identity; with a number, only if it is this occurrence of
    /// it.
    Acknowledge(u64, Option<u64>),
    /// Go on with a snapshot of all states.
    Save(Box<Snapshot>),
    /// Go on with another configuration.
    Exchange(Box<Exchange>),
}

/// What became of a command.
pub enum Reply {
    /// The diagnoser is reset; its next record says so.
    Reset,
    /// The alarm is acknowledged, or there was none to acknowledge (false).
    Acknowledged(bool),
    /// There is no diagnoser with this identity; nothing was done.
    NoSuchDiagnoser,
    /// The snapshot, and how far it came.
    Saved(Box<Snapshot>, Progress),
    /// The old configuration, or the new one and why it was not taken.
    Exchanged(Box<Exchange>, Result<(), ExchangeError>),
}

/// Makes both ends of the way to the step thread and back.
pub fn channel() -> (CommandSender, CommandInbox) {
    let (command_sender, commands) = RingBuffer::new(QUEUE);
    let (replies, reply_receiver) = RingBuffer::new(QUEUE);
    let sender = CommandSender {
        commands: command_sender,
        waiting: VecDeque::new(),
        replies: reply_receiver,
        tickets: 0,
    };
    (sender, CommandInbox { commands, replies })
}

/// The companion's end.
pub struct CommandSender {
    commands: Producer<(Ticket, Command)>,
    /// What the queue had no room for, oldest first.
    waiting: VecDeque<(Ticket, Command)>,
    replies: Consumer<(Ticket, Reply)>,
    tickets: u64,
}

impl CommandSender {
    /// A ticket that no other request has.
    pub fn ticket(&mut self) -> Ticket {
        self.tickets += 1;
        Ticket(self.tickets)
    }

    /// Sends a command; commands are taken in the order in which they are sent.
    pub fn send(&mut self, ticket: Ticket, command: Command) {
        self.waiting.push_back((ticket, command));
        self.flush();
    }

    /// Takes back the commands of this ticket that still wait on this side.
    pub fn cancel(&mut self, ticket: Ticket) {
        self.waiting.retain(|(of, _)| *of != ticket);
    }

    /// The next reply, if one has come.
    pub fn reply(&mut self) -> Option<(Ticket, Reply)> {
        self.flush();
        self.replies.pop().ok()
    }

    /// Moves what waits into the queue as far as there is room.
    fn flush(&mut self) {
        while self.commands.slots() > 0
            && let Some(issued) = self.waiting.pop_front()
        {
            // The queue has room, and this is its only producer.
            let _ = self.commands.push(issued);
        }
    }
}

/// The step thread's end.
pub struct CommandInbox {
    commands: Consumer<(Ticket, Command)>,
    replies: Producer<(Ticket, Reply)>,
}

impl CommandInbox {
    /// Whether there is a command, and room for its reply.
    pub fn has_next(&self) -> bool {
        self.replies.slots() > 0 && !self.commands.is_empty()
    }

    /// The next command, if there is one and room for its reply.
    pub fn receive(&mut self) -> Option<(Ticket, Command)> {
        if self.replies.slots() == 0 {
            return None;
        }
        self.commands.pop().ok()
    }

    /// Sends the reply to the command that was taken last.
    pub fn reply(&mut self, ticket: Ticket, reply: Reply) {
        // There was room when the command was taken, and this is the queue's only producer.
        let _ = self.replies.push((ticket, reply));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Takes the commands of one turn, as the step thread does.
    fn take(inbox: &mut CommandInbox, mut execute: impl FnMut(Command) -> Reply) {
        for _ in 0..COMMANDS_PER_TURN {
            let Some((ticket, command)) = inbox.receive() else {
                return;
            };
            inbox.reply(ticket, execute(command));
        }
    }

    #[test]
    fn every_command_of_a_flood_is_executed_in_order_a_few_in_each_turn_and_replied_to() {
        let (mut sender, mut inbox) = channel();
        let identities = 0..5 * QUEUE as u64;
        let tickets: Vec<Ticket> = (identities.clone())
            .map(|identity| {
                let ticket = sender.ticket();
                sender.send(ticket, Command::Reset(identity));
                ticket
            })
            .collect();
        let (mut executed, mut replied) = (Vec::new(), Vec::new());
        while executed.len() < tickets.len() {
            let before = executed.len();
            take(&mut inbox, |command| {
                let Command::Reset(identity) = command else {
                    panic!("nobody sent this")
                };
                executed.push(identity);
                Reply::Reset
            });
            assert_eq!(executed.len() - before, COMMANDS_PER_TURN);
            replied.extend(std::iter::from_fn(|| sender.reply()).map(|(ticket, _)| ticket));
        }
        assert_eq!(executed, identities.collect::<Vec<_>>());
        assert_eq!(replied, tickets);
    }

    #[test]
    fn a_cancelled_ticket_takes_back_what_has_not_reached_the_queue_and_nothing_of_others() {
        let (mut sender, mut inbox) = channel();
        let (given_up, other) = (sender.ticket(), sender.ticket());
        for _ in 0..2 * QUEUE {
            sender.send(given_up, Command::Reset(0));
        }
        sender.send(other, Command::Reset(1));
        sender.cancel(given_up);
        let mut obeyed = Vec::new();
        while inbox.has_next() {
            take(&mut inbox, |command| {
                obeyed.push(matches!(command, Command::Reset(1)));
                Reply::Reset
            });
            while sender.reply().is_some() {}
        }
        let of_others = obeyed.iter().filter(|of_other| **of_other).count();
        assert_eq!((obeyed.len(), of_others), (QUEUE + 1, 1));
    }

    #[test]
    fn a_command_waits_until_there_is_room_for_its_reply() {
        let (mut sender, mut inbox) = channel();
        let ticket = sender.ticket();
        for _ in 0..2 * QUEUE {
            sender.send(ticket, Command::Acknowledge(0, None));
        }
        let mut executed = 0;
        for _ in 0..QUEUE {
            take(&mut inbox, |_| {
                executed += 1;
                Reply::Acknowledged(true)
            });
        }
        assert_eq!(executed, QUEUE, "nobody has taken a reply");
        assert_eq!(std::iter::from_fn(|| sender.reply()).count(), QUEUE);
        take(&mut inbox, |_| {
            executed += 1;
            Reply::Acknowledged(true)
        });
        assert_eq!(executed, QUEUE + COMMANDS_PER_TURN);
    }
}
