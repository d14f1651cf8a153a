//! `residual alarms`: the alarm transitions, those in the ring and those to come.

mod line;

use std::io::{self, Write};
use std::str::FromStr;
use std::time::Duration;

use clap::Args;
use clap::builder::PossibleValuesParser;
use residual_client::{
    AlarmEvent, AlarmListener, AlarmNumber, AlarmNumberError, AlarmStart, AlarmState, DaemonState, Instance,
    InstanceName,
};

use crate::error::{Error, NO_DAEMON};
pub use line::wall_clock;

/// How long one wait lasts; nothing depends on it, events end it.
const WAIT: Duration = Duration::from_secs(1);

/// Which alarm transitions to show.
#[derive(Debug, Args)]
pub struct AlarmOptions {
    /// Name of the instance; may be left out if there is only one.
    #[arg(long, value_name = "NAME")]
    pub instance: Option<InstanceName>,
    /// Begins behind this transition: `EPOCH.NUMBER`, as the lines show it. `oldest`: with the oldest one that the
    /// daemon still keeps; `now`: with the next one.
    #[arg(long, value_name = "EPOCH.NUMBER|oldest|now", default_value = "oldest")]
    pub since: Since,
    /// Goes on with every transition as it comes, over restarts of the daemon, until Ctrl-C.
    #[arg(long, short)]
    pub follow: bool,
    /// Shows the transitions of this diagnoser only; may be given several times. Gaps are shown all the same.
    #[arg(long = "diagnoser", value_name = "NAME")]
    pub diagnosers: Vec<String>,
    /// Shows transitions to this state only; may be given several times. Gaps are shown all the same.
    #[arg(long = "state", value_name = "STATE", value_parser = PossibleValuesParser::new(STATES))]
    pub states: Vec<String>,
    /// Writes one JSON object a line. A number that is not one (NaN) is null; infinite numbers are the strings "inf"
    /// and "-inf".
    #[arg(long)]
    pub json: bool,
    /// Ends after so many lines.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub count: Option<u64>,
}

const STATES: [&str; 4] = [
    AlarmState::Cleared.name(),
    AlarmState::Pending.name(),
    AlarmState::Raised.name(),
    AlarmState::Isolated.name(),
];

/// Where to begin.
#[derive(Clone, Copy, Debug)]
pub struct Since(AlarmStart);

impl FromStr for Since {
    type Err = AlarmNumberError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        Ok(Self(match text {
            "oldest" => AlarmStart::Oldest,
            "now" => AlarmStart::Now,
            number => AlarmStart::After(number.parse::<AlarmNumber>()?),
        }))
    }
}

/// Writes the transitions; gives the exit code.
pub fn run(instance: &Instance, options: &AlarmOptions) -> Result<u8, Error> {
    let mut listener = AlarmListener::open(instance, options.since.0)?;
    options.check(&listener)?;
    let mut output = io::stdout().lock();
    let mut left = options.count.unwrap_or(u64::MAX);
    while left > 0 {
        let event = match listener.try_next() {
            Some(event) => event,
            None if !options.follow => break,
            None => {
                output.flush()?;
                let Some(event) = listener.wait(WAIT) else {
                    continue;
                };
                event
            }
        };
        if options.shows(&event) {
            line::write(&mut output, &event, options.json)?;
            left -= 1;
        }
    }
    output.flush()?;
    // Whoever follows has chosen the end; otherwise it counts whether these are all the alarms there can be.
    let is_running = matches!(listener.state(), DaemonState::Running);
    let is_empty = left == options.count.unwrap_or(u64::MAX);
    match (is_running, is_empty) {
        (true, false) => {}
        (true, true) => eprintln!("residual: the daemon runs and has no such alarm transition"),
        (false, false) => eprintln!("residual: the daemon does not run; these are transitions that it left"),
        (false, true) => {
            eprintln!("residual: the daemon does not run, and has left no such alarm transition")
        }
    }
    Ok(if is_running || options.follow {
        0
    } else {
        NO_DAEMON
    })
}

impl AlarmOptions {
    /// Refuses the names of diagnosers that the daemon does not have.
    fn check(&self, listener: &AlarmListener) -> Result<(), Error> {
        let slots = listener.table().map(|table| &table.directory().spec.slots);
        let known: Vec<_> = slots
            .into_iter()
            .flatten()
            .map(|slot| slot.name.clone())
            .collect();
        match self.diagnosers.iter().find(|name| !known.contains(name)) {
            Some(name) => Err(Error::NoSuchDiagnoser {
                name: name.clone(),
                known,
            }),
            None => Ok(()),
        }
    }

    fn shows(&self, event: &AlarmEvent) -> bool {
        let AlarmEvent::Transition(alarm) = event else {
            return true;
        };
        let is_diagnoser = |name: &String| alarm.diagnoser_name() == Some(name);
        let is_state = |name: &String| alarm.transition.state.name() == name;
        (self.diagnosers.is_empty() || self.diagnosers.iter().any(is_diagnoser))
            && (self.states.is_empty() || self.states.iter().any(is_state))
    }
}
