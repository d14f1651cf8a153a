//! A bare timer loop: what the kernel alone takes to wake somebody at an instant.

use std::sync::atomic::Ordering;

use anyhow::{Context, Result};
use residual_shared::bounds_table::TableReader;
use residual_shared::clock::{monotonic_ns, sleep_until_monotonic};

use super::{READY, WARM_UP_STEPS};
use crate::path::stage::{Part, STEP_CORE, STEP_PRIORITY};
use crate::percentiles::{counts, times};
use crate::process::{asked_to_end, say};

/// What it is told.
#[derive(Clone, Debug, clap::Args)]
pub struct Options {
    #[command(flatten)]
    part: Part,
}

/// Sleeps until the middle between two sampling instants, again and again, with the period, the core and the
/// priority of the step thread, until asked to end; says how late it woke (nanoseconds).
///
/// # Errors
/// There is no table.
pub fn play(options: &Options) -> Result<()> {
    let end = asked_to_end();
    let table = TableReader::open(&options.part.instance()?.bounds_path())?;
    let spec = &table.directory().spec;
    let slot = spec.slots.first().context("no diagnoser")?;
    options.part.take_seat(STEP_CORE, STEP_PRIORITY)?;
    say(&READY)?;
    let first_ns = spec.schedule_epoch_ns + slot.phase_ns + slot.period_ns / 2;
    let mut lateness = times();
    let begin = (monotonic_ns().saturating_sub(first_ns) / slot.period_ns) + 2;
    let mut step = begin;
    while !end.load(Ordering::Relaxed) {
        let instant_ns = first_ns + step * slot.period_ns;
        sleep_until_monotonic(instant_ns);
        if step >= begin + WARM_UP_STEPS {
            lateness.saturating_record(monotonic_ns().saturating_sub(instant_ns));
        }
        step += 1;
    }
    say(&counts(&lateness))
}
