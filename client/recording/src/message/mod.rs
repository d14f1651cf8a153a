//! The messages of a recording, as JSON and back.

pub mod record;
pub mod sample;

pub use record::RecordMessage;
pub use sample::SampleMessage;

/// Why a message cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum MessageError {
    /// It is no JSON, or a field is missing or has a wrong type.
    #[error(transparent)]
    Json(#[from] serde_json::Error),
    /// A channel or signal that the header names is not in it.
    #[error("`{0}` is missing")]
    Missing(String),
    /// It has more channels than a record holds.
    #[error("it has {0} channels; a record holds {max}", max = residual_shared::record::MAX_CHANNELS)]
    TooManyChannels(usize),
    /// The number of the publisher is none.
    #[error("the publisher `{0}` is no hexadecimal number")]
    Publisher(String),
}
