//! The state of a diagnoser as bytes: written at a checkpoint, taken over after a restart.
//!
//! | part | content |
//! |---|---|
//! | head | magic number, format of the head, method, version of the method's state, fingerprint of its configuration |
//! | body | the method's state, serialised by bincode: every bit of every number |
//! | tail | checksum of all that stands before it |
//!
//! The fingerprint keeps a state from being restored into a diagnoser with another model or other options.

use bincode::config::{Configuration, Fixint, Limit, LittleEndian};
use bincode::enc::write::SizeWriter;
use serde::{Serialize, de::DeserializeOwned};
use xxhash_rust::xxh3::xxh3_64;

/// Begins every state.
const MAGIC: [u8; 8] = *b"RESSTATE";
/// Version of head and tail.
const FORMAT: u16 = 1;
/// A larger body is damaged: the largest state of a diagnoser is some hundred kilobytes.
const BODY_LIMIT: usize = 1 << 26;
/// Bytes of the checksum.
const TAIL: usize = size_of::<u64>();

/// What tells the states of different diagnosers apart.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StateFormat {
    method: &'static str,
    version: u16,
    fingerprint: u64,
}

/// Why bytes cannot be taken over as a diagnoser's state.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RestoreError {
    /// The bytes do not begin like a state.
    #[error("the bytes are not the state of a diagnoser; restore what a diagnoser saved")]
    NotAState,
    /// Another version wrote it.
    #[error("the state has version {found} of {what}, this program reads version {supported}; start afresh")]
    UnknownVersion {
        /// Which part has a version of its own.
        what: &'static str,
        /// Version of the bytes.
        found: u16,
        /// Version of this program.
        supported: u16,
    },
    /// Another method wrote it.
    #[error("the state belongs to the method `{found}`, the diagnoser runs `{expected}`; start afresh")]
    OtherMethod {
        /// Method of the bytes.
        found: String,
        /// Method of the diagnoser.
        expected: &'static str,
    },
    /// A diagnoser with another model or other options wrote it.
    #[error("the state belongs to a diagnoser with another model or other options; start afresh")]
    OtherConfiguration,
    /// The bytes are incomplete or changed.
    #[error("the state is damaged; use an older one or start afresh")]
    Damaged,
}

#[derive(Serialize, serde::Deserialize)]
struct Head<Text> {
    magic: [u8; 8],
    format: u16,
    method: Text,
    version: u16,
    fingerprint: u64,
}

const fn encoding() -> Configuration<LittleEndian, Fixint, Limit<BODY_LIMIT>> {
    bincode::config::legacy().with_limit::<BODY_LIMIT>()
}

/// Appends a value; bincode fails only on types that no state has (unsized sequences).
fn append(value: &impl Serialize, bytes: &mut Vec<u8>) {
    let written = bincode::serde::encode_into_std_write(value, bytes, encoding());
    debug_assert!(written.is_ok(), "{written:?}");
}

/// Bytes that [`append`] needs for a value.
fn size(value: &impl Serialize) -> usize {
    let mut counter = SizeWriter::default();
    let counted = bincode::serde::encode_into_writer(value, &mut counter, encoding());
    debug_assert!(counted.is_ok(), "{counted:?}");
    counter.bytes_written
}

impl StateFormat {
    /// The format of `version` of the state of `method` under a configuration.
    pub fn new(method: &'static str, version: u16, configuration: &impl Serialize) -> Self {
        let mut bytes = Vec::new();
        append(configuration, &mut bytes);
        Self {
            method,
            version,
            fingerprint: xxh3_64(&bytes),
        }
    }

    /// Makes a part that was configured later belong to the configuration.
    pub fn extend(&mut self, part: &impl Serialize) {
        let mut bytes = self.fingerprint.to_le_bytes().to_vec();
        append(part, &mut bytes);
        self.fingerprint = xxh3_64(&bytes);
    }

