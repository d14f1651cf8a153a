//! The client: looks for new bounds without pause, and says when it saw them.

use std::hint::spin_loop;
use std::sync::atomic::Ordering;

use anyhow::{Context, Result};
use residual_shared::bounds_table::{ReadOutcome, TableReader};
use residual_shared::clock::{monotonic_ns, sleep_until_monotonic};
use residual_shared::record::{StepRecord, flags};
use serde::{Deserialize, Serialize};

use super::{LOOK_AHEAD_NS, LOOK_BEHIND_NS, READY, WARM_UP_STEPS, sent_word};
use crate::path::stage::{CLIENT_PRIORITY, OTHER_CORE, Part};
use crate::percentiles::{Counts, counts, times};
use crate::process::{asked_to_end, say};

/// What it is told.
#[derive(Clone, Debug, clap::Args)]
pub struct Options {
    #[command(flatten)]
    part: Part,
}

/// What it has seen.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Seen {
    /// Sampling instant → its bounds read, nanoseconds.
    pub since_instant: Counts,
    /// Sample published → bounds of its instant read, nanoseconds.
    pub since_published: Counts,
    /// Records whose samples had not arrived at the sampling instant; they are not among the times.
    pub without_samples: u64,
    /// Records that were overwritten before they were seen.
    pub overtaken: u64,
}

/// Looks until asked to end.
///
/// Under SCHED_FIFO it looks from shortly before each sampling instant until it has seen the record, and sleeps
/// otherwise: the kernel takes the processor from a process of that class that never sleeps. It does the same around
/// the instants of the bare timer, so that those find the machine as awake.
///
/// # Errors
/// There is no table.
pub fn play(options: &Options) -> Result<()> {
    let end = asked_to_end();
    let words = options.part.words()?;
    let table = TableReader::open(&options.part.instance()?.bounds_path())?;
    let period_ns = table
        .directory()
        .spec
        .slots
        .first()
        .context("no diagnoser")?
        .period_ns;
    options.part.take_seat(OTHER_CORE, CLIENT_PRIORITY)?;
    say(&READY)?;
    let (mut since_instant, mut since_published) = (times(), times());
    let (mut without_samples, mut overtaken, mut records) = (0, 0, 0_u64);
    let mut record = StepRecord::new(0);
    let mut known = 0;
    while !end.load(Ordering::Relaxed) {
        let number = match table.read(0, &mut record) {
            Ok(ReadOutcome::Record { number }) if number != known => number,
            _ => {
                spin_loop();
                continue;
            }
        };
        let now_ns = monotonic_ns();
        records += 1;
        if records > WARM_UP_STEPS {
            overtaken += number - known - 1;
            if record.flags & flags::INPUT_MISSING == 0 {
                let sent_ns = words.word(sent_word(record.step)).load(Ordering::Relaxed);
                since_instant.saturating_record(now_ns.saturating_sub(record.instant_ns));
                since_published.saturating_record(now_ns.saturating_sub(sent_ns));
            } else {
                without_samples += 1;
            }
        }
        known = number;
        if options.part.real_time {
            let timer_ns = record.instant_ns + period_ns / 2;
            sleep_until_monotonic(timer_ns - LOOK_AHEAD_NS);
            while monotonic_ns() < timer_ns + LOOK_BEHIND_NS {
                spin_loop();
            }
            sleep_until_monotonic(record.instant_ns + period_ns - LOOK_AHEAD_NS);
        }
    }
    say(&Seen {
        since_instant: counts(&since_instant),
        since_published: counts(&since_published),
        without_samples,
        overtaken,
    })
}
