//! `residual watch`: every channel between its bounds, again and again.

mod lines;
mod screen;

use std::io::{self, IsTerminal};

use residual_client::Monitor;

use crate::arguments::WatchOptions;
use crate::error::Error;
use crate::snapshot::{DiagnoserView, Snapshot};

/// Watches until the count is reached or the user ends it; gives the exit code.
pub fn run(monitor: &mut Monitor, options: &WatchOptions) -> Result<u8, Error> {
    if let Some(snapshot) = Snapshot::take(monitor)? {
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
        screen::run(monitor, options)
    } else {
        lines::run(monitor, options)
    }
}

impl WatchOptions {
    /// The diagnosers that are watched.
    fn watched<'a>(&self, snapshot: &'a Snapshot) -> impl Iterator<Item = &'a DiagnoserView> {
        let is_watched = |name: &String| self.diagnosers.is_empty() || self.diagnosers.contains(name);
        snapshot
            .diagnosers
            .iter()
            .filter(move |diagnoser| is_watched(&diagnoser.name))
    }
}
