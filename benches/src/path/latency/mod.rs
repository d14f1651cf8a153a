//! `latency`: from the sample and the sampling instant to readable bounds, with the real daemon.
//!
//! | process | what | under real-time scheduling |
//! |---|---|---|
//! | daemon | `residuald run`: the bank of three zonotopic filters of `deploy/config/vtol.toml`, margin 0 | core 1, SCHED_FIFO 50 |
//! | bare timer | `clock_nanosleep(TIMER_ABSTIME)` with the daemon's period, halfway between its instants | core 1, SCHED_FIFO 50 |
//! | publisher | both inputs, 200 µs ahead of each sampling instant | core 0, SCHED_FIFO 40 |
//! | client | reads the table without pause | core 0, SCHED_FIFO 30 |
//!
//! Daemon and bare timer wake in turn, so both see the same load on the same core.

use std::thread::sleep;
use std::time::Duration;

use anyhow::{Result, ensure};
use residuald::summary::Summary;

use super::stage::{STEP_CORE, STEP_PRIORITY, Stage, real_time_refusal, replaced};
use crate::percentiles::{Counts, Percentiles, duration, times_of};
use crate::results::{Finding, Results, Table};

pub mod client;
pub mod publisher;
pub mod timer;

const CONFIGURATION: &str = include_str!("../../../../deploy/config/vtol.toml");

/// From the publishing of a sample to its sampling instant.
const LEAD_NS: u64 = 200_000;

/// How long before a sampling instant, or one of the bare timer, a client under SCHED_FIFO begins to look.
const LOOK_AHEAD_NS: u64 = 100_000;

/// How long after an instant of the bare timer it goes on.
const LOOK_BEHIND_NS: u64 = 50_000;

/// Steps at the beginning that are not measured.
const WARM_UP_STEPS: u64 = 20;

/// Steps whose publishing times are kept in the shared words.
const SENT_WORDS: u64 = 1024;

/// What a process says when it is about to begin.
const READY: &str = "ready";

/// What bounds may take beyond the jitter of the timer and the step.
const ALLOWANCE_NS: u64 = 5_000;

/// The periods, and how long they are measured, quickly or fully, seconds.
const PERIODS_S: [(f64, f64, f64); 2] = [(0.001, 4.0, 12.0), (0.01, 8.0, 30.0)];

/// What `latency` takes.
#[derive(Clone, Debug, clap::Args)]
pub struct Options {
    /// Seconds of each of the four runs; default 12 and 30, with --quick 4 and 8.
    #[arg(long)]
    seconds: Option<f64>,
}

/// One run.
struct Measured {
    timer: Counts,
    seen: client::Seen,
    summary: Summary,
}

/// Where the shared words say when the samples of a step were published.
fn sent_word(step: u64) -> usize {
    (step % SENT_WORDS) as usize
}

/// Measures all runs.
///
/// # Errors
/// A process fails.
pub fn run(options: &Options, quick: bool) -> Result<Results> {
    let about = "One publisher, the daemon with one bank of zonotopic filters, one client that looks without pause, and \
                 a bare timer loop on the daemon's core halfway between its instants. The samples are published 200 µs \
                 before their sampling instant. *Bare timer* and *step start* are delays behind the instant; *bounds \
                 readable* ends when the client has read the record of the instant.";
    let mut results = Results::begin("latency", "From sample to bounds", about, quick);
    let refusal = real_time_refusal();
    if let Some(why) = &refusal {
        results.skip("latency under SCHED_FIFO on cores of its own", why);
    }
    let mut table = Table::of_percentiles("Times of one tick", &["scheduling", "period", "what"]);
    for is_real_time in [false, true] {
        if is_real_time && refusal.is_some() {
            continue;
        }
        for (period_s, quick_s, full_s) in PERIODS_S {
            let seconds = options.seconds.unwrap_or(if quick { quick_s } else { full_s });
            let measured = measure(is_real_time, period_s, seconds)?;
            let scheduling = if is_real_time {
                "SCHED_FIFO, pinned"
            } else {
                "usual"
            };
            let period = duration(period_s * 1e9);
            add_rows(&mut table, scheduling, &period, &measured);
            if is_real_time || refusal.is_some() {
                judge(&mut results, scheduling, &period, &measured);
            }
            remark(&mut results, scheduling, &period, &measured);
        }
    }
    results.tables.push(table);
    Ok(results)
}

