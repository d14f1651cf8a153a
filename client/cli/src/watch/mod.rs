//! `residual watch`: every channel between its bounds, again and again.

mod alarm_log;
mod history;
mod interactive;
mod lines;
mod screen;
mod state;
mod view;

use std::io::{self, IsTerminal};

use clap::Args;
use residual_client::{AlarmEvent, AlarmListener, AlarmStart, Instance, Monitor};

use crate::error::Error;
use crate::snapshot::{DiagnoserView, Snapshot};

/// What to watch, how, and how long.
#[derive(Debug, Args)]
pub struct WatchOptions {
    /// Watches this diagnoser only; may be given several times.
    #[arg(long = "diagnoser", value_name = "NAME")]
    pub diagnosers: Vec<String>,
    /// Time between two looks, milliseconds.
    #[arg(long, value_name = "MS", default_value_t = 200, value_parser = clap::value_parser!(u64).range(1..=3_600_000))]
    pub interval: u64,
    /// Ends after so many looks, or lines.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub count: Option<u64>,
    /// Shows no colours, as does the environment variable NO_COLOR.
    #[arg(long)]
    pub no_color: bool,
}

/// Watches until the count is reached or the user ends it; gives the exit code.
pub fn run(instance: &Instance, options: &WatchOptions) -> Result<u8, Error> {
    let mut monitor = Monitor::open(instance)?;
    if let Some(snapshot) = Snapshot::take(&mut monitor)? {
        let known = || snapshot.diagnosers.iter().map(|diagnoser| diagnoser.name.clone());
        if let Some(name) = options
            .diagnosers
            .iter()
            .find(|name| known().all(|one| one != **name))
        {
            return Err(Error::NoSuchDiagnoser {
                name: name.clone(),
                known: known().collect(),
            });
        }
    }
    if io::stdout().is_terminal() {
        let alarms = AlarmListener::connect(instance, AlarmStart::Oldest);
        interactive::run(&mut monitor, alarms, options)
    } else {
        lines::run(&mut monitor, options)
    }
}

impl WatchOptions {
    /// Whether this diagnoser is watched.
    fn is_watched(&self, diagnoser: &DiagnoserView) -> bool {
        self.has_chosen(&diagnoser.name)
    }

    /// Whether this is of a watched diagnoser, or missing, so that it may be.
    fn is_heard(&self, event: &AlarmEvent) -> bool {
        match event {
            AlarmEvent::Transition(alarm) => alarm.diagnoser_name().is_none_or(|name| self.has_chosen(name)),
            _ => true,
        }
    }

    fn has_chosen(&self, diagnoser: &str) -> bool {
        self.diagnosers.is_empty() || self.diagnosers.iter().any(|name| name == diagnoser)
    }

    /// Whether colours may be shown (<https://no-color.org>).
    fn has_colour(&self) -> bool {
        !self.no_color && std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty())
    }
}
