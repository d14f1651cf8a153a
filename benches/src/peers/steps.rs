//! Step times of all methods beside numpy, filterpy and Eigen, in turn.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, anyhow};

use super::agreement::agree;
use super::cases::{Case, Program};
use super::contender::Contender;
use super::environment::{Absent, Environment};
use super::timing::Times;
use crate::percentiles::{duration, significant};
use crate::results::{Finding, Results, Table};

/// Rounds that every comparison does, however long they take.
const LEAST_ROUNDS: usize = 7;

/// Flags of the baseline: the instruction set that residuald is compiled for.
const BASELINE: &str = "-march=x86-64";

/// Compares every case with its peers; each comparison takes `budget`, or what the least number of rounds takes.
///
/// # Errors
/// This side fails, or a peer that is there does not give the same numbers.
pub fn compare(environment: &Environment, budget: Duration, results: &mut Results) -> Result<()> {
    let mut table = Table::new(
        "Time of a step: from the samples to the finished record here, to the same numbers in a peer",
        &[
            "step",
            "who",
            "rounds x steps",
            "median",
            "best",
            "median / ours",
            "best / ours",
            "largest difference",
        ],
    );
    for case in super::cases::all()? {
        one(environment, budget, case, &mut table, results)?;
    }
    results.tables.push(table);
    results.notes.push(
        "A time is the processor time of a thread, as the mean over a run of some hundred steps; rounds of the contenders alternate, each after a run that \
         does not count, and the table has the median and the best of all rounds. A peer's step computes the compared \
         numbers only; residuald's step also checks its inputs and writes verdict, fault sets and the whole record. \
         Differences are relative to the largest entry of their column. numpy runs with one BLAS thread, which is the \
         faster setting for matrices of this size."
            .to_owned(),
    );
    Ok(())
}

fn one(
    environment: &Environment,
    budget: Duration,
    mut case: Case,
    table: &mut Table,
    results: &mut Results,
) -> Result<()> {
    let mut contenders = Vec::new();
    for (name, diagnoser, tolerance) in std::mem::take(&mut case.own) {
        contenders.push((name, Contender::Own(diagnoser), None, tolerance));
    }
    for (program, aim) in case.peers.clone() {
        match start(environment, &case, program) {
            Ok(command) => {
                let (name, contender) = Contender::start(command?)?;
                contenders.push((name, contender, aim, case.tolerance));
            }
            Err(absent) => {
                if let Some(aim) = aim {
                    let what = format!("{}, {} / ours", case.title, program.name());
                    results
                        .findings
                        .push(Finding::not_measured(what, format!("≥ {aim}"), "not installed"));
                }
                results.skip(format!("{} with {}", case.title, program.name()), absent);
            }
        }
    }
    let mut differences = vec![String::new()];
    let expected = contenders[0].1.outputs(&case)?;
    for (name, contender, _, tolerance) in contenders.iter_mut().skip(1) {
        let found = contender.outputs(&case)?;
        let difference =
            agree(&expected, &found, *tolerance).with_context(|| format!("{} beside {name}", case.title))?;
        differences.push(format!("{difference:.1e} (≤ {tolerance:.0e})"));
    }
    let mut times = vec![Times::default(); contenders.len()];
    let (begin, steps) = (Instant::now(), case.inputs.measurements.len());
    for round in 0.. {
        if round >= LEAST_ROUNDS && begin.elapsed() > budget {
            break;
        }
        for place in 0..contenders.len() {
            let place = (place + round) % times.len();
            let time = contenders[place].1.time(&case)?;
            times[place].add(time, steps);
        }
    }
    let (ours, our_best) = (times[0].median(), times[0].best());
    for (((name, _, aim, _), times), difference) in contenders.iter().zip(&times).zip(differences) {
        let ratio = times.median() / ours;
        table.row([
            case.title.clone(),
            name.clone(),
            format!("{} x {steps}", times.rounds()),
            duration(times.median()),
            duration(times.best()),
            significant(ratio),
            significant(times.best() / our_best),
            difference,
        ]);
        if let Some(aim) = aim {
            let what = format!("{}, {name} / ours", case.title);
            results.findings.push(Finding::at_least(what, ratio, *aim, ""));
        }
    }
    Ok(())
}

