//! `residual-bench`: measures residuald as its users meet it, in processes, with percentiles and peers in the same run.

use std::collections::VecDeque;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command as Program, ExitCode, Stdio};

use anyhow::{Context, Result};
use clap::{Args, Parser, Subcommand};
use residual_benches::load::{daemon, publishers, replay, simulated, soak, steady, throughput};
use residual_benches::path::{alarm, latency, read, role, write};
use residual_benches::results::Results;
use residual_benches::steps::{instructions, single};
use residual_benches::{peers, report};

/// How fast a step is, how late a bound, how soon an alarm, how many diagnosers fit on a core.
#[derive(Parser)]
#[command(name = "residual-bench", version)]
struct Arguments {
    #[command(flatten)]
    common: Common,
    #[command(subcommand)]
    command: Command,
}

/// Arguments of all subcommands.
#[derive(Args)]
struct Common {
    /// Fewer rounds: numbers for orientation.
    #[arg(long, global = true)]
    quick: bool,
    /// Directory of the results, one JSON file for each subcommand.
    #[arg(long, global = true, default_value = "target/residual-bench")]
    results: PathBuf,
}

#[derive(Subcommand)]
enum Command {
    /// Step times, sample latency and records beside other programs.
    Peers(peers::Options),
    /// Sends samples back, for `peers`.
    #[command(hide = true)]
    SampleEcho(peers::samples::own::EchoOptions),
    /// Measures everything and writes REPORT.md with its charts.
    Report(ReportOptions),
    /// From sample and sampling instant to readable bounds, beside a bare timer loop.
    Latency(latency::Options),
    /// From alarm to awake consumer, beside a bare futex and a bare iceoryx2 event.
    Alarm(alarm::Options),
    /// Reading bounds with 1 to 64 readers, beside an iceoryx2 blackboard.
    Read(read::Options),
    /// Writing records and alarms with 0 to 64 clients.
    Write(write::Options),
    /// A process of one of these measurements.
    #[command(subcommand, hide = true)]
    Path(role::Role),
    /// Times single steps of every method in every mode.
    Steps(single::Options),
    /// Counts instructions and floating-point operations of steps.
    Instructions(instructions::Options),
    /// Steps one case; what `instructions` counts.
    #[command(hide = true)]
    StepCase(instructions::ChildOptions),
    /// How many diagnosers of all methods one core carries at 100 Hz.
    Throughput(throughput::ThroughputOptions),
    /// Memory and missed instants of a daemon over a long time.
    Soak(soak::SoakOptions),
    /// Page faults and system calls of a running daemon's step thread.
    Steady(steady::SteadyOptions),
    /// Recordings of all methods against real time.
    Replay,
    #[command(hide = true)]
    LoadDaemon(daemon::DaemonRole),
    #[command(hide = true)]
    LoadPublisher(publishers::PublisherRole),
    #[command(hide = true)]
    LoadSimulated(simulated::SimulatedRole),
    #[command(hide = true)]
    LoadReplay(replay::ReplayRole),
}

/// Arguments of `report`.
#[derive(Args)]
struct ReportOptions {
    /// Writes the report of results that are there already; measures nothing.
    #[arg(long)]
    only_write: bool,
    /// Directory of the report.
    #[arg(long, default_value = "benches")]
    directory: PathBuf,
}

/// The subcommands of a report, in its order.
const MEASUREMENTS: [&str; 11] = [
    "steps",
    "instructions",
    "latency",
    "alarm",
    "read",
    "write",
    "throughput",
    "soak",
    "steady",
    "replay",
    "peers",
];

/// Lines of a failed measurement that the report shows.
const SHOWN_LINES: usize = 20;

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("residual-bench: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &Arguments) -> Result<()> {
    let common = &arguments.common;
    match &arguments.command {
        Command::SampleEcho(options) => peers::samples::own::echo(options),
        Command::Peers(options) => conclude(peers::run(options, common.quick)?, common),
        Command::Report(options) => write_report(options, common),
        Command::Latency(options) => conclude(latency::run(options, common.quick)?, common),
        Command::Alarm(options) => conclude(alarm::run(options, common.quick)?, common),
        Command::Read(options) => conclude(read::run(options, common.quick)?, common),
        Command::Write(options) => conclude(write::run(options, common.quick)?, common),
        Command::Path(role) => role::play(role),
        Command::Steps(options) => conclude(single::run(options, common.quick)?, common),
        Command::Instructions(options) => conclude(instructions::run(options, common.quick)?, common),
        Command::StepCase(options) => instructions::run_child(options),
        Command::Throughput(options) => conclude(throughput::measure(options, common.quick)?, common),
        Command::Soak(options) => conclude(soak::measure(options, common.quick)?, common),
        Command::Steady(options) => conclude(steady::measure(options, common.quick)?, common),
        Command::Replay => conclude(replay::measure(common.quick)?, common),
        Command::LoadDaemon(role) => daemon::play(role),
        Command::LoadPublisher(role) => publishers::play(role),
        Command::LoadSimulated(role) => simulated::play(role),
        Command::LoadReplay(role) => replay::play(role),
    }
}

/// Saves and prints what a subcommand has measured.
fn conclude(results: Results, common: &Common) -> Result<()> {
    let results = results.save(&common.results)?;
    print!("{}", report::of_one(&results));
    Ok(())
}

/// Runs every measurement in a process of its own, so that one that fails does not take the others along.
fn write_report(options: &ReportOptions, common: &Common) -> Result<()> {
    let (mut all, mut failures) = (Vec::new(), Vec::new());
    for name in MEASUREMENTS {
        let measured = if options.only_write {
            Ok(())
        } else {
            measure(name, common)
        };
        match measured.and_then(|()| Results::load(&common.results, name)) {
            Ok(results) => all.push(results),
            Err(error) => failures.push((name.to_owned(), format!("{error:#}"))),
        }
    }
    report::write(&all, &failures, &options.directory)?;
    println!("{}", options.directory.join("REPORT.md").display());
    anyhow::ensure!(
        failures.is_empty(),
        "{} measurements failed: see the report",
        failures.len()
    );
    Ok(())
}

/// Runs one measurement; what it says on its standard error is shown, and its end is part of the error if it fails.
fn measure(name: &str, common: &Common) -> Result<()> {
    eprintln!("== {name}");
    forget(&common.results, name);
    let mut program = Program::new(std::env::current_exe().context("this program's own path")?);
    program.arg(name).arg("--results").arg(&common.results);
    if common.quick {
        program.arg("--quick");
    }
    let mut running = program.stdout(Stdio::null()).stderr(Stdio::piped()).spawn()?;
    let mut last_lines = VecDeque::new();
    for line in BufReader::new(running.stderr.take().context("no standard error")?).lines() {
        let line = line?;
        eprintln!("{line}");
        last_lines.push_back(line);
        if last_lines.len() > SHOWN_LINES {
            last_lines.pop_front();
        }
    }
    let status = running.wait()?;
    let last_lines = Vec::from(last_lines).join("\n");
    anyhow::ensure!(status.success(), "it ended with {status}\n{last_lines}");
    Ok(())
}

/// Removes earlier results, so that a failure is not covered by them.
fn forget(directory: &Path, name: &str) {
    // There may be none.
    let _ = std::fs::remove_file(directory.join(format!("{name}.json")));
}
