//! Requests and answers as bytes, of bounded size.

use bincode::config::{self, Configuration, Fixint, Limit, LittleEndian};
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::{ControlError, Request, Response};

/// Version of the requests and answers.
pub const VERSION: u32 = 1;

/// Longest request. The longest parts are a name (below 256 bytes) and a log filter; 4 KiB, a page, leaves room for
/// filters of a hundred directives.
pub const MAX_REQUEST_BYTES: usize = 4096;

/// Longest answer. A description of a diagnoser with all of its 64 channels and 64 faults, each with the longest
/// name, and a page of the list stay well below; iceoryx2 keeps room for 48 answers of 8 clients, so the service takes 3 MiB
/// of shared memory.
pub const MAX_ANSWER_BYTES: usize = 65_536;

const VERSION_BYTES: usize = size_of::<u32>();

/// What the daemon answers.
pub type Answer = Result<Response, ControlError>;

/// Why a request or an answer cannot be sent.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum EncodeError {
    /// It is too long.
    #[error("the message would have more than {limit} bytes; shorten the names or the filter in it")]
    TooLong {
        /// The limit, bytes.
        limit: usize,
    },
}

/// Why bytes are no request, or no answer.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DecodeError {
    /// Too short even for the version word.
    #[error("{bytes} bytes are too few for a message; the first 4 are its version")]
    TooShort {
        /// The length, bytes.
        bytes: usize,
    },
    /// Too long.
    #[error("a message of {bytes} bytes is too long; at most {limit} are possible")]
    TooLong {
        /// The length, bytes.
        bytes: usize,
        /// The limit, bytes.
        limit: usize,
    },
    /// Of another version.
    #[error(
        "the message has version {theirs}, this program speaks version {VERSION}; use a client of the daemon's release"
    )]
    Version {
        /// Its version.
        theirs: u32,
    },
    /// Of this version, but not a message.
    #[error("the message cannot be read: {reason}; send what `encode_request` or `encode_answer` gives")]
    Malformed {
        /// What bincode said.
        reason: String,
    },
}

/// A request as bytes.
///
/// # Errors
/// [`EncodeError::TooLong`] if it has more than [`MAX_REQUEST_BYTES`].
pub fn encode_request(request: &Request) -> Result<Vec<u8>, EncodeError> {
    encode::<MAX_REQUEST_BYTES>(request)
}

/// The request in these bytes.
///
/// # Errors
/// See [`DecodeError`]; whatever the bytes are, nothing panics and no more memory is taken than they could fill.
pub fn decode_request(bytes: &[u8]) -> Result<Request, DecodeError> {
    decode::<_, MAX_REQUEST_BYTES>(bytes)
}

/// An answer as bytes.
///
/// # Errors
/// [`EncodeError::TooLong`] if it has more than [`MAX_ANSWER_BYTES`].
pub fn encode_answer(answer: &Answer) -> Result<Vec<u8>, EncodeError> {
    encode::<MAX_ANSWER_BYTES>(answer)
}

/// The answer in these bytes.
///
/// # Errors
/// As for [`decode_request`].
pub fn decode_answer(bytes: &[u8]) -> Result<Answer, DecodeError> {
    decode::<_, MAX_ANSWER_BYTES>(bytes)
}

/// Integers of fixed width, so that every byte of a message counts once and its length is easily foreseen.
fn format<const LIMIT: usize>() -> Configuration<LittleEndian, Fixint, Limit<LIMIT>> {
    config::legacy().with_limit::<LIMIT>()
}

fn encode<const LIMIT: usize>(message: &impl Serialize) -> Result<Vec<u8>, EncodeError> {
    let mut bytes = VERSION.to_le_bytes().to_vec();
    let too_long = EncodeError::TooLong { limit: LIMIT };
    // Our messages hold nothing that bincode cannot write.
    bincode::serde::encode_into_std_write(message, &mut bytes, format::<LIMIT>())
        .map_err(|_| too_long.clone())?;
    if bytes.len() > LIMIT {
        return Err(too_long);
    }
    Ok(bytes)
}

fn decode<T: DeserializeOwned, const LIMIT: usize>(bytes: &[u8]) -> Result<T, DecodeError> {
    let Some((version, body)) = bytes.split_first_chunk::<VERSION_BYTES>() else {
        return Err(DecodeError::TooShort { bytes: bytes.len() });
    };
    let theirs = u32::from_le_bytes(*version);
    if theirs != VERSION {
        return Err(DecodeError::Version { theirs });
    }
    if bytes.len() > LIMIT {
        return Err(DecodeError::TooLong {
            bytes: bytes.len(),
            limit: LIMIT,
        });
    }
    let malformed = |reason: String| DecodeError::Malformed { reason };
    let (message, length) = bincode::serde::decode_from_slice(body, format::<LIMIT>())
        .map_err(|error| malformed(error.to_string()))?;
    if length != body.len() {
        return Err(malformed(format!("{} bytes are left over", body.len() - length)));
    }
    Ok(message)
}
