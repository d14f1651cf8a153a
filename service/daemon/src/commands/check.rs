//! `residuald check`: what a configuration means, or what is wrong with it.

use super::achieved::summary;
use super::descriptions::signals;
use super::lifecycle::lifecycle;
use super::lines::Lines;
use crate::configuration::{
    Configuration, DaemonSection, DiagnoserConfiguration, InputConfiguration, RealtimeSection,
};
use miette::IntoDiagnostic;
use nix::sys::statfs::{TMPFS_MAGIC, statfs};
use residual_diagnosis::achieved::Achieved;
use residual_diagnosis::method::Designed;
use std::io::Write;
use std::path::Path;

/// Checks the configuration file and constructs its diagnosers; the report goes to `output`.
///
/// # Errors
/// Everything that is wrong with the configuration, or a failure to write.
pub fn execute(path: &Path, output: &mut dyn Write) -> miette::Result<()> {
    let loaded = Configuration::from_file(path)?;
    let diagnosers = loaded.build_diagnosers()?;
    let report = report(&loaded.configuration, &diagnosers);
    output.write_all(report.as_bytes()).into_diagnostic()
}

/// The report on a configuration that is in order.
fn report(configuration: &Configuration, diagnosers: &[Designed]) -> String {
    let mut lines = Lines::default();
    daemon(&mut lines, &configuration.daemon);
    realtime(&mut lines, configuration.realtime);
    for input in &configuration.inputs {
        self::input(&mut lines, input);
    }
    for (diagnoser, built) in configuration.diagnosers.iter().zip(diagnosers) {
        self::diagnoser(&mut lines, diagnoser, built, &configuration.inputs);
    }
    if let Some(replay) = &configuration.replay {
        lines.heading(format!("replay by the column `{}`", replay.time_column));
        for feed in &replay.inputs {
            lines.entry(&configuration.inputs[feed.input].name, feed.values.join(", "));
        }
    }
    let warnings = configuration
        .warnings()
        .into_iter()
        .chain(system_warnings(configuration));
    for warning in warnings {
        lines.warning(&warning);
    }
    let count = lines.warnings;
    lines.heading(match count {
        0 => "in order".to_owned(),
        1 => "in order, 1 warning".to_owned(),
        more => format!("in order, {more} warnings"),
    });
    lines.text
}

fn daemon(lines: &mut Lines, daemon: &DaemonSection) {
    let instance = daemon.instance();
    lines.heading(format!("instance {}", daemon.instance));
    let group = daemon
        .group
        .map_or("the daemon's group".to_owned(), |group| format!("group {group}"));
    let table = format!(
        "{}, mode {:04o}, {group}",
        instance.bounds_path().display(),
        daemon.mode
    );
    lines.entry("bounds table", table);
    lines.entry("stale after", format!("{} periods", daemon.stale_after_periods));
    lines.entry("catch-up limit", format!("{} steps", daemon.catch_up_limit));
    lines.entry("record queue", format!("{} records", daemon.record_queue));
    lines.entry("alarm ring", format!("{} transitions", daemon.alarm_capacity));
    if let Some(path) = &daemon.checkpoint_file {
        let when = match daemon.checkpoint_period_ns {
            Some(period_ns) => format!("every {} s and at the stop", period_ns as f64 * 1e-9),
            None => "at the stop".to_owned(),
        };
        lines.entry("checkpoint", format!("{}, {when}", path.display()));
    }
    lines.entry("log", &daemon.log);
    lines.entry(
        "gains",
        match &daemon.gains_file {
            Some(path) => format!("from {}, verified", path.display()),
            None => "designed now; `residuald design` writes them to a file".to_owned(),
        },
    );
}

fn realtime(lines: &mut Lines, realtime: RealtimeSection) {
    let scheduling = realtime
        .fifo_priority
        .map_or("usual scheduling".to_owned(), |priority| {
            format!("SCHED_FIFO {priority}")
        });
    let cpu = realtime
        .cpu
        .map_or("any processor".to_owned(), |cpu| format!("processor {cpu}"));
    let memory = if realtime.lock_memory {
        "memory locked"
    } else {
        "memory not locked"
    };
    lines.entry("step thread", format!("{scheduling}, {cpu}, {memory}"));
}

