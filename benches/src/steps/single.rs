//! `residual-bench steps`: single steps as percentiles, scaling curves, all diagnosers of the demonstration.

use std::time::{Duration, Instant};

use anyhow::Result;
use clap::Args;
use hdrhistogram::Histogram;

use super::stepper::Stepper;
use super::{Case, STATES, cases, engine};
use crate::percentiles::{Percentiles, duration, times};
use crate::results::{Chart, Finding, Results, Table};

/// The case of the aim on zonotopic filters.
const ZONOTOPIC: &str = "unknown_input_filter fixed n=4 s=40";

/// Arguments of `steps`.
#[derive(Args)]
pub struct Options {
    /// Only cases whose name contains this.
    #[arg(long, default_value = "")]
    only: String,
}

/// One case and how long its steps take.
struct Measured {
    case: Case,
    times: Percentiles,
}

/// Measures single steps of every case.
///
/// # Errors
/// A case cannot be designed.
pub fn run(options: &Options, quick: bool) -> Result<Results> {
    let about = "One step of every method in every mode, on random stable plants with 2, 4, 6 and 12 states: from the \
                 samples of an instant to the finished record. Every step is timed by itself, the cost of reading the \
                 clock included.";
    let mut results = Results::begin("steps", "Steps", about, quick);
    results.notes.push(format!(
        "Reading the clock twice with nothing in between: {}.",
        clock()?
    ));
    let time_each = Duration::from_millis(if quick { 60 } else { 400 });
    let mut measured = Vec::new();
    for case in cases()
        .into_iter()
        .filter(|case| case.name().contains(&options.only))
    {
        let times = Percentiles::of(&measure(&case, time_each)?);
        measured.push(Measured { case, times });
    }
    tables(&mut results, &measured);
    charts(&mut results, &measured);
    let zonotopic = measured.iter().find(|measured| measured.case.name() == ZONOTOPIC);
    if let Some(zonotopic) = zonotopic {
        let p50 = zonotopic.times.p50 as f64 / 1e3;
        let what = "step of one zonotopic filter, 4 states, 40 generators, fixed gain: p50";
        results.findings.push(Finding::at_most(what, p50, 1.0, "µs"));
    }
    if options.only.is_empty() {
        engine::all_five(&mut results, quick)?;
    }
    Ok(results)
}

/// Times of single steps of a case, once its sets and windows are full.
///
/// # Errors
/// The case cannot be designed.
pub fn measure(case: &Case, time: Duration) -> Result<Histogram<u64>> {
    let mut stepper = Stepper::new(case)?;
    stepper.steps(super::instructions::WARM_UP_PERIODS * stepper.period());
    let mut all = times();
    let begin = Instant::now();
    while begin.elapsed() < time {
        for _ in 0..stepper.period() {
            stepper.prepare();
            let before = Instant::now();
            stepper.step();
            all.record(before.elapsed().as_nanos() as u64)?;
        }
    }
    Ok(all)
}

fn clock() -> Result<String> {
    let mut all = times();
    for _ in 0..100_000 {
        let before = Instant::now();
        all.record(before.elapsed().as_nanos() as u64)?;
    }
    let times = Percentiles::of(&all);
    Ok(format!(
        "{} (p50), {} (p99)",
        duration(times.p50 as f64),
        duration(times.p99 as f64)
    ))
}

fn tables(results: &mut Results, measured: &[Measured]) {
    for of_method in measured.chunk_by(|a, b| a.case.method == b.case.method) {
        let columns = ["mode", "states", "generators"];
        let mut table = Table::of_percentiles(format!("Steps of {}", of_method[0].case.method), &columns);
        for Measured { case, times } in of_method {
            let generators = case.generators.map_or(String::new(), |order| order.to_string());
            table.percentiles([case.mode.to_owned(), case.states.to_string(), generators], times);
        }
        results.tables.push(table);
    }
}

/// Median over the number of states for each method; over the generators for the filters with 4 and 12 states.
fn charts(results: &mut Results, measured: &[Measured]) {
    for of_method in measured.chunk_by(|a, b| a.case.method == b.case.method) {
        let method = of_method[0].case.method;
        let tenfold = |case: &Case| case.generators.is_none_or(|order| order == 10 * case.states);
        let here = of_method.iter().filter(|measured| tenfold(&measured.case));
        let with = if method == "unknown_input_filter" {
            ", 10 generators a state"
        } else {
            ""
        };
        results.charts.push(Chart {
            file: format!("steps_{method}"),
            title: format!("Step of {method}{with}"),
            x: "states".to_owned(),
            y: "p50, µs".to_owned(),
            curves: curves(here, |case| case.states),
        });
    }
    for states in STATES {
        let here = (measured.iter()).filter(|measured| measured.case.states == states);
        let here = here.filter(|measured| measured.case.generators.is_some());
        let curves: Vec<_> = (curves(here, |case| case.generators.unwrap_or(0)).into_iter())
            .filter(|(_, points)| points.len() > 1)
            .collect();
        if !curves.is_empty() {
            results.charts.push(Chart {
                file: format!("steps_generators_{states}"),
                title: format!("Step of one zonotopic filter with {states} states"),
                x: "generators".to_owned(),
                y: "p50, µs".to_owned(),
                curves,
            });
        }
    }
}

/// One curve for each mode.
fn curves<'a>(
    measured: impl Iterator<Item = &'a Measured>,
    x: impl Fn(&Case) -> usize,
) -> Vec<(String, Vec<(f64, f64)>)> {
    let mut curves: Vec<(String, Vec<(f64, f64)>)> = Vec::new();
    for Measured { case, times } in measured {
        let point = (x(case) as f64, times.p50 as f64 / 1e3);
        match curves.iter_mut().find(|(mode, _)| mode == case.mode) {
            Some((_, points)) => points.push(point),
            None => curves.push((case.mode.to_owned(), vec![point])),
        }
    }
    curves
}
