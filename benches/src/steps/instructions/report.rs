//! Tables of `residual-bench instructions`.

use std::time::Duration;

use anyhow::{Context, Result};
use clap::Args;

use super::callgrind::Counted;
use super::operations::{Disassembly, Kind, Operations};
use super::peak::{Peak, peaks};
use super::table::STEPS;
use super::{WARM_UP_PERIODS, callgrind, formulas, operations};
use crate::percentiles::{Percentiles, duration, significant};
use crate::results::{Results, Table};
use crate::steps::{Case, cases, single};

/// Arguments of `instructions`.
#[derive(Args)]
pub struct Options {
    /// Only cases whose name contains this.
    #[arg(long, default_value = "")]
    only: String,
}

/// Counts instructions and floating-point operations, measures peaks, and compares.
///
/// # Errors
/// Valgrind or objdump fail, or a case cannot be designed.
pub fn run(options: &Options, quick: bool) -> Result<Results> {
    let about = "Instructions of one step, counted by callgrind, and the floating-point operations among them, by what \
                 stands at the addresses that were executed. The time that these operations would take at the peak rates of \
                 their classes (scalar, packed 128, packed 256 bit), divided by the measured time of a step (p50), is the \
                 achieved fraction. A multiply-add of a formula is two operations.";
    let mut results = Results::begin(
        "instructions",
        "Instructions and floating-point operations",
        about,
        quick,
    );
    let peaks = peaks(quick).unwrap_or_default();
    if peaks.is_empty() {
        results.skip("peak rates", "they are measured on x86-64 with AVX2 and FMA only");
    } else {
        results.tables.push(table_of_peaks(&peaks));
    }
    let Some(valgrind) = callgrind::valgrind() else {
        results.skip(
            "instructions of a step",
            "there is no valgrind; install it (Debian: `apt install valgrind`)",
        );
        return Ok(results);
    };
    let has_objdump = operations::is_available();
    if !has_objdump {
        results.skip(
            "floating-point operations",
            "there is no objdump; install it (Debian: `apt install binutils`)",
        );
    }
    let program = std::env::current_exe().context("this program's own path")?;
    let mut disassembly = Disassembly::default();
    let mut counts = Table::new("Instructions of a step", &COLUMNS);
    let mut dearest = Table::new(
        "Where the instructions are: the three dearest functions of each case, what they call left out",
        &["case", "first", "second", "third"],
    );
    let mut features = String::new();
    for case in cases().iter().filter(|case| case.name().contains(&options.only)) {
        if options.only.is_empty() && !is_counted(case, quick) {
            continue;
        }
        let warm_up = WARM_UP_PERIODS * STEPS;
        let counted = callgrind::count(&program, &case.name(), warm_up, STEPS, has_objdump)?;
        let operations = if has_objdump {
            disassembly.operations(&counted.executions)?
        } else {
            Operations::default()
        };
        let time = Duration::from_millis(if quick { 50 } else { 200 });
        let p50_ns = Percentiles::of(&single::measure(case, time)?).p50;
        counts.row(row(case, counted.per_step(), &operations, p50_ns, &peaks)?);
        dearest.row(std::iter::once(case.name()).chain(shares(&counted)));
        features = counted.child.features;
    }
    results.notes.push(format!(
        "{valgrind}; code that chooses its instructions at run time saw: {features}. Counts are means over one period of the \
         recording, {STEPS} steps; the same in every run. Callgrind's client gungraun would need a runner installed apart."
    ));
    results.tables.push(counts);
    results.tables.push(dearest);
    Ok(results)
}

/// Every mode with 4 states; in the long run also the whole methods with 2 and 6 states. Larger ones are designed too
/// slowly under valgrind.
fn is_counted(case: &Case, quick: bool) -> bool {
    let tenfold = case.generators.is_none_or(|order| order == 10 * case.states);
    let is_representative =
        case.is_default || matches!(case.mode, "fixed" | "row_wise" | "riccati" | "joint");
    match case.states {
        4 if quick => tenfold && is_representative && !is_designed_slowly(case),
        4 => true,
        2 | 6 => !quick && tenfold && is_representative && !is_designed_slowly(case),
        _ => false,
    }
}

