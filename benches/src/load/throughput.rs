//! `residual-bench throughput`: how many diagnosers of all methods one core carries at 100 Hz.

use std::thread::{available_parallelism, sleep};
use std::time::{Duration, Instant};

use anyhow::Result;
use clap::Args;
use residuald::summary::Summary;

use super::daemon::{Counts, Daemon, RealTimeOptions};
use super::fleet::{FleetOptions, Kinds, PERIOD_NS, Phases, Sharing, instance};
use super::publishers::{Published, PublisherOptions, Publishers};
use super::simulated::Simulation;
use super::usage::{Usage, resident_bytes};
use crate::percentiles::{duration, significant};
use crate::results::{Chart, Finding, Results, Table};

/// Diagnosers that one core shall carry.
const AIM: usize = 1_000;

/// Priority of the step thread, and of publishers below it.
const FIFO: (u8, u8) = (50, 40);

/// From the first sample until counting begins: connections stand and first times are over.
const WARM_UP: Duration = Duration::from_secs(2);

/// The bisection ends when the largest load is known to this part of itself.
const RESOLUTION: f64 = 0.05;

/// So many diagnosers have more state than a second-level cache holds.
const BEYOND_CACHE: f64 = 200.0;

/// Arguments of `throughput`.
#[derive(Clone, Debug, Args)]
pub struct ThroughputOptions {
    /// Only this number of diagnosers, without a search for the largest.
    #[arg(long)]
    diagnosers: Option<usize>,
    /// Seconds of the check.
    #[arg(long)]
    seconds: Option<u64>,
    /// Processes that publish.
    #[arg(long, default_value_t = 1)]
    publishers: usize,
    /// Core of the step thread; publishers have another one.
    #[arg(long, default_value_t = 0)]
    core: usize,
    /// The usual scheduling instead of SCHED_FIFO.
    #[arg(long)]
    no_fifo: bool,
}

/// What came of one load.
#[derive(Debug)]
pub struct Trial {
    /// The fleet.
    pub fleet: FleetOptions,
    /// Seconds that were counted.
    pub seconds: f64,
    /// Counted in them.
    pub counts: Counts,
    /// Processor time of the step thread in them, as part of them.
    pub step_thread: f64,
    /// Processor time of the whole daemon in them, as part of them.
    pub daemon: f64,
    /// Resident memory of the daemon at their end, bytes.
    pub resident: u64,
    /// How the step thread was scheduled.
    pub scheduling: String,
    /// What the publishers did.
    pub published: Published,
    /// The daemon's own summary, from its start on.
    pub summary: Summary,
}

impl Trial {
    /// Whether no instant was missed.
    pub fn is_carried(&self) -> bool {
        let wanted = self.fleet.diagnosers as f64 * self.seconds * 1e9 / PERIOD_NS as f64;
        // Counting begins and ends within a period.
        self.counts.missed() == 0 && self.counts.steps as f64 > wanted - 3.0 * self.fleet.diagnosers as f64
    }
}

/// Runs one load for `seconds`.
///
/// # Errors
/// A process does not run.
pub fn attempt(
    fleet: &FleetOptions,
    real_time: &RealTimeOptions,
    publishers: &PublisherOptions,
    seconds: u64,
) -> Result<Trial> {
    let daemon = Daemon::start(fleet, real_time, instance("load")?)?;
    let publishers = Publishers::start(fleet, &daemon.instance.name, publishers)?;
    sleep(WARM_UP);
    let pid = daemon.id();
    let usage = || -> Result<_> { Ok((Usage::of_first_thread(pid)?, Usage::of_process(pid)?)) };
    let (begin, counts, used) = (Instant::now(), daemon.counts()?, usage()?);
    sleep(Duration::from_secs(seconds));
    let (elapsed, counts_after, used_after) = (begin.elapsed(), daemon.counts()?, usage()?);
    let part = |used: Duration| used.as_secs_f64() / elapsed.as_secs_f64();
    let (resident, scheduling) = (resident_bytes(pid)?, daemon.scheduling());
    let published = publishers.stop()?;
    Ok(Trial {
        fleet: *fleet,
        seconds: elapsed.as_secs_f64(),
        counts: counts_after.since(&counts),
        step_thread: part(used_after.0.since(&used.0).total()),
        daemon: part(used_after.1.since(&used.1).total()),
        resident,
        scheduling,
        published,
        summary: daemon.stop()?,
    })
}