fn input(lines: &mut Lines, input: &InputConfiguration) {
    lines.heading(format!("input {}", input.name));
    let signal = |(name, unit): (&String, &String)| {
        if unit.is_empty() {
            name.clone()
        } else {
            format!("{name} [{unit}]")
        }
    };
    let signals: Vec<_> = input.signals.iter().zip(&input.units).map(signal).collect();
    lines.entry("signals", signals.join(", "));
    lines.entry("buffer", format!("{} samples", input.buffer_samples));
    lines.entry(
        "accepted",
        format!("up to {} ahead", duration(input.max_ahead_ns)),
    );
    lines.entry("publishers", format!("up to {}", input.max_publishers));
}

fn diagnoser(
    lines: &mut Lines,
    diagnoser: &DiagnoserConfiguration,
    built: &Designed,
    inputs: &[InputConfiguration],
) {
    let description = built.diagnoser.description();
    lines.heading(format!("diagnoser {}", diagnoser.name));
    lines.entry("method", description.method);
    lines.entry(
        "schedule",
        format!(
            "period {}, phase {}, margin {}, priority {}",
            duration(diagnoser.period_ns),
            duration(diagnoser.phase_ns),
            duration(diagnoser.margin_ns),
            diagnoser.priority
        ),
    );
    lines.entry(
        "measurements",
        signals(&diagnoser.measurements, inputs).join(", "),
    );
    let delay = match diagnoser.command_delay_steps {
        0 => String::new(),
        steps => format!(" (acting {steps} steps later)"),
    };
    lines.entry(
        "commands",
        signals(&diagnoser.commands, inputs).join(", ") + &delay,
    );
    lines.entry("faults", description.faults.join(", "));
    for (name, value) in &built.notes {
        lines.entry(name, value);
    }
    achieved(lines, &built.achieved);
    for (name, value) in lifecycle(diagnoser, &built.achieved, inputs) {
        lines.entry(name, value);
    }
    let channels: Vec<_> = description
        .channels
        .iter()
        .map(|channel| channel.name.as_str())
        .collect();
    lines.entry(&format!("{} channels", channels.len()), channels.join(", "));
    for warning in &built.warnings {
        lines.warning(warning);
    }
}

/// What the gains achieve, in short; `residuald explain` says all of it.
fn achieved(lines: &mut Lines, achieved: &Achieved) {
    for (name, value) in summary(achieved) {
        lines.entry(name, value);
    }
}

/// What this machine would not give to the daemon; another one may.
fn system_warnings(configuration: &Configuration) -> Vec<String> {
    let mut warnings = Vec::new();
    let directory = &configuration.daemon.runtime_directory;
    match statfs(directory.as_path()) {
        Ok(status) if status.filesystem_type() == TMPFS_MAGIC => {}
        Ok(_) => warnings.push(format!(
            "{} is not on a tmpfs: writing to a disk would disturb the schedule",
            directory.display()
        )),
        Err(error) => {
            warnings.push(format!(
                "{} cannot be used on this machine: {}",
                directory.display(),
                error.desc()
            ));
        }
    }
    let processors = std::thread::available_parallelism().map_or(1, usize::from);
    if let Some(cpu) = configuration.realtime.cpu.filter(|&cpu| cpu >= processors) {
        warnings.push(format!(
            "this machine has {processors} processors, counted from 0, but not number {cpu}"
        ));
    }
    warnings
}

/// Nanoseconds in the largest unit that leaves a number of at least 1.
pub(super) fn duration(nanoseconds: u64) -> String {
    let value = nanoseconds as f64;
    match nanoseconds {
        0 => "0 s".to_owned(),
        1_000_000_000.. => format!("{} s", value * 1e-9),
        1_000_000.. => format!("{} ms", value / 1e6),
        1_000.. => format!("{} µs", value / 1e3),
        _ => format!("{nanoseconds} ns"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_are_written_in_a_fitting_unit() {
        let written = [0, 250, 10_000, 2_500_000, 1_000_000_000].map(duration);
        assert_eq!(written, ["0 s", "250 ns", "10 µs", "2.5 ms", "1 s"]);
    }
}
