//! The messages of a recording, as JSON and back.

pub mod alarm;
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
    /// A number is none.
    #[error("`{0}` is no hexadecimal number")]
    NotHexadecimal(String),
    /// The number of an alarm is none.
    #[error(transparent)]
    AlarmNumber(#[from] residual_shared::alarm::AlarmNumberError),
    /// The state of an alarm is none.
    #[error("there is no alarm state {0}")]
    State(u32),
}