    fn head(&self) -> Head<&'static str> {
        Head {
            magic: MAGIC,
            format: FORMAT,
            method: self.method,
            version: self.version,
            fingerprint: self.fingerprint,
        }
    }

    /// How many bytes [`Self::encode`] appends for a state.
    pub fn size(&self, state: &impl Serialize) -> usize {
        size(&self.head()) + size(state) + TAIL
    }

    /// Appends a state. Allocates only if `bytes` has no room for it.
    pub fn encode(&self, state: &impl Serialize, bytes: &mut Vec<u8>) {
        let begin = bytes.len();
        append(&self.head(), bytes);
        append(state, bytes);
        let checksum = xxh3_64(&bytes[begin..]);
        append(&checksum, bytes);
    }

    /// Reads a state that [`Self::encode`] wrote; whether its lengths fit the diagnoser is left to the method.
    ///
    /// # Errors
    /// [`RestoreError`]: which part does not fit.
    pub fn decode<S: DeserializeOwned>(&self, bytes: &[u8]) -> Result<S, RestoreError> {
        if !bytes.starts_with(&MAGIC) {
            return Err(RestoreError::NotAState);
        }
        let (content, tail) = bytes
            .split_at_checked(bytes.len().saturating_sub(TAIL))
            .ok_or(RestoreError::Damaged)?;
        if tail != xxh3_64(content).to_le_bytes() {
            return Err(RestoreError::Damaged);
        }
        let damaged = |_| RestoreError::Damaged;
        let (head, read): (Head<String>, usize) =
            bincode::serde::decode_from_slice(content, encoding()).map_err(damaged)?;
        self.check(&head)?;
        let body = content.get(read..).ok_or(RestoreError::Damaged)?;
        let (state, used) = bincode::serde::decode_from_slice(body, encoding()).map_err(damaged)?;
        if used == body.len() {
            Ok(state)
        } else {
            Err(RestoreError::Damaged)
        }
    }

    fn check(&self, head: &Head<String>) -> Result<(), RestoreError> {
        let unknown = |what, found, supported| RestoreError::UnknownVersion {
            what,
            found,
            supported,
        };
        if head.format != FORMAT {
            return Err(unknown("the envelope", head.format, FORMAT));
        }
        if head.method != self.method {
            return Err(RestoreError::OtherMethod {
                found: head.method.clone(),
                expected: self.method,
            });
        }
        if head.version != self.version {
            return Err(unknown("the method's state", head.version, self.version));
        }
        if head.fingerprint != self.fingerprint {
            return Err(RestoreError::OtherConfiguration);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    type State = (Vec<f64>, Option<u32>);

    fn format(version: u16, configuration: u8) -> StateFormat {
        StateFormat::new("some_method", version, &configuration)
    }

    fn written() -> (State, Vec<u8>) {
        let state = (vec![1.0, f64::NAN, -0.0, f64::INFINITY], Some(7));
        let mut bytes = Vec::new();
        format(1, 0).encode(&state, &mut bytes);
        (state, bytes)
    }

    #[test]
    fn every_bit_comes_back() {
        let (state, bytes) = written();
        let read: State = format(1, 0).decode(&bytes).unwrap();
        let bits = |state: &State| state.0.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
        assert_eq!((bits(&read), read.1), (bits(&state), state.1));
        assert_eq!(format(1, 0).size(&state), bytes.len());
    }

    #[test]
    fn states_of_others_are_refused() {
        let (_, bytes) = written();
        let refusal = |format: StateFormat| format.decode::<State>(&bytes).unwrap_err();
        assert_eq!(refusal(format(1, 9)), RestoreError::OtherConfiguration);
        assert!(matches!(
            refusal(format(2, 0)),
            RestoreError::UnknownVersion {
                found: 1,
                supported: 2,
                ..
            }
        ));
        let other = StateFormat::new("other_method", 1, &0_u8);
        assert!(matches!(refusal(other), RestoreError::OtherMethod { .. }));
    }

    #[test]
    fn a_changed_or_shortened_state_is_refused_wherever_the_damage_is() {
        let (_, bytes) = written();
        for place in 0..bytes.len() {
            let mut changed = bytes.clone();
            changed[place] ^= 0x10;
            assert!(format(1, 0).decode::<State>(&changed).is_err(), "byte {place}");
            assert!(
                format(1, 0).decode::<State>(&bytes[..place]).is_err(),
                "length {place}"
            );
        }
        assert_eq!(
            format(1, 0).decode::<State>(b"RESS"),
            Err(RestoreError::NotAState)
        );
    }

    #[test]
    fn a_state_of_another_type_is_refused() {
        let (_, bytes) = written();
        assert_eq!(format(1, 0).decode::<u64>(&bytes), Err(RestoreError::Damaged));
    }
}
