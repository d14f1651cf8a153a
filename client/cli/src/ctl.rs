//! `residual ctl`: asks something of the daemon and shows the answer.

use std::io::{self, Write};
use std::path::Path;
use std::time::Duration;

use clap::{Args, Subcommand};
use comfy_table::{Table, presets};
use residual_client::{
    AlarmNumber, Alarms, Changes, Control, ControlCounters, DiagnoserDescription, InstanceName, Listing,
    Request, Response, Which,
};
use serde::Serialize;

use crate::arguments::EXIT_CODES;
use crate::entry;
use crate::error::Error;
use crate::instances;
use crate::until::seconds;

/// How long a checkpoint or a reload may take, unless told otherwise: a reload may have to find gains.
const LONG_TIMEOUT: Duration = Duration::from_secs(120);

/// What to ask, of whom.
#[derive(Debug, Args)]
pub struct ControlArguments {
    /// Name of the instance; may be left out if there is only one.
    #[arg(long, global = true, value_name = "NAME")]
    instance: Option<InstanceName>,
    /// Writes the answer as JSON.
    #[arg(long, global = true)]
    json: bool,
    /// Waits for the answer so many seconds: 5 unless given, 120 for `checkpoint` and `reload`.
    #[arg(long, global = true, value_name = "S", value_parser = seconds)]
    timeout: Option<Duration>,
    /// What to ask.
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
#[command(after_help = EXIT_CODES)]
enum Action {
    /// Shows the daemon and all its diagnosers.
    List,
    /// Shows all that is known of a diagnoser: schedule, signals, channels, faults, gains, counters.
    Describe {
        /// Its name.
        diagnoser: String,
    },
    /// Returns diagnosers to the state right after their start; the next record of each has the flag RESET.
    Reset(Diagnosers),
    /// Acknowledges alarms.
    Acknowledge(AlarmsOf),
    /// Saves the state of all diagnosers now.
    Checkpoint,
    /// Reads the configuration again; if anything is wrong with it, the daemon goes on with the one it has.
    Reload,
    /// Changes what the daemon logs, until it ends.
    SetLogLevel {
        /// A filter such as `debug` or `warn,residuald=debug`.
        filter: String,
    },
}

#[derive(Debug, Args)]
#[group(required = true, multiple = false)]
struct Diagnosers {
    /// The name of a diagnoser.
    diagnoser: Option<String>,
    /// All diagnosers.
    #[arg(long)]
    all: bool,
}

#[derive(Debug, Args)]
#[group(required = true, multiple = false)]
struct AlarmsOf {
    /// The name of a diagnoser.
    diagnoser: Option<String>,
    /// All diagnosers.
    #[arg(long)]
    all: bool,
    /// The alarm that this transition belongs to.
    #[arg(long, value_name = "EPOCH.NUMBER")]
    alarm: Option<AlarmNumber>,
}

/// Asks and shows the answer.
pub fn run(arguments: &ControlArguments, directory: &Path) -> Result<u8, Error> {
    let instance = instances::choose(arguments.instance.as_ref(), directory)?;
    let control = Control::connect(&instance)?;
    let control = match (arguments.timeout, &arguments.action) {
        (Some(timeout), _) => control.with_timeout(timeout),
        (None, Action::Checkpoint | Action::Reload) => control.with_timeout(LONG_TIMEOUT),
        (None, _) => control,
    };
    let response = ask(&control, &arguments.action)?;
    let mut output = io::stdout().lock();
    if arguments.json {
        write_json(&mut output, &response)?;
    } else {
        write_text(&mut output, &response)?;
    }
    Ok(0)
}

fn ask(control: &Control, action: &Action) -> Result<Response, Error> {
    let request = match action {
        // More than one request, where there are many diagnosers.
        Action::List => return Ok(Response::List(control.list()?)),
        Action::Describe { diagnoser } => Request::Describe {
            diagnoser: diagnoser.clone(),
        },
        Action::Reset(diagnosers) => Request::Reset {
            which: diagnosers.diagnoser.clone().map_or(Which::All, Which::Diagnoser),
        },
        Action::Acknowledge(of) => Request::Acknowledge {
            alarms: match (of.alarm, &of.diagnoser) {
                (Some(number), _) => number.into(),
                (None, Some(diagnoser)) => Alarms::Diagnoser(diagnoser.clone()),
                (None, None) => Alarms::All,
            },
        },
        Action::Checkpoint => Request::Checkpoint,
        Action::Reload => Request::Reload,
        Action::SetLogLevel { filter } => Request::SetLogLevel {
            filter: filter.clone(),
        },
    };
    Ok(control.request(&request)?)
}

fn write_json(output: &mut impl Write, response: &Response) -> io::Result<()> {
    fn write<T: Serialize>(output: &mut impl Write, value: &T) -> io::Result<()> {
        serde_json::to_writer_pretty(&mut *output, value)?;
        writeln!(output)
    }
    match response {
        Response::List(listing) => write(output, listing),
        Response::Description(description) => write(output, description),
        Response::Reset { diagnosers } => write(output, &serde_json::json!({ "reset": diagnosers })),
        Response::Acknowledged { alarms } => write(output, &serde_json::json!({ "acknowledged": alarms })),
        Response::Checkpoint(outcome) => write(output, outcome),
        Response::Reload(outcome) => write(output, outcome),
        Response::LogLevel { before, now } => {
            write(output, &serde_json::json!({ "before": before, "now": now }))
        }
    }
}

fn write_text(output: &mut impl Write, response: &Response) -> io::Result<()> {
    match response {
        Response::List(listing) => write_listing(output, listing),
        Response::Description(description) => write_description(output, description),
        Response::Reset { diagnosers: 1 } => writeln!(output, "1 diagnoser is reset"),
        Response::Reset { diagnosers } => writeln!(output, "{diagnosers} diagnosers are reset"),
        Response::Acknowledged { alarms: 0 } => writeln!(output, "no alarm waited for it"),
        Response::Acknowledged { alarms: 1 } => writeln!(output, "1 alarm is acknowledged"),
        Response::Acknowledged { alarms } => writeln!(output, "{alarms} alarms are acknowledged"),
        Response::Checkpoint(outcome) => writeln!(
            output,
            "the state of {} diagnosers is in {} ({} bytes)",
            outcome.diagnosers, outcome.path, outcome.bytes
        ),
        Response::Reload(outcome) => {
            write_changes(output, "diagnosers", &outcome.diagnosers)?;
            write_changes(output, "inputs", &outcome.inputs)
        }
        Response::LogLevel { before, now } => writeln!(output, "the log shows `{now}` (before: `{before}`)"),
    }
}

/// What a reload changed: `diagnosers: 3 unchanged, changed a, added b, removed c`.
fn write_changes(output: &mut impl Write, what: &str, changes: &Changes) -> io::Result<()> {
    write!(output, "{what}: {} unchanged", changes.unchanged)?;
    for (how, names) in [
        ("changed", &changes.changed),
        ("added", &changes.added),
        ("removed", &changes.removed),
    ] {
        if !names.is_empty() {
            write!(output, ", {how} {}", names.join(" "))?;
        }
    }
    if changes.more > 0 {
        write!(output, ", and {} more", changes.more)?;
    }
    writeln!(output)
}

fn write_listing(output: &mut impl Write, listing: &Listing) -> io::Result<()> {
    let ControlCounters {
        answered,
        rejected,
        timed_out,
    } = listing.requests;
    writeln!(
        output,
        "instance {}: residuald {}, process {}, log `{}`",
        listing.instance, listing.program, listing.pid, listing.log
    )?;
    writeln!(
        output,
        "control requests: {answered} answered, {rejected} rejected, {timed_out} timed out"
    )?;
    let mut table = Table::new();
    table.load_style(presets::UTF8_FULL_CONDENSED);
    table.set_header(["diagnoser", "method", "period", "channels", "faults", "steps"]);
    for diagnoser in &listing.diagnosers {
        table.add_row([
            diagnoser.name.clone(),
            diagnoser.method.clone(),
            milliseconds(diagnoser.period_ns),
            diagnoser.channels.to_string(),
            diagnoser.faults.to_string(),
            diagnoser.steps.to_string(),
        ]);
    }
    writeln!(output, "{table}")
}

fn write_description(output: &mut impl Write, diagnoser: &DiagnoserDescription) -> io::Result<()> {
    let mut entry = |name: &str, value: &str| entry::write(output, name, value);
    entry("diagnoser", &diagnoser.name)?;
    entry("slot", &diagnoser.slot.to_string())?;
    entry("method", &diagnoser.method)?;
    entry("period", &milliseconds(diagnoser.period_ns))?;
    entry("phase", &milliseconds(diagnoser.phase_ns))?;
    entry("margin", &milliseconds(diagnoser.margin_ns))?;
    entry("priority", &diagnoser.priority.to_string())?;
    entry("measurements", &diagnoser.measurements.join(", "))?;
    entry("commands", &diagnoser.commands.join(", "))?;
    entry(
        "command delay",
        &format!("{} steps", diagnoser.command_delay_steps),
    )?;
    let channels = diagnoser
        .channels
        .iter()
        .map(|channel| match channel.unit.as_str() {
            "" => channel.name.clone(),
            unit => format!("{} [{unit}]", channel.name),
        });
    entry("channels", &channels.collect::<Vec<_>>().join(", "))?;
    entry("faults", &diagnoser.faults.join(", "))?;
    for (name, value) in &diagnoser.lifecycle {
        entry(name, value)?;
    }
    entry("gains", &diagnoser.gains)?;
    for (name, value) in &diagnoser.certificate {
        entry(name, value)?;
    }
    for warning in &diagnoser.warnings {
        entry("warning", warning)?;
    }
    for counter in &diagnoser.counters {
        entry(&counter.name.replace('_', " "), &counter.value.to_string())?;
    }
    Ok(())
}

fn milliseconds(nanoseconds: u64) -> String {
    format!("{} ms", nanoseconds as f64 / 1e6)
}
