//! What can go wrong, and the exit code that tells it.

use std::io;
use std::path::PathBuf;

use residual_client::{OpenError, ReadError, RequestError};
use residual_recording::recorder::RecordError;

/// Exit code: an error.
const FAILURE: u8 = 1;
/// Exit code: wrong usage (clap uses the same).
const USAGE: u8 = 2;
/// Exit code: there is no living daemon.
pub const NO_DAEMON: u8 = 3;

/// Exit code: the daemon did not answer in time.
const TIMED_OUT: u8 = 6;

/// Why `residual` gave up.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// No instance was named and none was found.
    #[error("there is no instance in {}; is the daemon running, with this --runtime-directory?", .0.display())]
    NoInstance(PathBuf),
    /// No instance was named and there are several.
    #[error("there are several instances: {}; choose one with --instance", .0.join(", "))]
    SeveralInstances(Vec<String>),
    /// The runtime directory cannot be listed.
    #[error("cannot look for instances in {}: {source}; start the daemon, or name its directory with \
             --runtime-directory", directory.display())]
    RuntimeDirectory {
        /// The directory.
        directory: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The table cannot be opened.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// A record cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The daemon did not do what it was asked for.
    #[error(transparent)]
    Request(#[from] RequestError),
    /// A diagnoser was named that the daemon does not have.
    #[error("the daemon has no diagnoser `{name}`; it has {}", known.join(", "))]
    NoSuchDiagnoser {
        /// The name.
        name: String,
        /// The names there are.
        known: Vec<String>,
    },
    /// A recording cannot be made.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// A recording cannot be read.
    #[error(transparent)]
    Recording(#[from] residual_recording::ReadError),
    /// A recording has no such diagnoser or channel, or nothing to draw of it.
    #[error("{0}")]
    Selection(String),
    /// A file cannot be made, or is there already.
    #[error("cannot create `{path}`: {source}; choose another file with --output")]
    Create {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// A file cannot be written.
    #[error("cannot write `{path}`: {source}")]
    File {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// A chart cannot be drawn.
    #[error(transparent)]
    Chart(#[from] residual_chart::ChartError),
    /// The address cannot be listened on.
    #[error("cannot listen on {address}: {reason}; choose another address with --listen")]
    Listen {
        /// The address.
        address: std::net::SocketAddr,
        /// What the system said.
        reason: String,
    },
    /// Signal handlers cannot be installed.
    #[error("cannot install signal handlers: {0}")]
    Signals(io::Error),
    /// The man pages cannot be written.
    #[error("cannot write man pages to {}: {source}", directory.display())]
    ManPages {
        /// The directory.
        directory: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The output cannot be written.
    #[error("cannot write the output: {0}")]
    Output(#[from] io::Error),
}

impl Error {
    /// Whether there is no instance of the name that was given.
    pub fn is_missing_instance(&self) -> bool {
        matches!(
            self,
            Self::Open(OpenError::NotFound { .. })
                | Self::Request(RequestError::NoDaemon { .. })
                | Self::Record(RecordError::Table(OpenError::NotFound { .. }))
        )
    }

    /// The exit code.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::NoInstance(_)
            | Self::Open(OpenError::NotFound { .. })
            | Self::Request(RequestError::NoDaemon { .. } | RequestError::DaemonEnded)
            | Self::Record(RecordError::NoDaemon(_) | RecordError::Table(OpenError::NotFound { .. })) => {
                NO_DAEMON
            }
            Self::Request(RequestError::TimedOut { .. }) => TIMED_OUT,
            Self::SeveralInstances(_)
            | Self::NoSuchDiagnoser { .. }
            | Self::Selection(_)
            | Self::Record(RecordError::NoSuchDiagnoser { .. }) => USAGE,
            Self::RuntimeDirectory { .. }
            | Self::Open(_)
            | Self::Read(_)
            | Self::Request(_)
            | Self::Record(_)
            | Self::Recording(_)
            | Self::Create { .. }
            | Self::File { .. }
            | Self::Chart(_)
            | Self::Listen { .. }
            | Self::Signals(_)
            | Self::ManPages { .. }
            | Self::Output(_) => FAILURE,
        }
    }
}
