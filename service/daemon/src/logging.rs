//! The log: `tracing` to standard error through a writer thread, so that no caller waits for a terminal or disk.

use std::fmt::Arguments;
use std::io::IsTerminal as _;

use iceoryx2_log::{Log, LogLevel};
use tracing_appender::non_blocking::{NonBlocking, WorkerGuard};
use tracing_subscriber::filter::{LevelFilter, ParseError};
use tracing_subscriber::layer::SubscriberExt as _;
use tracing_subscriber::util::SubscriberInitExt as _;
use tracing_subscriber::{EnvFilter, Registry, fmt, reload};

/// Environment variable that overrides the configured filter.
pub const FILTER_VARIABLE: &str = "RESIDUALD_LOG";

/// The crates that write to the log; their modules begin with these names.
const CRATES: [&str; 2] = ["residual", "iceoryx2"];

/// Starts the log with the given filter (for example `info` or `warn,residuald=debug`); its filter can be changed
/// later.
///
/// The returned guard must live as long as the program: dropping it writes out what is still queued.
///
/// # Errors
/// The filter is none.
pub fn start(filter: &str) -> Result<(WorkerGuard, LogFilter), FilterError> {
    let filter = std::env::var(FILTER_VARIABLE).unwrap_or_else(|_| filter.into());
    let (filter, handle) = reload::Layer::new(parse(&filter)?);
    let (writer, guard) = NonBlocking::new(std::io::stderr());
    let lines = fmt::layer()
        .with_writer(writer)
        .with_ansi(std::io::stderr().is_terminal());
    // A second start in one process (tests) keeps the first log.
    let _ = Registry::default().with(filter).with(lines).try_init();
    iceoryx2_log::set_logger(&ICEORYX_LOG);
    Ok((guard, LogFilter(handle)))
}

/// The filter of the running log.
#[derive(Clone, Debug)]
pub struct LogFilter(reload::Handle<EnvFilter, Registry>);

/// Why the filter was not changed.
#[derive(Debug, thiserror::Error)]
pub enum FilterError {
    /// It is none.
    #[error(transparent)]
    Parse(#[from] ParseError),
    /// It would switch the log off by an oversight.
    #[error("it is empty")]
    Empty,
    /// It would switch off the log of everything else.
    #[error("`{0}` is neither a level (error, warn, info, debug, trace, off) nor a crate of this program")]
    Word(String),
    /// The log has ended.
    #[error("the log cannot be changed: {0}")]
    Log(#[from] reload::Error),
}

impl LogFilter {
    /// The filter as it is now.
    pub fn current(&self) -> String {
        self.0.with_current(ToString::to_string).unwrap_or_default()
    }

    /// Replaces the filter.
    ///
    /// # Errors
    /// See [`FilterError`]; the filter is as before then.
    pub fn set(&self, filter: &str) -> Result<(), FilterError> {
        Ok(self.0.reload(parse(filter)?)?)
    }
}

/// The filter in a text.
///
/// # Errors
/// See [`FilterError`]. A word alone that is neither a level nor a crate of this program is refused: it would be
/// taken for the name of a crate, and switch off the log of all others.
pub fn parse(filter: &str) -> Result<EnvFilter, FilterError> {
    if filter.trim().is_empty() {
        return Err(FilterError::Empty);
    }
    let is_known = |word: &&str| {
        word.parse::<LevelFilter>().is_ok()
            || word.contains(['=', '['])
            || word.is_empty()
            || CRATES.iter().any(|name| word.starts_with(name))
    };
    match filter.split(',').map(str::trim).find(|word| !is_known(word)) {
        Some(word) => Err(FilterError::Word(word.into())),
        None => Ok(EnvFilter::try_new(filter)?),
    }
}

/// Forwards iceoryx2's messages to `tracing`.
///
/// Its reasons for failures are `Debug` messages and its origins dumps of whole objects; we take the message
/// and leave the origin.
struct IceoryxLog;

static ICEORYX_LOG: IceoryxLog = IceoryxLog;

impl Log for IceoryxLog {
    fn log(&self, level: LogLevel, _origin: Arguments<'_>, message: Arguments<'_>) {
        match level {
            LogLevel::Trace => tracing::trace!(target: "iceoryx2", "{message}"),
            LogLevel::Debug => tracing::debug!(target: "iceoryx2", "{message}"),
            LogLevel::Info => tracing::info!(target: "iceoryx2", "{message}"),
            LogLevel::Warn => tracing::warn!(target: "iceoryx2", "{message}"),
            LogLevel::Error | LogLevel::Fatal => tracing::error!(target: "iceoryx2", "{message}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_misspelt_level_is_refused_and_levels_crates_and_lists_are_taken() {
        for filter in [
            "info",
            "OFF",
            "warn,residuald=debug",
            "residuald::runtime",
            "iceoryx2=trace, error",
            "other=info",
        ] {
            assert!(parse(filter).is_ok(), "{filter}");
        }
        for filter in ["debgu", "warn,inof", "", " "] {
            assert!(parse(filter).is_err(), "{filter}");
        }
    }
}
