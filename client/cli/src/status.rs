//! `residual status`: everything once.

use std::io::{self, Write};

use comfy_table::{Cell, CellAlignment, ContentArrangement, Table, presets};
use residual_client::{InputCounters, Monitor};

use crate::error::{Error, NO_DAEMON};
use crate::snapshot::{Condition, DiagnoserView, Snapshot};

/// Exit code: a diagnoser reports a fault, or its alarm does.
const FAULT: u8 = 4;
/// Exit code: a diagnoser does not judge.
const NOT_JUDGED: u8 = 5;

/// Writes the status; gives the exit code.
pub fn run(monitor: &mut Monitor, json: bool) -> Result<u8, Error> {
    let Some(snapshot) = Snapshot::take(monitor)? else {
        return Ok(NO_DAEMON);
    };
    match write(&mut io::stdout().lock(), &snapshot, json) {
        // The reader of a pipe has seen enough; the exit code counts all the same.
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => {}
        outcome => outcome?,
    }
    Ok(exit_code(&snapshot))
}

fn write(output: &mut impl Write, snapshot: &Snapshot, json: bool) -> io::Result<()> {
    if json {
        serde_json::to_writer_pretty(&mut *output, snapshot)?;
        writeln!(output)?;
    } else {
        write_text(output, snapshot)?;
    }
    output.flush()
}

fn exit_code(snapshot: &Snapshot) -> u8 {
    let alarm = snapshot
        .diagnosers
        .iter()
        .any(|diagnoser| diagnoser.alarm.is_fault());
    let any = |condition| {
        snapshot
            .diagnosers
            .iter()
            .any(|diagnoser| diagnoser.condition == condition)
    };
    if snapshot.daemon != "running" {
        NO_DAEMON
    } else if alarm || any(Condition::Faulty) {
        FAULT
    } else if any(Condition::Unknown) {
        NOT_JUDGED
    } else {
        0
    }
}

fn write_text(output: &mut impl Write, snapshot: &Snapshot) -> io::Result<()> {
    let Snapshot {
        instance,
        daemon,
        pid,
        ..
    } = snapshot;
    writeln!(output, "instance {instance}: daemon {daemon}, process {pid}")?;
    if *daemon != "running" {
        writeln!(output, "This is the last that it left.")?;
    }
    if !snapshot.diagnosers.is_empty() {
        writeln!(output, "{}", diagnoser_table(&snapshot.diagnosers))?;
    }
    if !snapshot.inputs.is_empty() {
        writeln!(output, "{}", input_table(snapshot))?;
    }
    Ok(())
}

fn diagnoser_table(diagnosers: &[DiagnoserView]) -> Table {
    let mut table = new_table();
    table.set_header([
        "diagnoser",
        "freshness",
        "verdict",
        "faults",
        "alarm",
        "worst channel",
        "ratio",
        "step",
        "steps",
        "skipped",
        "overruns",
    ]);
    for diagnoser in diagnosers {
        let worst = diagnoser.worst_channel.as_ref();
        let count = |name| {
            number(
                diagnoser
                    .counters
                    .get(name)
                    .copied()
                    .unwrap_or_default()
                    .to_string(),
            )
        };
        let written = diagnoser.record > 0;
        table.add_row([
            Cell::new(&diagnoser.name),
            Cell::new(diagnoser.freshness),
            Cell::new(if written { diagnoser.verdict } else { "-" }),
            Cell::new(faults(diagnoser)),
            Cell::new(diagnoser.alarm.text()),
            Cell::new(worst.map_or("-", |channel| channel.name.as_str())),
            number(worst.map_or("-".into(), |channel| channel.ratio.short())),
            number(if written {
                diagnoser.step.to_string()
            } else {
                "-".into()
            }),
            count("steps"),
            count("skipped"),
            count("overruns"),
        ]);
    }
    table
}

fn input_table(snapshot: &Snapshot) -> Table {
    let mut table = new_table();
    let names = InputCounters::NAMES.iter().map(|name| name.replace('_', " "));
    table.set_header(["input".to_string()].into_iter().chain(names));
    for input in &snapshot.inputs {
        let counters = InputCounters::NAMES
            .iter()
            .map(|name| number(input.counters.get(name).copied().unwrap_or_default().to_string()));
        table.add_row([Cell::new(&input.name)].into_iter().chain(counters));
    }
    table
}

/// The certain faults; if none is certain, the possible ones with a question mark.
pub fn faults(diagnoser: &DiagnoserView) -> String {
    if !diagnoser.certainly_faulty.is_empty() {
        return diagnoser.certainly_faulty.join(", ");
    }
    let possible: Vec<_> = diagnoser
        .possibly_faulty
        .iter()
        .map(|name| format!("{name}?"))
        .collect();
    possible.join(", ")
}

fn new_table() -> Table {
    let mut table = Table::new();
    table
        .load_style(presets::UTF8_FULL_CONDENSED)
        .set_content_arrangement(ContentArrangement::Dynamic);
    table
}

fn number(text: String) -> Cell {
    Cell::new(text).set_alignment(CellAlignment::Right)
}
