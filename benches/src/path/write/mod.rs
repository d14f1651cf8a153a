//! `write`: what the daemon's side pays for its clients.
//!
//! | module | what |
//! |---|---|
//! | [`records`] | writing a record with 0 to 64 processes that read without pause |
//! | [`alarms`] | raising an alarm with 0 to 8 processes asleep on the ring |
//! | [`step`] | a step of the real daemon, and its whole tick, with and without 8 consumers of its alarms |
//! | [`toggler`] | the publisher whose samples raise and clear these alarms |

use anyhow::Result;

use super::stage::real_time_refusal;
use crate::results::Results;

mod alarms;
mod records;
mod step;
pub mod toggler;

/// What `write` takes.
#[derive(Clone, Debug, clap::Args)]
pub struct Options {
    /// Rounds over all numbers of readers; default 12, with --quick 6.
    #[arg(long)]
    rounds: Option<usize>,
    /// Runs of the daemon of each kind; default 3, with --quick 2.
    #[arg(long)]
    runs: Option<usize>,
}

/// Measures all three.
///
/// # Errors
/// A process fails.
pub fn run(options: &Options, quick: bool) -> Result<Results> {
    let about = "Readers are processes that read the table without pause, in slices of the two cores; sleepers and \
                 consumers are processes of the client library that sleep until there is an alarm. Writer and step \
                 thread are on core 1 under SCHED_FIFO, sleepers and consumers on core 0, where that is permitted. The \
                 daemon has 8 diagnosers with a period of 1 ms whose alarms are raised and cleared together.";
    let mut results = Results::begin("write", "The writer's cost", about, quick);
    let refusal = real_time_refusal();
    if let Some(why) = &refusal {
        results.skip("a writer under SCHED_FIFO on a core of its own", why);
    }
    let is_real_time = refusal.is_none();
    let rounds = options.rounds.unwrap_or(if quick { 6 } else { 12 });
    let runs = options.runs.unwrap_or(if quick { 2 } else { 3 });
    records::run(&mut results, rounds, is_real_time)?;
    alarms::run(&mut results, rounds, is_real_time)?;
    step::run(&mut results, runs, if quick { 1.0 } else { 4.0 }, is_real_time)?;
    Ok(results)
}
