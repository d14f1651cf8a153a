//! What was wrong with a request, as data.

use serde::{Deserialize, Serialize};

use super::{MAX_ANSWER_BYTES, MAX_REQUEST_BYTES, VERSION};

/// Why the daemon did not do what it was asked for. Nothing has changed then, unless the variant says otherwise.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, thiserror::Error)]
pub enum ControlError {
    /// The bytes are no request.
    #[error("the daemon could not read the request: {reason}")]
    Malformed {
        /// Why.
        reason: String,
    },
    /// The request is too long.
    #[error("the request has {bytes} bytes; at most {MAX_REQUEST_BYTES} are possible")]
    TooLong {
        /// Its length.
        bytes: u64,
    },
    /// The request has another version.
    #[error(
        "the daemon speaks version {daemon} of control requests, not {client}; use the `residual` of its release"
    )]
    Version {
        /// The daemon's version.
        daemon: u32,
        /// That of the request.
        client: u32,
    },
    /// The answer does not fit.
    #[error("the answer would have more than {MAX_ANSWER_BYTES} bytes; ask for less")]
    AnswerTooLong,
    /// There is no such diagnoser.
    #[error("the daemon has no diagnoser `{name}`; it has {known}")]
    NoSuchDiagnoser {
        /// The name asked for.
        name: String,
        /// The names there are, as far as they fit.
        known: String,
    },
    /// There is no such alarm transition.
    #[error("there is no alarm {number} in the ring; name its diagnoser instead")]
    NoSuchAlarm {
        /// The number asked for, EPOCH.NUMBER.
        number: String,
    },
    /// The diagnoser has raised another alarm since.
    #[error(
        "alarm {number} is over: `{diagnoser}` has raised another one since; look at it and acknowledge that one"
    )]
    AlarmSuperseded {
        /// The number asked for, EPOCH.NUMBER.
        number: String,
        /// The diagnoser.
        diagnoser: String,
    },
    /// The log filter is wrong.
    #[error("`{filter}` is not a log filter: {reason}; write for example `info` or `warn,residuald=debug`")]
    LogFilter {
        /// The filter.
        filter: String,
        /// Why not.
        reason: String,
    },
    /// The daemon is doing another long task.
    #[error("the daemon is busy with another request ({with}); ask again when it is done")]
    Busy {
        /// What it is doing.
        with: String,
    },
    /// The new configuration, or the checkpoint, was refused.
    #[error("{reason}")]
    Refused {
        /// What was wrong, and what to do.
        reason: String,
    },
    /// This daemon has no means for it.
    #[error("this daemon cannot do it: {reason}")]
    Unsupported {
        /// Why, and what to do.
        reason: String,
    },
    /// The step thread did not take the command in time; it may still take it.
    #[error(
        "the step thread has not obeyed within {waited_ms} ms, but may still do so; see the diagnoser's records"
    )]
    NotObeyed {
        /// How long the daemon waited, ms.
        waited_ms: u64,
    },
    /// The daemon is stopping; the request may have been obeyed or not.
    #[error("the daemon is stopping")]
    Stopping,
}

impl From<super::DecodeError> for ControlError {
    fn from(error: super::DecodeError) -> Self {
        use super::DecodeError as Why;
        match error {
            Why::TooLong { bytes, .. } => Self::TooLong { bytes: bytes as u64 },
            Why::Version { theirs } => Self::Version {
                daemon: VERSION,
                client: theirs,
            },
            other @ (Why::TooShort { .. } | Why::Malformed { .. }) => Self::Malformed {
                reason: other.to_string(),
            },
        }
    }
}
