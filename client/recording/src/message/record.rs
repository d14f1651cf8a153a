//! A step record as a message: `/INSTANCE/records/DIAGNOSER`.
//!
//! Each channel is an object under its name, so that a program for plots finds for example
//! `/vtol/records/aircraft_actuators.channels.mode_0_output_1.residual`. Numbers and names of the same thing
//! (verdict, flags, faults) stand side by side: the names are for people, the numbers are what is read back.

use std::collections::HashMap;

use residual_shared::record::{Channel, MAX_CHANNELS, StepRecord, fault_names, flags};
use serde::ser::SerializeMap as _;
use serde::{Deserialize, Serialize, Serializer};

use super::MessageError;
use crate::number::Number;

/// A step record with its place in the daemon's stream of records.
#[derive(Clone, Copy, Debug)]
pub struct RecordMessage {
    /// Number of the record among those of all diagnosers; a step above 1 is a known loss.
    pub sequence: u64,
    /// The diagnoser's slot.
    pub slot: usize,
    /// The record.
    pub record: StepRecord,
}

#[derive(Serialize)]
struct Written<'a> {
    sequence: u64,
    step: u64,
    instant_ns: u64,
    verdict: &'static str,
    verdict_number: u32,
    flags: Vec<&'static str>,
    flag_bits: u32,
    certainly_faulty: Vec<&'a str>,
    certainly_faulty_bits: u64,
    possibly_faulty: Vec<&'a str>,
    possibly_faulty_bits: u64,
    fault_estimate: Number,
    fault_estimate_half_width: Number,
    inputs_valid_bits: u64,
    skipped_instants: u32,
    channels: WrittenChannels<'a>,
}

struct WrittenChannels<'a>(&'a [String], &'a [Channel]);

impl Serialize for WrittenChannels<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        for (key, channel) in self.0.iter().zip(self.1) {
            map.serialize_entry(key, &JsonChannel::from(*channel))?;
        }
        map.end()
    }
}

#[derive(Clone, Copy, Serialize, Deserialize)]
struct JsonChannel {
    lower: Number,
    residual: Number,
    upper: Number,
    ratio: Number,
}

impl From<Channel> for JsonChannel {
    fn from(channel: Channel) -> Self {
        Self {
            lower: Number(channel.lower),
            residual: Number(channel.residual),
            upper: Number(channel.upper),
            ratio: Number(channel.ratio),
        }
    }
}

#[derive(Deserialize)]
struct Read {
    sequence: u64,
    step: u64,
    instant_ns: u64,
    verdict_number: u32,
    flag_bits: u32,
    certainly_faulty_bits: u64,
    possibly_faulty_bits: u64,
    fault_estimate: Number,
    fault_estimate_half_width: Number,
    inputs_valid_bits: u64,
    skipped_instants: u32,
    channels: HashMap<String, JsonChannel>,
}

impl RecordMessage {
    /// Appends the message as JSON; `keys` are the
    /// [`channel_keys`](crate::header::Diagnoser::channel_keys) of its diagnoser.
    pub(crate) fn write(
        &self,
        faults: &[String],
        keys: &[String],
        into: &mut Vec<u8>,
    ) -> serde_json::Result<()> {
        let record = &self.record;
        let written = Written {
            sequence: self.sequence,
            step: record.step,
            instant_ns: record.instant_ns,
            verdict: record.verdict().name(),
            verdict_number: record.verdict,
            flags: flags::names(record.flags).collect(),
            flag_bits: record.flags,
            certainly_faulty: fault_names(faults, record.certainly_faulty).collect(),
            certainly_faulty_bits: record.certainly_faulty,
            possibly_faulty: fault_names(faults, record.possibly_faulty).collect(),
            possibly_faulty_bits: record.possibly_faulty,
            fault_estimate: Number(record.fault_estimate),
            fault_estimate_half_width: Number(record.fault_estimate_half_width),
            inputs_valid_bits: record.inputs_valid,
            skipped_instants: record.skipped_instants,
            channels: WrittenChannels(keys, record.channels()),
        };
        serde_json::to_writer(into, &written)
    }

    /// The message in `json`, of the diagnoser in `slot` with the channels `keys`.
    pub(crate) fn read(json: &[u8], slot: usize, keys: &[String]) -> Result<Self, MessageError> {
        let read: Read = serde_json::from_slice(json)?;
        // A record may have fewer channels than its diagnoser if a foreign writer made it so; more have no name.
        let count = read.channels.len();
        if count > keys.len().min(MAX_CHANNELS) {
            return Err(MessageError::TooManyChannels(count));
        }
        let mut record = StepRecord {
            step: read.step,
            instant_ns: read.instant_ns,
            certainly_faulty: read.certainly_faulty_bits,
            possibly_faulty: read.possibly_faulty_bits,
            inputs_valid: read.inputs_valid_bits,
            fault_estimate: read.fault_estimate.0,
            fault_estimate_half_width: read.fault_estimate_half_width.0,
            verdict: read.verdict_number,
            flags: read.flag_bits,
            skipped_instants: read.skipped_instants,
            ..StepRecord::new(count)
        };
        for (key, channel) in keys.iter().zip(record.channels_mut()) {
            let json = read
                .channels
                .get(key)
                .ok_or_else(|| MessageError::Missing(key.clone()))?;
            *channel = Channel {
                lower: json.lower.0,
                residual: json.residual.0,
                upper: json.upper.0,
                ratio: json.ratio.0,
            };
        }
        Ok(Self {
            sequence: read.sequence,
            slot,
            record,
        })
    }
}