/// The largest load that `carries` finds to be carried, to [`RESOLUTION`] of itself, and the smallest that it does not.
///
/// # Errors
/// Those of `carries`.
fn largest(mut carries: impl FnMut(usize) -> Result<bool>) -> Result<(usize, usize)> {
    let (mut carried, mut refused) = (0, None);
    let mut next = 200;
    loop {
        if carries(next)? {
            carried = next;
        } else {
            refused = Some(next);
        }
        next = match refused {
            None => 2 * carried,
            Some(refused) if (refused - carried) as f64 <= (RESOLUTION * refused as f64).max(1.0) => {
                return Ok((carried, refused));
            }
            Some(refused) => usize::midpoint(carried, refused),
        };
    }
}

/// Measures.
///
/// # Errors
/// A process does not run.
pub fn measure(options: &ThroughputOptions, quick: bool) -> Result<Results> {
    let mut results = Results::begin(
        "throughput",
        "Load",
        "The daemon (its own `run`, in a process of its own) with diagnosers of all five methods at 100 Hz, one fifth \
         each, fed over iceoryx2 by publishers in other processes. An instant is missed if its step was skipped or \
         began more than one period late. Lateness is that of a step behind instant + transport allowance (4 ms), \
         from the daemon's own histogram, over its whole life.",
        quick,
    );
    let cores = available_parallelism().map_or(1, usize::from);
    let fifo = (!options.no_fifo).then_some(FIFO);
    let real_time = RealTimeOptions {
        core: Some(options.core),
        fifo: fifo.map(|fifo| fifo.0),
    };
    let publishers = PublisherOptions {
        processes: options.publishers,
        faults: false,
        core: (cores > 1).then_some((options.core + 1) % cores),
        fifo: fifo.map(|fifo| fifo.1),
    };
    let fleet = |diagnosers, inputs, phases| FleetOptions {
        diagnosers,
        inputs,
        phases,
    };
    let together = |diagnosers| fleet(diagnosers, Sharing::Shared, Phases::Together);
    let mut trials = Vec::new();
    let mut attempt = |fleet: FleetOptions, seconds: u64| -> Result<bool> {
        eprintln!("{} diagnosers, {seconds} s", fleet.diagnosers);
        let trial = attempt(&fleet, &real_time, &publishers, seconds)?;
        let carried = trial.is_carried();
        trials.push(trial);
        Ok(carried)
    };

    let seconds = options.seconds.unwrap_or(if quick { 10 } else { 60 });
    attempt(together(options.diagnosers.unwrap_or(AIM)), seconds)?;
    if options.diagnosers.is_none() {
        let short = if quick { 2 } else { 5 };
        let (carried, refused) = largest(|diagnosers| attempt(together(diagnosers), short))?;
        results.notes.push(format!(
            "Largest load without a missed instant in {short} s, all due at the same instant: {carried} diagnosers \
             ({refused} missed some)."
        ));
        let half = carried / 2;
        attempt(fleet(half, Sharing::Shared, Phases::Spread), short)?;
        attempt(fleet(half.min(AIM / 2), Sharing::Own, Phases::Together), short)?;
    }
    let first = &trials[0];
    results.findings.push(Finding::of(
        format!(
            "{} diagnosers at 100 Hz on one core for {seconds} s",
            first.fleet.diagnosers
        ),
        "no missed instant",
        format!(
            "{} of {} missed, step thread {} % of the core",
            first.counts.missed(),
            first.counts.steps + first.counts.skipped,
            significant(100.0 * first.step_thread)
        ),
        first.is_carried(),
    ));
    results.notes.push(format!(
        "In force: step thread {}; publishers on {}{}.",
        first.scheduling,
        publishers
            .core
            .map_or("any core".to_owned(), |core| format!("core {core}")),
        publishers.fifo.map_or(String::new(), |priority| format!(
            ", SCHED_FIFO {priority} if permitted"
        ))
    ));
    tables_of(&trials, &mut results);
    if options.diagnosers.is_none() {
        linearity(quick, &mut results)?;
    }
    Ok(results)
}

