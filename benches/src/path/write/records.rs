//! What writing a record costs, against the number of processes that read it without pause.

use std::collections::BTreeMap;
use std::time::Duration;

use anyhow::Result;
use hdrhistogram::Histogram;
use residual_shared::clock::{monotonic_ns, sleep_until_monotonic};

use crate::path::crowd::{Activity, Crowd, WORDS};
use crate::path::stage::{STEP_CORE, STEP_PRIORITY, Stage, on_own_thread};
use crate::path::tables;
use crate::percentiles::{Percentiles, duration, times};
use crate::processor::{pin, real_time};
use crate::results::{Chart, Finding, Results, Table};

/// Diagnosers of the table: their records are written one after the other at each instant, as a daemon does.
const SLOTS: usize = 16;

/// Channels of each record: 264 bytes.
const CHANNELS: usize = 6;

/// Numbers of readers.
const READERS: [u8; 8] = [0, 1, 2, 4, 8, 16, 32, 64];

/// The writer's period, nanoseconds.
const PERIOD_NS: u64 = 1_000_000;

/// Times per record of all rounds with the same number of readers, and the medians of the rounds.
struct Measured {
    times: Histogram<u64>,
    medians: Vec<u64>,
}

/// Measures and judges.
pub fn run(results: &mut Results, rounds: usize, is_real_time: bool) -> Result<()> {
    let measured = on_own_thread(|| measure(rounds, is_real_time))?;
    let title = format!("Writing one record of {CHANNELS} channels ({SLOTS} in a row, every millisecond)");
    let mut table = Table::of_percentiles(title, &["readers"]);
    let mut curve = Vec::new();
    for (readers, measured) in &measured {
        table.percentiles([readers.to_string()], &Percentiles::of(&measured.times));
        curve.push((f64::from(*readers), measured.median() as f64));
    }
    results.tables.push(table);
    results.charts.push(Chart {
        file: "write_readers".into(),
        title: "Median of writing one record".into(),
        x: "readers".into(),
        y: "ns".into(),
        curves: vec![("bounds table".into(), curve)],
    });
    judge(results, &measured);
    Ok(())
}

fn judge(results: &mut Results, measured: &BTreeMap<u8, Measured>) {
    let noise = measured.values().map(Measured::spread).max().unwrap_or_default();
    let Some(without) = measured.get(&0).map(Measured::median) else {
        return;
    };
    let with = measured.iter().filter(|(readers, _)| **readers > 0);
    let most = with
        .map(|(_, measured)| measured.median())
        .max()
        .unwrap_or_default();
    results.findings.push(Finding::of(
        "writing one record, largest median of 1 to 64 readers above that of none",
        format!(
            "≤ {} (noise: largest distance of the quartiles of rounds with as many readers)",
            duration(noise as f64)
        ),
        format!(
            "{} ({} − {})",
            duration(most as f64 - without as f64),
            duration(most as f64),
            duration(without as f64)
        ),
        most <= without + noise,
    ));
}

impl Measured {
    /// The median of the rounds' medians.
    fn median(&self) -> u64 {
        self.quarter(2)
    }

    /// Distance of their quartiles.
    fn spread(&self) -> u64 {
        self.quarter(3) - self.quarter(1)
    }

    fn quarter(&self, quarter: usize) -> u64 {
        let mut sorted = self.medians.clone();
        sorted.sort_unstable();
        sorted
            .get(sorted.len() * quarter / 4)
            .copied()
            .unwrap_or_default()
    }
}

fn measure(rounds: usize, is_real_time: bool) -> Result<BTreeMap<u8, Measured>> {
    let stage = Stage::open(WORDS)?;
    let mut table = tables::create(&stage.instance().bounds_path(), SLOTS, CHANNELS)?;
    let record = tables::record(CHANNELS);
    let largest = READERS.iter().copied().max().unwrap_or_default();
    let mut crowd = Crowd::start(&stage, largest, None, false)?;
    if is_real_time {
        pin(STEP_CORE)?;
        real_time(STEP_PRIORITY)?;
    }
    let mut measured = BTreeMap::new();
    for _ in 0..rounds {
        for readers in READERS {
            let round = crowd.during(Activity::ReadTable, readers, || {
                let window = Duration::from_millis(50.max(5 * u64::from(readers)));
                let mut round = times();
                let begin_ns = monotonic_ns();
                for tick in 1..=window.as_nanos() as u64 / PERIOD_NS {
                    sleep_until_monotonic(begin_ns + tick * PERIOD_NS);
                    let before_ns = monotonic_ns();
                    for slot in 0..SLOTS {
                        table.publish(slot, &record);
                    }
                    round.saturating_record((monotonic_ns() - before_ns) / SLOTS as u64);
                }
                Ok(round)
            })?;
            let entry = measured.entry(readers).or_insert_with(|| Measured {
                times: times(),
                medians: Vec::new(),
            });
            entry.medians.push(round.value_at_quantile(0.5));
            entry.times.add(&round)?;
        }
    }
    crowd.finish()?;
    Ok(measured)
}
