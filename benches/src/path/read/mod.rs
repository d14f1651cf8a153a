//! `read`: what reading a record costs a client, with 1 to 64 reading processes and a writer at 1 kHz, beside an
//! iceoryx2 blackboard with an entry of the same size.
//!
//! More processes than cores share them in slices of some milliseconds. Each read is timed on its own, so that a lost
//! slice is one long read among millions; and in batches, so that the clock does not count.

use std::collections::BTreeMap;
use std::time::Duration;

use anyhow::Result;
use residual_shared::clock::{monotonic_ns, sleep_until_monotonic};

use super::crowd::{Activity, BATCH, Crowd, Times, WORDS};
use super::stage::{PUBLISHER_PRIORITY, Stage, on_own_thread, real_time_refusal};
use super::tables;
use crate::percentiles::{Percentiles, duration};
use crate::processor::real_time;
use crate::results::{Chart, Finding, Results, Table};
use blackboard::Board;

pub mod blackboard;

/// Channels of the record: the least number with 256 bytes or more.
const CHANNELS: usize = 6;

/// Words of such a record.
pub const RECORD_WORDS: usize = 9 + 4 * CHANNELS;

/// Numbers of readers.
const READERS: [u8; 7] = [1, 2, 4, 8, 16, 32, 64];

/// The writer's period, nanoseconds.
const PERIOD_NS: u64 = 1_000_000;

/// Longest median of one read, nanoseconds, with the clock.
const LIMIT_NS: f64 = 150.0;

/// How much the median may grow with the number of readers.
const FLAT: f64 = 1.2;

const WAYS: [(Activity, &str); 3] = [
    (Activity::ReadTable, "bounds table"),
    (
        Activity::ReadMonitor,
        "client library (bounds table, liveness, freshness)",
    ),
    (Activity::ReadBlackboard, "iceoryx2 blackboard"),
];

/// What `read` takes.
#[derive(Clone, Debug, clap::Args)]
pub struct Options {
    /// Rounds over all numbers of readers; default 6, with --quick 2.
    #[arg(long)]
    rounds: Option<usize>,
}

/// What was measured, by way and number of readers.
type Measured = BTreeMap<(Activity, u8), Times>;

/// Measures all numbers of readers.
///
/// # Errors
/// A process fails.
pub fn run(options: &Options, quick: bool) -> Result<Results> {
    let about = format!(
        "Each reader is a process that reads one record of {CHANNELS} channels, {} bytes, again and again, while a writer \
         replaces it every millisecond; the blackboard has one entry of the same size, which the same writer replaces. \
         The ways take turns in short windows. The percentiles are of single reads and contain one look at the clock; \
         the medians in batches of {BATCH} hardly do.",
        8 * RECORD_WORDS
    );
    let mut results = Results::begin("read", "Reading bounds", &about, quick);
    let rounds = options.rounds.unwrap_or(if quick { 2 } else { 6 });
    let refusal = real_time_refusal();
    if let Some(why) = &refusal {
        results.skip("a writer under SCHED_FIFO (it has the usual scheduling)", why);
    }
    let measured = on_own_thread(|| measure(rounds, refusal.is_none()))?;
    report(&mut results, &measured);
    Ok(results)
}