fn tables_of(trials: &[Trial], results: &mut Results) {
    let mut loads = Table::new(
        "Loads",
        &[
            "diagnosers",
            "inputs",
            "phases",
            "s",
            "missed",
            "steps/s",
            "samples/s",
            "inputs missing",
            "step thread, % of a core",
            "daemon, %",
            "memory, MiB",
            "KiB per diagnoser",
        ],
    );
    let mut lateness = Table::of_percentiles("Lateness of the steps", &["diagnosers", "inputs", "phases"]);
    let mut steps = Table::of_percentiles("Step times", &["diagnosers", "inputs", "phases"]);
    for trial in trials {
        let what = [
            trial.fleet.diagnosers.to_string(),
            format!("{:?}", trial.fleet.inputs).to_lowercase(),
            format!("{:?}", trial.fleet.phases).to_lowercase(),
        ];
        let rate = |count: u64| significant(count as f64 / trial.seconds);
        let numbers = [
            significant(trial.seconds),
            trial.counts.missed().to_string(),
            rate(trial.counts.steps),
            rate(trial.counts.samples),
            trial.counts.input_missing.to_string(),
            significant(100.0 * trial.step_thread),
            significant(100.0 * trial.daemon),
            significant(trial.resident as f64 / f64::from(1 << 20)),
            significant(trial.resident as f64 / 1024.0 / trial.fleet.diagnosers as f64),
        ];
        loads.row(what.iter().cloned().chain(numbers));
        for (table, times) in [
            (&mut lateness, trial.summary.lateness),
            (&mut steps, trial.summary.step_times),
        ] {
            table.percentiles(what.clone(), &times.into());
        }
        if trial.published.late_periods > 0 {
            results.notes.push(format!(
                "{} diagnosers: the publishers were late in {} periods, at worst {} behind the instant.",
                trial.fleet.diagnosers,
                trial.published.late_periods,
                duration(trial.published.longest_ns as f64)
            ));
        }
    }
    results.tables.extend([loads, lateness, steps]);
}

/// Processor time of a step against the number of diagnosers, on a simulated clock.
fn linearity(quick: bool, results: &mut Results) -> Result<()> {
    let kinds = Kinds::read()?;
    let mut table = Table::new(
        "Engine on a simulated clock: door, schedule, step, bounds table; processor time",
        &["diagnosers", "phases", "per step"],
    );
    let steps = if quick { 20_000 } else { 100_000 };
    let (mut curve, mut cheapest) = (Vec::new(), f64::INFINITY);
    let mut per_step_of = |diagnosers: usize, phases| -> Result<f64> {
        let fleet = FleetOptions {
            diagnosers,
            inputs: Sharing::Shared,
            phases,
        };
        let mut simulation = Simulation::new(&kinds, &fleet, false)?;
        simulation.run(20);
        let (periods, mut best) = ((steps / diagnosers).max(5), f64::INFINITY);
        for _ in 0..3 {
            simulation.busy = Duration::ZERO;
            simulation.run(periods as u64);
            best = best.min(simulation.busy.as_nanos() as f64 / (periods * diagnosers) as f64);
        }
        table.row([
            diagnosers.to_string(),
            format!("{phases:?}").to_lowercase(),
            duration(best),
        ]);
        Ok(best)
    };
    for diagnosers in [10, 50, 100, 200, 500, 1000, 2000] {
        let per_step = per_step_of(diagnosers, Phases::Together)?;
        cheapest = cheapest.min(per_step);
        curve.push((diagnosers as f64, per_step * diagnosers as f64 / 1e6));
    }
    per_step_of(1000, Phases::Spread)?;
    let per_step =
        |point: Option<&(f64, f64)>| point.map_or(f64::NAN, |(diagnosers, ms)| ms * 1e6 / diagnosers);
    let largest = per_step(curve.last());
    let beyond_cache = per_step(curve.iter().find(|(diagnosers, _)| *diagnosers == BEYOND_CACHE));
    results.findings.push(Finding::at_most(
        "cost linear: processor time of a step, 2,000 diagnosers against 200, whose states fill a cache",
        largest / beyond_cache,
        1.25,
        "×",
    ));
    results.findings.push(Finding::at_most(
        "the same against the best number of diagnosers, whose states lie in the cache",
        largest / cheapest,
        1.25,
        "×",
    ));
    results.tables.push(table);
    results.charts.push(Chart {
        file: "throughput-linear".to_owned(),
        title: "Time of one period of 10 ms".to_owned(),
        x: "diagnosers".to_owned(),
        y: "processor time, ms".to_owned(),
        curves: vec![
            ("measured".to_owned(), curve.clone()),
            (
                "linear".to_owned(),
                curve
                    .iter()
                    .map(|(diagnosers, _)| (*diagnosers, diagnosers * cheapest / 1e6))
                    .collect(),
            ),
        ],
    });
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_search_finds_the_largest_load_to_its_resolution() {
        for limit in [1, 37, 199, 200, 201, 1_234, 9_999] {
            let (carried, refused) = largest(|load| Ok(load <= limit)).unwrap();
            assert!(
                carried <= limit && limit < refused,
                "{limit}: {carried} {refused}"
            );
            assert!(
                (refused - carried) as f64 <= (RESOLUTION * refused as f64).max(1.0),
                "{carried} {refused}"
            );
        }
    }
}
