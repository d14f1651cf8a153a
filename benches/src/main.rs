//! `residual-bench`: measures residuald as its users meet it, in processes, with percentiles and peers in the same run.

use std::path::{Path, PathBuf};
use std::process::{Command as Program, ExitCode, Stdio};

use anyhow::{Context, Result};
use clap::{Args, Parser, Subcommand};
use residual_benches::report;
use residual_benches::results::Results;

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
    /// Measures everything and writes REPORT.md with its charts.
    Report(ReportOptions),
    /// temporary
    Sim { #[command(flatten)] fleet: residual_benches::load::fleet::FleetOptions, #[arg(long, default_value_t = 200)] periods: u64, #[arg(long)] faults: bool },
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
const MEASUREMENTS: [&str; 0] = [];

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
        Command::Report(options) => write_report(options, common),
        Command::Sim { fleet, periods, faults } => {
            let kinds = residual_benches::load::fleet::Kinds::read()?;
            let begin = std::time::Instant::now();
            let mut simulation = residual_benches::load::simulated::Simulation::new(&kinds, fleet, *faults)?;
            eprintln!("made in {:?}", begin.elapsed());
            simulation.run(20);
            simulation.busy = std::time::Duration::ZERO;
            simulation.run(*periods);
            let steps = periods * fleet.diagnosers as u64;
            println!("{} ns a step, digest {:x}, transitions {}", simulation.busy.as_nanos() as u64 / steps, simulation.digest, simulation.transitions);
            Ok(())
        }
    }
}

/// Saves and prints what a subcommand has measured.
#[expect(dead_code, reason = "no subcommand yet")]
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

fn measure(name: &str, common: &Common) -> Result<()> {
    eprintln!("== {name}");
    forget(&common.results, name);
    let mut program = Program::new(std::env::current_exe().context("this program's own path")?);
    program.arg(name).arg("--results").arg(&common.results);
    if common.quick {
        program.arg("--quick");
    }
    let status = program.stdout(Stdio::null()).status()?;
    anyhow::ensure!(status.success(), "it ended with {status}");
    Ok(())
}

/// Removes earlier results, so that a failure is not covered by them.
fn forget(directory: &Path, name: &str) {
    // There may be none.
    let _ = std::fs::remove_file(directory.join(format!("{name}.json")));
}