fn measure(is_real_time: bool, period_s: f64, seconds: f64) -> Result<Measured> {
    let stage = Stage::open(SENT_WORDS as usize)?;
    let daemon = stage.start_daemon(&configuration(&stage, is_real_time, period_s)?)?;
    let start = |role| stage.start(role, is_real_time, &[]);
    let (mut publisher, mut client, mut timer) = (start("publisher")?, start("client")?, start("timer")?);
    for process in [&mut publisher, &mut client, &mut timer] {
        process.line()?;
    }
    sleep(Duration::from_secs_f64(seconds));
    client.ask_to_end();
    let seen: client::Seen = client.said()?;
    timer.ask_to_end();
    let timer_counts = timer.said()?;
    client.end()?;
    timer.end()?;
    publisher.end()?;
    let seen_records = seen_records(&seen);
    ensure!(
        seen_records as f64 > 0.1 * seconds / period_s,
        "only {seen_records} records in {seconds} s: the client or the publisher was kept from running"
    );
    Ok(Measured {
        timer: timer_counts,
        seen,
        summary: daemon.stop()?,
    })
}

fn seen_records(seen: &client::Seen) -> u64 {
    seen.since_instant.iter().map(|(_, count)| count).sum()
}

/// The example with this period, without margin, under this instance.
fn configuration(stage: &Stage, is_real_time: bool, period_s: f64) -> Result<String> {
    let directory = stage.directory().display();
    let mut text = CONFIGURATION.to_owned();
    let mut replace = |from: &str, to: String| {
        text = replaced(&text, from, &to)?;
        anyhow::Ok(())
    };
    replace(
        "instance = \"vtol\"",
        format!("instance = \"{}\"", stage.instance().name),
    )?;
    replace(
        "runtime_directory = \"/dev/shm\"",
        format!("runtime_directory = \"{directory}\""),
    )?;
    replace("log = \"info\"", "log = \"error\"".into())?;
    // The gains of the example hold for its period.
    replace("gains_file = \"vtol.gains.toml\"", String::new())?;
    replace("sample_time_s = 0.01 ", format!("sample_time_s = {period_s} "))?;
    replace("margin_s = 0.005 ", "margin_s = 0.0 ".into())?;
    if is_real_time {
        replace("# fifo_priority = 50", format!("fifo_priority = {STEP_PRIORITY}"))?;
        replace("# cpu = 1", format!("cpu = {STEP_CORE}"))?;
    }
    Ok(text)
}

fn add_rows(table: &mut Table, scheduling: &str, period: &str, measured: &Measured) {
    let mut row = |what: &str, percentiles: &Percentiles| {
        table.percentiles([scheduling, period, what], percentiles);
    };
    let of = |counts: &Counts| Percentiles::of(&times_of(counts));
    row("bare timer", &of(&measured.timer));
    row("step start", &measured.summary.lateness.into());
    row("step", &measured.summary.step_times.into());
    row("instant → bounds readable", &of(&measured.seen.since_instant));
    row(
        "sample published → bounds readable",
        &of(&measured.seen.since_published),
    );
}

fn judge(results: &mut Results, scheduling: &str, period: &str, measured: &Measured) {
    let timer = Percentiles::of(&times_of(&measured.timer));
    let readable = Percentiles::of(&times_of(&measured.seen.since_instant));
    let steps = &measured.summary.step_times;
    for (quantile, timer, step, readable) in [
        ("p50", timer.p50, steps.p50_ns, readable.p50),
        ("p99", timer.p99, steps.p99_ns, readable.p99),
    ] {
        results.findings.push(Finding::of(
            format!("sampling instant → bounds readable, {quantile}, every {period}, {scheduling}"),
            format!(
                "≤ {} (bare timer {} + step {} + {})",
                duration((timer + step + ALLOWANCE_NS) as f64),
                duration(timer as f64),
                duration(step as f64),
                duration(ALLOWANCE_NS as f64)
            ),
            duration(readable as f64),
            readable <= timer + step + ALLOWANCE_NS,
        ));
    }
}

fn remark(results: &mut Results, scheduling: &str, period: &str, measured: &Measured) {
    let client::Seen {
        without_samples,
        overtaken,
        ..
    } = measured.seen;
    if without_samples + overtaken > 0 {
        results.notes.push(format!(
            "{scheduling}, every {period}: {without_samples} records without their samples (not counted), {overtaken} \
             overwritten before the client saw them."
        ));
    }
}
