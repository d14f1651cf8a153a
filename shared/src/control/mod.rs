//! What a client may ask of a running daemon, and the answers.
//!
//! ```text
//! request = version word (u32, little endian), then bincode of Request
//! answer  = version word (u32, little endian), then bincode of Result<Response, ControlError>
//! ```
//!
//! The version word comes first and keeps its form for ever, so that programs of different releases can tell each
//! other what is the matter. Every variant after it may change with the version.

use serde::{Deserialize, Serialize};

use crate::alarm::AlarmNumber;

mod encoding;
mod error;
mod response;

pub use encoding::{
    Answer, DecodeError, EncodeError, MAX_ANSWER_BYTES, MAX_REQUEST_BYTES, VERSION, decode_answer,
    decode_request, encode_answer, encode_request,
};
pub use error::ControlError;
pub use response::{
    Changes, ChannelDescription, CheckpointOutcome, ControlCounters, Counter, DiagnoserDescription,
    DiagnoserEntry, LIST_PAGE, Listing, ReloadOutcome, Response,
};

/// What a client asks of the daemon.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Request {
    /// The daemon itself, and its diagnosers from the one in slot `first` on, at most [`LIST_PAGE`] of them.
    List {
        /// The first slot wanted.
        first: u32,
    },
    /// All that is known of one diagnoser.
    Describe {
        /// Its name.
        diagnoser: String,
    },
    /// Return diagnosers to the state right after their construction.
    Reset {
        /// Which.
        which: Which,
    },
    /// Acknowledge alarms.
    Acknowledge {
        /// Which.
        alarms: Alarms,
    },
    /// Save the state of all diagnosers now.
    Checkpoint,
    /// Read the configuration again and go on with it.
    Reload,
    /// Change what is logged.
    SetLogLevel {
        /// A filter such as `info` or `warn,residuald=debug`.
        filter: String,
    },
}

/// Which diagnosers.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Which {
    /// All of them.
    All,
    /// The one with this name.
    Diagnoser(String),
}

/// Which alarms.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Alarms {
    /// Those of all diagnosers.
    All,
    /// That of the diagnoser with this name.
    Diagnoser(String),
    /// The one that this transition belongs to, unless the diagnoser has raised another one since.
    Number {
        /// [`AlarmNumber::epoch`].
        epoch: u64,
        /// [`AlarmNumber::number`].
        number: u64,
    },
}

impl From<AlarmNumber> for Alarms {
    fn from(AlarmNumber { epoch, number }: AlarmNumber) -> Self {
        Self::Number { epoch, number }
    }
}
