//! The sensors of the diagnosers whose alarms come and go.

use std::sync::atomic::Ordering;

use anyhow::{Context, Result};
use residual_shared::bounds_table::TableReader;
use residual_shared::clock::{monotonic_ns, sleep_until_monotonic};
use residual_shared::transport::{self, SamplePublisher};

use crate::path::stage::{OTHER_CORE, PUBLISHER_PRIORITY, Part};
use crate::process::asked_to_end;

/// From the publishing of a sample to its sampling instant.
const LEAD_NS: u64 = 200_000;

/// What a faulty sensor says; the noise is 0.1.
const FAULTY: f64 = 100.0;

/// What it is told.
#[derive(Clone, Debug, clap::Args)]
pub struct Options {
    #[command(flatten)]
    part: Part,
    /// Sampling instants from one change to the next.
    #[arg(long)]
    rest: u64,
}

/// Publishes samples without a fault and with one by turns, until asked to end.
///
/// # Errors
/// There is no daemon, or it does not take samples.
pub fn play(options: &Options) -> Result<()> {
    let end = asked_to_end();
    let instance = options.part.instance()?;
    let table = TableReader::open(&instance.bounds_path())?;
    let spec = &table.directory().spec;
    let slot = spec.slots.first().context("no diagnoser")?;
    let input = spec.inputs.first().context("no input")?;
    let node = transport::open_node(&instance)?;
    let mut publisher = SamplePublisher::open(&node, &instance, &input.name)?;
    let mut elements = vec![0.0; input.signals.len()];
    options.part.take_seat(OTHER_CORE, PUBLISHER_PRIORITY)?;
    let first_ns = spec.schedule_epoch_ns;
    let mut step = (monotonic_ns().saturating_sub(first_ns) / slot.period_ns) + 2;
    while !end.load(Ordering::Relaxed) {
        sleep_until_monotonic(first_ns + step * slot.period_ns - LEAD_NS);
        let is_faulty = (step / options.rest) % 2 == 1;
        elements.fill(if is_faulty { FAULTY } else { 0.0 });
        publisher.send(monotonic_ns(), &elements)?;
        step += 1;
    }
    Ok(())
}
