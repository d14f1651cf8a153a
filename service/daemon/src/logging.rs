//! The log: `tracing` to standard error through a writer thread, so that no caller waits for a terminal or disk.

use std::fmt::Arguments;
use std::io::IsTerminal as _;

use iceoryx2_log::{Log, LogLevel};
use tracing_appender::non_blocking::{NonBlocking, WorkerGuard};
use tracing_subscriber::EnvFilter;
use tracing_subscriber::filter::ParseError;

/// Environment variable that overrides the configured filter.
pub const FILTER_VARIABLE: &str = "RESIDUALD_LOG";

/// Starts the log with the given filter (for example `info` or `warn,residuald=debug`).
///
/// The returned guard must live as long as the program: dropping it writes out what is still queued.
pub fn start(filter: &str) -> Result<WorkerGuard, ParseError> {
    let filter = std::env::var(FILTER_VARIABLE).unwrap_or_else(|_| filter.into());
    let filter = EnvFilter::try_new(filter)?;
    let (writer, guard) = NonBlocking::new(std::io::stderr());
    let subscriber = tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(writer)
        .with_ansi(std::io::stderr().is_terminal());
    // A second start in one process (tests) keeps the first log.
    let _ = subscriber.try_init();
    iceoryx2_log::set_logger(&ICEORYX_LOG);
    Ok(guard)
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
