//! `residual-bench soak`: memory and lateness of a daemon over a long time.

use std::thread::sleep;
use std::time::{Duration, Instant};

use anyhow::Result;
use clap::Args;

use super::fleet::{FleetOptions, Kinds, Phases, Sharing};
use super::simulated::Simulation;
use super::usage::resident_bytes;
use super::with_faults::with_faults;
use crate::percentiles::significant;
use crate::results::{Chart, Finding, Results, Table};

/// Steps after which memory shall not have grown.
const STEPS: u64 = 10_000_000;

/// Points of a series.
const POINTS: u64 = 60;

/// Arguments of `soak`.
#[derive(Clone, Debug, Args)]
pub struct SoakOptions {
    /// Seconds in real time.
    #[arg(long)]
    seconds: Option<u64>,
    /// Number of diagnosers.
    #[arg(long, default_value_t = 200)]
    diagnosers: usize,
    /// Core of the step thread.
    #[arg(long, default_value_t = 0)]
    core: usize,
}

/// Measures.
///
/// # Errors
/// A process does not run.
pub fn measure(options: &SoakOptions, quick: bool) -> Result<Results> {
    let mut results = Results::begin(
        "soak",
        "Long runs",
        "Two runs with faults that come and go in the plants, so that alarms are raised and cleared: the daemon in real \
         time, fed over iceoryx2, and, because 10⁷ steps take too long in real time, its engine with bounds table, \
         alarm ring and queue on a simulated clock. Slip is the part of the instants that were skipped or begun more \
         than one period late.",
        quick,
    );
    let seconds = options.seconds.unwrap_or(if quick { 10 } else { 120 });
    real_time(options, seconds, &mut results)?;
    simulated(if quick { STEPS / 20 } else { STEPS }, &mut results)?;
    Ok(results)
}

fn real_time(options: &SoakOptions, seconds: u64, results: &mut Results) -> Result<()> {
    let (daemon, publishers) = with_faults(options.diagnosers, options.core, "soak")?;
    sleep(Duration::from_secs(2));
    let (begin, first) = (Instant::now(), daemon.counts()?);
    let (mut memory, mut slip, mut before) = (Vec::new(), Vec::new(), first);
    for point in 0..=POINTS {
        let at = Duration::from_secs(seconds) * point as u32 / POINTS as u32;
        sleep(at.saturating_sub(begin.elapsed()));
        let now = daemon.counts()?;
        let gone = now.since(&before);
        let instants = (gone.steps + gone.skipped).max(1);
        memory.push((at.as_secs_f64(), mebibytes(resident_bytes(daemon.id())?)));
        slip.push((at.as_secs_f64(), 100.0 * gone.missed() as f64 / instants as f64));
        before = now;
    }
    let (all, alarms) = (before.since(&first), daemon.table().newest_alarm());
    publishers.stop()?;
    daemon.stop()?;
    let mut table = Table::new(
        "Daemon in real time",
        &[
            "diagnosers",
            "s",
            "steps",
            "missed",
            "samples",
            "alarm transitions",
            "memory at first, MiB",
            "at last",
        ],
    );
    let memory_of = |point: Option<&(f64, f64)>| significant(point.map_or(f64::NAN, |point| point.1));
    table.row([
        options.diagnosers.to_string(),
        seconds.to_string(),
        all.steps.to_string(),
        all.missed().to_string(),
        all.samples.to_string(),
        alarms.to_string(),
        memory_of(memory.first()),
        memory_of(memory.last()),
    ]);
    results.tables.push(table);
    results
        .findings
        .push(flat("memory of the daemon in real time", &memory));
    results.findings.push(Finding::of(
        format!("{} diagnosers at 100 Hz for {seconds} s", options.diagnosers),
        "no missed instant",
        format!("{} of {} missed", all.missed(), all.steps + all.skipped),
        all.missed() == 0,
    ));
    results.charts.push(chart(
        "soak-memory",
        "Memory of the daemon",
        ["time, s", "resident, MiB"],
        memory,
    ));
    results.charts.push(chart(
        "soak-slip",
        "Slip of the daemon",
        ["time, s", "missed instants, %"],
        slip,
    ));
    Ok(())
}

fn simulated(steps: u64, results: &mut Results) -> Result<()> {
    let fleet = FleetOptions {
        diagnosers: 100,
        inputs: Sharing::Shared,
        phases: Phases::Together,
    };
    let mut simulation = Simulation::new(&Kinds::read()?, &fleet, true)?;
    // One whole course with its fault: every buffer has been used to its end.
    simulation.run(1_100);
    let periods = steps / fleet.diagnosers as u64;
    let mut memory = Vec::new();
    for point in 0..=POINTS {
        memory.push((
            (point * steps / POINTS) as f64,
            mebibytes(resident_bytes(std::process::id())?),
        ));
        if point < POINTS {
            simulation.run(periods / POINTS);
        }
    }
    results.findings.push(flat(
        &format!("memory over {steps} steps on a simulated clock"),
        &memory,
    ));
    results.notes.push(format!(
        "On the simulated clock {} diagnosers did {steps} steps with {} transitions of alarms.",
        fleet.diagnosers, simulation.transitions
    ));
    results.charts.push(chart(
        "soak-memory-simulated",
        "Memory over steps on a simulated clock",
        ["steps", "resident, MiB"],
        memory,
    ));
    Ok(())
}

/// Whether memory has stayed within one percent of what it was.
fn flat(what: &str, memory: &[(f64, f64)]) -> Finding {
    let first = memory.first().map_or(f64::NAN, |point| point.1);
    let largest = memory.iter().fold(0.0_f64, |largest, point| largest.max(point.1));
    let grown = 100.0 * (largest - first) / first;
    Finding::of(
        what,
        "flat (within 1 %)",
        format!("{} MiB, {} %", significant(first), significant(grown)),
        grown <= 1.0,
    )
}

fn chart(file: &str, title: &str, axes: [&str; 2], points: Vec<(f64, f64)>) -> Chart {
    Chart {
        file: file.to_owned(),
        title: title.to_owned(),
        x: axes[0].to_owned(),
        y: axes[1].to_owned(),
        curves: vec![(axes[1].to_owned(), points)],
    }
}

fn mebibytes(bytes: u64) -> f64 {
    bytes as f64 / f64::from(1 << 20)
}
