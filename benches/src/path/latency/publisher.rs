//! The sensors: one sample of every input ahead of each sampling instant.

use std::sync::atomic::Ordering;

use anyhow::{Context, Result};
use residual_shared::bounds_table::TableReader;
use residual_shared::clock::{monotonic_ns, sleep_until_monotonic};
use residual_shared::transport::{self, SamplePublisher};

use super::{LEAD_NS, READY, sent_word};
use crate::path::stage::{OTHER_CORE, PUBLISHER_PRIORITY, Part};
use crate::process::{asked_to_end, say};

/// What it is told.
#[derive(Clone, Debug, clap::Args)]
pub struct Options {
    #[command(flatten)]
    part: Part,
}

/// Publishes zeros, which the plants at rest give, until asked to end; tells when in the shared words.
///
/// # Errors
/// There is no daemon, or it does not take samples.
pub fn play(options: &Options) -> Result<()> {
    let end = asked_to_end();
    let (instance, words) = (options.part.instance()?, options.part.words()?);
    let table = TableReader::open(&instance.bounds_path())?;
    let spec = &table.directory().spec;
    let slot = spec.slots.first().context("no diagnoser")?;
    let node = transport::open_node(&instance)?;
    let mut publishers = spec
        .inputs
        .iter()
        .map(|input| {
            let publisher = SamplePublisher::open(&node, &instance, &input.name)?;
            Ok((publisher, vec![0.0; input.signals.len()]))
        })
        .collect::<Result<Vec<_>>>()?;
    options.part.take_seat(OTHER_CORE, PUBLISHER_PRIORITY)?;
    say(&READY)?;
    let first_ns = spec.schedule_epoch_ns + slot.phase_ns;
    let mut step = (monotonic_ns().saturating_sub(first_ns) / slot.period_ns) + 2;
    while !end.load(Ordering::Relaxed) {
        sleep_until_monotonic(first_ns + step * slot.period_ns - LEAD_NS);
        let now_ns = monotonic_ns();
        // One that is late samples for a later instant.
        step = step.max((now_ns - first_ns).div_ceil(slot.period_ns));
        words.word(sent_word(step)).store(now_ns, Ordering::Relaxed);
        for (publisher, elements) in &mut publishers {
            publisher.send(now_ns, elements)?;
        }
        step += 1;
    }
    Ok(())
}