/// How to start a peer on a case; the outer error: it is not installed.
fn start(environment: &Environment, case: &Case, program: Program) -> Result<Result<Command>, Absent> {
    Ok(match program {
        Program::Python { script, package } => {
            let python = environment.python(package)?;
            problem_file(environment, case, script, &case.problem.to_string()).map(|problem| {
                let mut command = Command::new(python);
                for threads in ["OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"] {
                    command.env(threads, "1");
                }
                // What the peer writes beside its sources would be taken for sources.
                command.env("PYTHONDONTWRITEBYTECODE", "1");
                command
                    .arg(environment.sources.join("numpy").join(format!("{script}.py")))
                    .arg(problem);
                command
            })
        }
        Program::Eigen { source, native } => {
            let headers = environment.eigen()?;
            let architecture = if native { "-march=native" } else { BASELINE };
            compile(environment, source, architecture, &headers).and_then(|compiled| {
                let problem = problem_file(environment, case, source, &case.plain_problem())?;
                let mut command = Command::new(compiled);
                command.arg(problem).arg(format!("-O3 {architecture}"));
                Ok(command)
            })
        }
    })
}

fn problem_file(environment: &Environment, case: &Case, peer: &str, text: &str) -> Result<PathBuf> {
    let directory = environment.installed.join("problems");
    fs::create_dir_all(&directory).with_context(|| format!("{} cannot be made", directory.display()))?;
    let path = directory.join(format!("{}.{peer}", case.name));
    fs::write(&path, text).with_context(|| format!("{} cannot be written", path.display()))?;
    Ok(path)
}

fn compile(environment: &Environment, source: &str, architecture: &str, headers: &Path) -> Result<PathBuf> {
    let directory = environment.installed.join("eigen");
    fs::create_dir_all(&directory).with_context(|| format!("{} cannot be made", directory.display()))?;
    let program = directory.join(format!("{source}{architecture}"));
    let text = environment.sources.join("eigen").join(format!("{source}.cpp"));
    let changed = |path: &Path| fs::metadata(path).and_then(|metadata| metadata.modified()).ok();
    if changed(&program).is_some_and(|compiled| changed(&text).is_some_and(|written| written < compiled)) {
        return Ok(program);
    }
    let mut command = Command::new("g++");
    command
        .args(["-std=c++17", "-O3", "-DNDEBUG", architecture])
        .arg("-isystem")
        .arg(headers);
    command.arg(text).arg("-o").arg(&program);
    let output = command.output().context("g++ does not start")?;
    if !output.status.success() {
        return Err(anyhow!(
            "{command:?} failed: {}",
            String::from_utf8_lossy(&output.stderr)
        ));
    }
    Ok(program)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_implementations_in_numpy_agree_with_the_diagnosers() {
        let room = tempfile::tempdir().unwrap();
        let mut environment = Environment::find().unwrap();
        if let Err(absent) = environment.python("numpy") {
            eprintln!("left out: {absent}");
            return;
        }
        environment.installed = room.path().to_owned();
        for mut case in super::super::cases::all().unwrap() {
            let (_, diagnoser, _) = case.own.swap_remove(0);
            let expected = Contender::Own(diagnoser).outputs(&case).unwrap();
            for (program, _) in case.peers.clone() {
                // The interpreter of the virtual environment is not in this room; numpy alone is.
                let Program::Python { package: "numpy", .. } = program else {
                    continue;
                };
                let Ok(command) = start(&environment, &case, program) else {
                    continue;
                };
                let (_, mut peer) = Contender::start(command.unwrap()).unwrap();
                let found = peer.outputs(&case).unwrap();
                agree(&expected, &found, case.tolerance)
                    .unwrap_or_else(|error| panic!("{}: {error:#}", case.title));
                // A run is repeatable.
                assert_eq!(found, peer.outputs(&case).unwrap());
            }
        }
    }

    #[test]
    fn a_plain_problem_has_a_line_for_every_matrix() {
        let case = super::super::cases::all().unwrap().swap_remove(0);
        let text = case.plain_problem();
        let line = |name: &str| text.lines().find(|line| line.starts_with(name)).unwrap();
        let words = |name| line(name).split(' ').count();
        assert_eq!(
            (words("A 4 4 "), words("L_fix 4 3 "), words("centre 1 4 ")),
            (3 + 16, 3 + 12, 3 + 4)
        );
        let steps = case.inputs.measurements.len();
        assert_eq!(words(&format!("measurements {steps} 3 ")), 3 + 3 * steps);
    }
}
