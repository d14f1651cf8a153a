//! What raising an alarm costs, against the number of processes that sleep until there is one.

use std::collections::BTreeMap;

use anyhow::Result;
use hdrhistogram::Histogram;
use residual_shared::clock::{monotonic_ns, sleep_until_monotonic};

use crate::path::crowd::{Activity, Crowd, WORDS};
use crate::path::stage::{OTHER_CORE, STEP_CORE, STEP_PRIORITY, Stage, on_own_thread};
use crate::path::tables;
use crate::percentiles::{Percentiles, duration, times};
use crate::processor::{pin, real_time};
use crate::results::{Results, Table};

/// Numbers of sleepers.
const SLEEPERS: [u8; 5] = [0, 1, 2, 4, 8];

/// Between two alarms, nanoseconds: long enough to fall asleep.
const PERIOD_NS: u64 = 2_000_000;

/// Alarms in a row with as many sleepers.
const ALARMS: u64 = 60;

/// Measures.
pub fn run(results: &mut Results, rounds: usize, is_real_time: bool) -> Result<()> {
    let measured = on_own_thread(|| measure(rounds, is_real_time))?;
    let mut table = Table::of_percentiles("Raising one alarm: writing and waking", &["sleepers"]);
    for (sleepers, times) in &measured {
        table.percentiles([sleepers.to_string()], &Percentiles::of(times));
    }
    results.tables.push(table);
    let median = |sleepers: u8| {
        let times = measured.get(&sleepers);
        times.map_or(0.0, |times| times.value_at_quantile(0.5) as f64)
    };
    results.notes.push(format!(
        "An alarm costs its writer {} without sleepers and {} more for each of 8: FUTEX_WAKE makes every sleeper ready \
         to run before it returns.",
        duration(median(0)),
        duration((median(8) - median(0)) / 8.0)
    ));
    Ok(())
}

fn measure(rounds: usize, is_real_time: bool) -> Result<BTreeMap<u8, Histogram<u64>>> {
    let stage = Stage::open(WORDS)?;
    let mut table = tables::create(&stage.instance().bounds_path(), 1, 1)?;
    let largest = SLEEPERS.iter().copied().max().unwrap_or_default();
    let core = is_real_time.then_some(OTHER_CORE);
    let mut crowd = Crowd::start(&stage, largest, core, false)?;
    if is_real_time {
        pin(STEP_CORE)?;
        real_time(STEP_PRIORITY)?;
    }
    let mut measured = BTreeMap::new();
    for _ in 0..rounds {
        for sleepers in SLEEPERS {
            crowd.during(Activity::HearAlarms, sleepers, || {
                let all = measured.entry(sleepers).or_insert_with(times);
                let begin_ns = monotonic_ns();
                for tick in 1..=ALARMS {
                    sleep_until_monotonic(begin_ns + tick * PERIOD_NS);
                    table.heartbeat(monotonic_ns());
                    let before_ns = monotonic_ns();
                    table.raise(&tables::transition());
                    all.saturating_record(monotonic_ns() - before_ns);
                }
                Ok(())
            })?;
        }
    }
    crowd.finish()?;
    Ok(measured)
}