fn measure(rounds: usize, is_real_time: bool) -> Result<Measured> {
    let stage = Stage::open(WORDS)?;
    let mut table = tables::create(&stage.instance().bounds_path(), 1, CHANNELS)?;
    let record = tables::record(CHANNELS);
    let board = Board::create(stage.instance())?;
    table.heartbeat(monotonic_ns());
    let largest = READERS.iter().copied().max().unwrap_or_default();
    let mut crowd = Crowd::start(&stage, largest, None, true)?;
    if is_real_time {
        real_time(PUBLISHER_PRIORITY)?;
    }
    let mut value = [0; RECORD_WORDS];
    let mut write = |window: Duration| {
        let begin_ns = monotonic_ns();
        let windows = window.as_nanos() as u64 / PERIOD_NS;
        for tick in 1..=windows {
            sleep_until_monotonic(begin_ns + tick * PERIOD_NS);
            table.heartbeat(monotonic_ns());
            table.publish(0, &record);
            value[0] += 1;
            board.entry.update_with_copy(value);
        }
        Ok(())
    };
    crowd.during(Activity::LookAtTheClock, 1, || write(window(1)))?;
    for round in 0..rounds {
        for readers in READERS {
            for turn in 0..WAYS.len() {
                let (way, _) = WAYS[(round + turn) % WAYS.len()];
                crowd.during(way, readers, || write(window(readers)))?;
            }
        }
    }
    crowd.finish()
}

/// Long enough for every reader to have a slice of a processor.
fn window(readers: u8) -> Duration {
    Duration::from_millis(30.max(5 * u64::from(readers)))
}

/// Median of one read of a batch, nanoseconds.
fn in_batches(times: &Times) -> f64 {
    times.batches.value_at_quantile(0.5) as f64 / f64::from(BATCH)
}

fn report(results: &mut Results, measured: &Measured) {
    let batches = format!("p50 in batches of {BATCH}");
    let mut table = Table::of_percentiles("One read", &["readers", "way", &batches]);
    let mut curves: Vec<(String, Vec<(f64, f64)>)> = WAYS
        .iter()
        .map(|(_, name)| ((*name).to_owned(), Vec::new()))
        .collect();
    for readers in READERS {
        for ((way, name), (_, curve)) in WAYS.iter().zip(&mut curves) {
            if let Some(times) = measured.get(&(*way, readers)) {
                let median = in_batches(times);
                curve.push((f64::from(readers), median));
                let first = [readers.to_string(), (*name).to_owned(), duration(median)];
                table.percentiles(first, &Percentiles::of(&times.single));
            }
        }
    }
    results.tables.push(table);
    results.charts.push(Chart {
        file: "read_readers".into(),
        title: "Median of one read in batches".into(),
        x: "readers".into(),
        y: "ns".into(),
        curves,
    });
    if let Some(clock) = measured.get(&(Activity::LookAtTheClock, 1)) {
        results.notes.push(format!(
            "One look at the clock takes {} (p50); it is part of every single read.",
            duration(clock.single.value_at_quantile(0.5) as f64)
        ));
    }
    judge(results, measured);
}

fn judge(results: &mut Results, measured: &Measured) {
    let all = |way| {
        READERS
            .iter()
            .filter_map(move |&readers| measured.get(&(way, readers)))
    };
    let largest = |values: &mut dyn Iterator<Item = f64>| values.fold(0.0, f64::max);
    let single = |times: &Times| times.single.value_at_quantile(0.5) as f64;
    for (way, what) in [
        (Activity::ReadTable, "read of the bounds table"),
        (Activity::ReadMonitor, "read through the client library"),
    ] {
        let worst = largest(&mut all(way).map(single));
        let what = format!("{what}, p50 with the clock, largest of 1 to 64 readers");
        results
            .findings
            .push(Finding::at_most(what, worst, LIMIT_NS, "ns"));
    }
    let pairs = all(Activity::ReadTable).zip(all(Activity::ReadBlackboard));
    let ratio = largest(&mut pairs.map(|(own, peer)| in_batches(own) / in_batches(peer)));
    let what = "bounds table / iceoryx2 blackboard, p50 in batches, largest of 1 to 64 readers";
    results.findings.push(Finding::at_most(what, ratio, 1.0, ""));
    if let Some(first) = all(Activity::ReadTable).next() {
        let growth = largest(&mut all(Activity::ReadTable).map(in_batches)) / in_batches(first);
        let what = "bounds table, largest p50 in batches of 1 to 64 readers / that of 1 reader";
        results.findings.push(Finding::at_most(what, growth, FLAT, ""));
    }
}
