//! `residual-bench steady`: what the step thread of a running daemon asks of the kernel, and what it allocates.

use std::collections::BTreeMap;
use std::fs;
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::Duration;

use anyhow::Result;
use clap::Args;
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

use super::daemon::Daemon;
use super::fleet::PERIOD_NS;
use super::usage::Usage;
use super::with_faults::with_faults;
use crate::percentiles::significant;
use crate::results::{Finding, Results, Table};

/// Arguments of `steady`.
#[derive(Clone, Debug, Args)]
pub struct SteadyOptions {
    /// Number of diagnosers.
    #[arg(long, default_value_t = 50)]
    diagnosers: usize,
    /// Seconds of each observation.
    #[arg(long)]
    seconds: Option<u64>,
    /// Core of the step thread.
    #[arg(long, default_value_t = 0)]
    core: usize,
}

/// Measures.
///
/// # Errors
/// A process does not run.
pub fn measure(options: &SteadyOptions, quick: bool) -> Result<Results> {
    let mut results = Results::begin(
        "steady",
        "Steady state",
        "The daemon with diagnosers of all five methods at 100 Hz, fed over iceoryx2, 3 s after its start: page faults of \
         the step thread from /proc, its system calls from strace, both while faults come and go in the plants. A tick is \
         a sampling period of 10 ms, at which all diagnosers are due.",
        quick,
    );
    let seconds = options.seconds.unwrap_or(if quick { 12 } else { 30 });
    let (daemon, publishers) = with_faults(options.diagnosers, options.core, "steady")?;
    sleep(Duration::from_secs(3));

    let before = Usage::of_first_thread(daemon.id())?;
    sleep(Duration::from_secs(seconds));
    let used = Usage::of_first_thread(daemon.id())?.since(&before);
    results.findings.push(Finding::of(
        format!("page faults of the step thread in {seconds} s"),
        "0",
        format!("{} minor, {} major", used.minor_faults, used.major_faults),
        used.minor_faults + used.major_faults == 0,
    ));
    results
        .notes
        .push(format!("In force: step thread {}.", daemon.scheduling()));
    system_calls(&daemon, seconds, &mut results)?;
    publishers.stop()?;
    daemon.stop()?;
    results.findings.push(Finding::not_measured(
        "allocations of the step thread",
        "0",
        "asserted by the test `no_allocation` of residuald with a counting allocator",
    ));
    Ok(results)
}

/// Counts the system calls of the step thread by their names.
fn system_calls(daemon: &Daemon, seconds: u64, results: &mut Results) -> Result<()> {
    const AIM: &str = "the wait, and one wake-up for each transition of an alarm";
    let what = "system calls of the step thread per tick";
    let file = tempfile::NamedTempFile::new()?;
    let mut strace = Command::new("strace");
    strace
        .args(["-c", "-o"])
        .arg(file.path())
        .arg("-p")
        .arg(daemon.id().to_string());
    let alarms = daemon.table().newest_alarm();
    let mut tracer = match strace.stdin(Stdio::null()).stderr(Stdio::null()).spawn() {
        Ok(tracer) => tracer,
        Err(error) => {
            results.skip(what, format!("strace does not start ({error}); install it"));
            results
                .findings
                .push(Finding::not_measured(what, AIM, "no strace"));
            return Ok(());
        }
    };
    sleep(Duration::from_secs(seconds));
    kill(Pid::from_raw(tracer.id().cast_signed()), Signal::SIGINT)?;
    tracer.wait()?;
    let transitions = daemon.table().newest_alarm() - alarms;
    let counts = parse(&fs::read_to_string(file.path())?);
    if counts.is_empty() {
        results.skip(
            what,
            "strace may not trace the daemon: run as its user, with ptrace permitted",
        );
        results
            .findings
            .push(Finding::not_measured(what, AIM, "strace saw nothing"));
        return Ok(());
    }
    let ticks = seconds as f64 * 1e9 / PERIOD_NS as f64;
    let mut table = Table::new(
        format!(
            "System calls of the step thread in {seconds} s ({ticks} ticks, {transitions} transitions of alarms)"
        ),
        &["system call", "count", "per tick", "per transition"],
    );
    let per = |count: u64, of: f64| {
        if of > 0.0 {
            significant(count as f64 / of)
        } else {
            "–".to_owned()
        }
    };
    for (name, count) in &counts {
        table.row([
            name.clone(),
            count.to_string(),
            per(*count, ticks),
            per(*count, transitions as f64),
        ]);
    }
    results.tables.push(table);
    let of = |name: &str| counts.get(name).copied().unwrap_or(0);
    let (waits, wakes) = (of("clock_nanosleep"), of("futex"));
    let others = counts.values().sum::<u64>() - waits - wakes;
    // The call in which the tracer finds the thread is begun anew.
    let met = waits as f64 <= 1.02 * ticks + 12.0 && wakes <= transitions + 2 && others <= 2;
    results.findings.push(Finding::of(
        what,
        AIM,
        format!(
            "{} waits a tick, {wakes} wake-ups for {transitions} transitions, {others} others",
            significant(waits as f64 / ticks)
        ),
        met,
    ));
    Ok(())
}

/// Counts by name in a summary of `strace -c`.
fn parse(summary: &str) -> BTreeMap<String, u64> {
    let row = |line: &str| {
        let cells: Vec<&str> = line.split_whitespace().collect();
        let (name, calls) = (*cells.last()?, *cells.get(3)?);
        let is_row = cells.len() >= 5 && name != "total" && cells[0].parse::<f64>().is_ok();
        Some((name.to_owned(), calls.parse().ok().filter(|_| is_row)?))
    };
    summary.lines().filter_map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_read_from_a_summary_with_and_without_errors() {
        let summary = "% time     seconds  usecs/call     calls    errors syscall\n\
            ------ ----------- ----------- --------- --------- ----------------\n \
            90.00    0.010000          10      1000           clock_nanosleep\n \
            10.00    0.001000          10        12         3 futex\n\
            ------ ----------- ----------- --------- --------- ----------------\n\
            100.00    0.011000                  1012         3 total\n";
        let counts = parse(summary);
        assert_eq!(counts.len(), 2, "{counts:?}");
        assert_eq!((counts["clock_nanosleep"], counts["futex"]), (1000, 12));
    }
}
