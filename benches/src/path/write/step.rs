//! What alarms and their consumers cost the step thread of the real daemon.

use std::fmt::Write as _;
use std::thread::sleep;
use std::time::Duration;

use anyhow::{Context, Result, ensure};
use hdrhistogram::Histogram;
use residual_shared::bounds_table::TableReader;
use residual_shared::clock::{monotonic_ns, sleep_until_monotonic};
use residuald::summary::Summary;

use crate::path::crowd::{Activity, Crowd, WORDS};
use crate::path::stage::{
    CLIENT_PRIORITY, Daemon, OTHER_CORE, STEP_CORE, STEP_PRIORITY, Stage, on_own_thread,
};
use crate::percentiles::{Percentiles, duration, significant, times};
use crate::processor::{pin, real_time};
use crate::results::{Finding, Results, Table};

/// Diagnosers of the daemon; all of them alarm at the same instants.
const DIAGNOSERS: usize = 8;

/// Consumers of their alarms.
const CONSUMERS: u8 = 8;

/// Their period, nanoseconds.
const PERIOD_NS: u64 = 1_000_000;

/// Sampling instants from one transition to the next, and what that makes.
const RESTS: [(u64, &str); 2] = [(100, "80 alarms a second"), (1, "8,000 alarms a second")];

/// How much the 99th percentile of a step may grow by consumers.
const GROWTH: f64 = 1.05;

/// One run of the daemon, or several of the same kind.
struct Measured {
    rest: u64,
    consumers: u8,
    /// Percentiles of the steps of each run.
    steps: Vec<(u64, u64)>,
    /// From the sampling instant to the end of the tick.
    ticks: Histogram<u64>,
}

/// Measures each combination `rounds` times, for `seconds` each.
pub fn run(results: &mut Results, rounds: usize, seconds: f64, is_real_time: bool) -> Result<()> {
    let mut all: Vec<Measured> = Vec::new();
    for _ in 0..rounds {
        for (rest, _) in RESTS {
            for consumers in [0, CONSUMERS] {
                let (summary, ticks) = measure(rest, consumers, seconds, is_real_time)?;
                let steps = (summary.step_times.p50_ns, summary.step_times.p99_ns);
                let same = |other: &&mut Measured| (other.rest, other.consumers) == (rest, consumers);
                match all.iter_mut().find(same) {
                    Some(known) => {
                        known.steps.push(steps);
                        known.ticks.add(&ticks)?;
                    }
                    None => all.push(Measured {
                        rest,
                        consumers,
                        steps: vec![steps],
                        ticks,
                    }),
                }
            }
        }
    }
    let mut table = Table::of_percentiles(
        format!("Sampling instant → end of the tick of {DIAGNOSERS} diagnosers"),
        &["alarms", "consumers", "step p50", "step p99"],
    );
    for (rest, name) in RESTS {
        let mut of_rest = all.iter().filter(|measured| measured.rest == rest);
        for measured in of_rest.clone() {
            let first = [
                name.to_owned(),
                measured.consumers.to_string(),
                duration(measured.p50() as f64),
                duration(measured.p99() as f64),
            ];
            table.percentiles(first, &Percentiles::of(&measured.ticks));
        }
        if let (Some(without), Some(with)) = (of_rest.next(), of_rest.next()) {
            let ratio = with.p99() as f64 / without.p99() as f64;
            results.findings.push(Finding::of(
                format!("step p99 with {CONSUMERS} alarm consumers / without, {name}"),
                format!("≤ {GROWTH}"),
                format!(
                    "{} ({} / {}; runs of one kind differ by up to {})",
                    significant(ratio),
                    duration(with.p99() as f64),
                    duration(without.p99() as f64),
                    duration(without.spread().max(with.spread()) as f64)
                ),
                ratio <= GROWTH,
            ));
        }
    }
    results.tables.push(table);
    Ok(())
}

impl Measured {
    /// Median of the runs' medians.
    fn p50(&self) -> u64 {
        median(self.steps.iter().map(|(p50, _)| *p50))
    }

    /// Median of the runs' 99th percentiles.
    fn p99(&self) -> u64 {
        median(self.steps.iter().map(|(_, p99)| *p99))
    }

    /// By how much the 99th percentiles of two runs differ.
    fn spread(&self) -> u64 {
        let p99 = || self.steps.iter().map(|(_, p99)| *p99);
        p99().max().unwrap_or_default() - p99().min().unwrap_or_default()
    }
}

fn median(values: impl Iterator<Item = u64>) -> u64 {
    let mut values: Vec<u64> = values.collect();
    values.sort_unstable();
    values.get(values.len() / 2).copied().unwrap_or_default()
}