fn is_designed_slowly(case: &Case) -> bool {
    case.method == "hinf_filter" && (case.states > 4 || case.is_default)
}

const COLUMNS: [&str; 12] = [
    "case",
    "instructions",
    "operations",
    "by formula",
    "executed / formula",
    "scalar",
    "packed 128",
    "packed 256",
    "divisions, roots",
    "p50",
    "instructions / ns",
    "achieved fraction of the peak",
];

fn row(
    case: &Case,
    instructions: f64,
    operations: &Operations,
    p50_ns: u64,
    peaks: &[Peak],
) -> Result<Vec<String>> {
    let per_step = |count: u64| count as f64 / STEPS as f64;
    let total = per_step(operations.total());
    let share = |count: u64| match operations.total() {
        0 => String::new(),
        all => format!("{} %", significant(100.0 * count as f64 / all as f64)),
    };
    let slow = |kind| {
        [1, 2, 4]
            .map(|lanes| operations.of(kind, lanes))
            .iter()
            .sum::<u64>()
    };
    let formula = formulas::operations(case, &case.watched()?);
    let fraction = at_peak_ns(operations, peaks).map(|time| time / STEPS as f64 / p50_ns as f64);
    let or_nothing = |value: Option<f64>| value.map_or(String::new(), significant);
    Ok(vec![
        case.name(),
        significant(instructions),
        significant(total),
        or_nothing(formula),
        or_nothing(formula.map(|formula| total / formula)),
        share(operations.on(1)),
        share(operations.on(2)),
        share(operations.on(4)),
        share(slow(Kind::Divide) + slow(Kind::Root)),
        duration(p50_ns as f64),
        significant(instructions / p50_ns as f64),
        fraction.map_or(String::new(), |fraction| {
            format!("{} %", significant(100.0 * fraction))
        }),
    ])
}

/// The three dearest functions and their parts.
fn shares(counted: &Counted) -> Vec<String> {
    let share = |(name, count): &(String, u64)| {
        let part = 100.0 * *count as f64 / counted.instructions as f64;
        format!("{} {} %", short(name), significant(part))
    };
    let mut shares: Vec<String> = counted.functions.iter().take(3).map(share).collect();
    shares.resize(3, String::new());
    shares
}

/// Type and name of a function without the modules above; as it is, where it has parameters of types.
fn short(function: &str) -> &str {
    if function.contains(['<', '{']) {
        return function.trim_start_matches("residual_diagnosis::");
    }
    match function.rmatch_indices("::").nth(1) {
        Some((place, separator)) => &function[place + separator.len()..],
        None => function,
    }
}

/// How long these operations take at the peak rate of their classes, nanoseconds.
fn at_peak_ns(operations: &Operations, peaks: &[Peak]) -> Option<f64> {
    let mut time = 0.0;
    for (&class, &count) in &operations.0 {
        let peak = peaks.iter().find(|peak| peak.class == class)?;
        time += count as f64 / peak.per_second * 1e9;
    }
    (!operations.0.is_empty()).then_some(time)
}

fn table_of_peaks(peaks: &[Peak]) -> Table {
    let columns = ["10⁹ operations a second", "scalar", "packed 128", "packed 256"];
    let mut table = Table::new("Peak rates of this processor, measured in registers", &columns);
    let kinds = [
        ("add, subtract, multiply", Kind::AddMultiply),
        ("fused multiply-add (two each)", Kind::Fused),
        ("divide", Kind::Divide),
        ("square root", Kind::Root),
    ];
    for (name, kind) in kinds {
        let rate = |lanes| peaks.iter().find(|peak| peak.class == (kind, lanes));
        let rates = [1, 2, 4]
            .map(|lanes| rate(lanes).map_or(String::new(), |peak| significant(peak.per_second / 1e9)));
        table.row(std::iter::once(name.to_owned()).chain(rates));
    }
    table
}