fn measure(rest: u64, consumers: u8, seconds: f64, is_real_time: bool) -> Result<(Summary, Histogram<u64>)> {
    let stage = Stage::open(WORDS)?;
    let daemon = stage.start_daemon(&configuration(&stage, is_real_time))?;
    let core = is_real_time.then_some(OTHER_CORE);
    let mut crowd = Crowd::start(&stage, CONSUMERS, core, false)?;
    let more = ["--rest".to_owned(), rest.to_string()];
    let toggler = stage.start("toggler", is_real_time, &more)?;
    // Until the alarms have begun.
    sleep(Duration::from_millis(300));
    let ticks = crowd.during(Activity::HearAlarms, consumers, || {
        on_own_thread(|| watch(&daemon, seconds, is_real_time))
    })?;
    let alarms = daemon.table.newest_alarm();
    toggler.end()?;
    crowd.finish()?;
    let summary = daemon.stop()?;
    let expected = seconds * 1e9 / (PERIOD_NS * rest) as f64 * DIAGNOSERS as f64;
    ensure!(
        alarms as f64 > 0.8 * expected,
        "{alarms} alarms, not some {expected}: the diagnosers do not do what they should"
    );
    Ok((summary, ticks))
}

/// Looks in the middle between two sampling instants at the sign of life that the step thread gives at the end of a
/// tick.
fn watch(daemon: &Daemon, seconds: f64, is_real_time: bool) -> Result<Histogram<u64>> {
    if is_real_time {
        pin(OTHER_CORE)?;
        real_time(CLIENT_PRIORITY)?;
    }
    let table: &TableReader = &daemon.table;
    let first_ns = table.directory().spec.schedule_epoch_ns;
    let mut ticks = times();
    let mut instant_ns = first_ns + (monotonic_ns() - first_ns).div_ceil(PERIOD_NS) * PERIOD_NS;
    let end_ns = monotonic_ns() + (seconds * 1e9) as u64;
    while instant_ns < end_ns {
        sleep_until_monotonic(instant_ns + PERIOD_NS * 3 / 4);
        let now_ns = monotonic_ns();
        let age_ns = u64::try_from(table.heartbeat_age(now_ns).as_nanos()).context("an age")?;
        let tick_end_ns = now_ns - age_ns;
        if now_ns < instant_ns + PERIOD_NS && tick_end_ns >= instant_ns {
            ticks.saturating_record(tick_end_ns - instant_ns);
        }
        instant_ns += PERIOD_NS;
    }
    Ok(ticks)
}

/// Diagnosers without memory, so that each sample alone raises or clears the alarm.
fn configuration(stage: &Stage, is_real_time: bool) -> String {
    let real_time = if is_real_time {
        format!("fifo_priority = {STEP_PRIORITY}\ncpu = {STEP_CORE}\n")
    } else {
        String::new()
    };
    let mut text = format!(
        "[daemon]\ninstance = \"{}\"\nruntime_directory = \"{}\"\nlog = \"off\"\n\n[realtime]\nlock_memory = true\n\
         {real_time}\n[[input]]\nname = \"sensors\"\nsignals = [\"a\", \"b\", \"c\", \"d\"]\n",
        stage.instance().name,
        stage.directory().display(),
    );
    for number in 0..DIAGNOSERS {
        // Writing to a text cannot fail.
        let _ = write!(
            text,
            "\n[[diagnoser]]\nname = \"diagnoser_{number}\"\nmethod = \"chi_square\"\nsample_time_s = {}\nmargin_s = 0.0\n\
             measurements = [\"sensors.a\", \"sensors.b\", \"sensors.c\", \"sensors.d\"]\n\n{DIAGNOSER}",
            PERIOD_NS as f64 * 1e-9
        );
    }
    text
}

const DIAGNOSER: &str = "[diagnoser.lifecycle]
raise_steps = 1
raise_window = 1
clear_steps = 1
clear_ratio = 1.0

[diagnoser.model]
transition = [[1e-4, 0, 0, 0], [0, 1e-4, 0, 0], [0, 0, 1e-4, 0], [0, 0, 0, 1e-4]]
process_noise_covariance = [[0.01, 0, 0, 0], [0, 0.01, 0, 0], [0, 0, 0.01, 0], [0, 0, 0, 0.01]]
measurement = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
initial_covariance = [[0.01, 0, 0, 0], [0, 0.01, 0, 0], [0, 0, 0.01, 0], [0, 0, 0, 0.01]]
measurement_noise_covariance = [[0.01, 0, 0, 0], [0, 0.01, 0, 0], [0, 0, 0.01, 0], [0, 0, 0, 0.01]]

[diagnoser.statistics]
enabled = [\"residual\"]
decision = [\"residual\"]

[diagnoser.threshold]
mode = \"per_instant\"
false_alarm_probability = 1e-6

[diagnoser.alarm]
clear_steps = 1
";
