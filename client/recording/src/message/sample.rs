//! A sample of an input as a message: `/INSTANCE/samples/INPUT`.
//!
//! When a sample arrived is known only as the interval between two looks of the recorder. A replay lets a sample
//! arrive at its stamp if that lies in the interval, and otherwise at the end of the interval that is nearer to it
//! ([`SampleMessage::arrival_ns`]): so a recorder that was kept from running delays nothing, and a sample that was
//! sent late is late again.

use serde::ser::SerializeMap as _;
use serde::{Deserialize, Serialize, Serializer};

use residual_shared::sample::SampleHeader;

use super::MessageError;
use crate::number::Number;

/// A sample as the recorder received it. All times are the daemon's.
#[derive(Clone, Debug, PartialEq)]
pub struct SampleMessage {
    /// The input.
    pub input: usize,
    /// The publisher's number in iceoryx2.
    pub publisher: u128,
    /// Sequence number and stamp.
    pub header: SampleHeader,
    /// When the recorder looked the last time before the sample was there, nanoseconds.
    pub looked_ns: u64,
    /// When the recorder had the sample, nanoseconds.
    pub received_ns: u64,
    /// One element per signal; fewer or more if the driver sent so.
    pub elements: Vec<f64>,
}

#[derive(Serialize)]
struct Written<'a> {
    sequence: u64,
    timestamp_ns: u64,
    publisher: String,
    looked_ns: u64,
    received_ns: u64,
    signals: WrittenSignals<'a>,
    surplus: Vec<Number>,
}

struct WrittenSignals<'a>(&'a [String], &'a [f64]);

impl Serialize for WrittenSignals<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        for (key, element) in self.0.iter().zip(self.1) {
            map.serialize_entry(key, &Number(*element))?;
        }
        map.end()
    }
}

#[derive(Deserialize)]
struct Read {
    sequence: u64,
    timestamp_ns: u64,
    publisher: String,
    looked_ns: u64,
    received_ns: u64,
    signals: std::collections::HashMap<String, Number>,
    surplus: Vec<Number>,
}

impl SampleMessage {
    /// When a replay hands the sample over, nanoseconds; see the [module](self).
    pub fn arrival_ns(&self) -> u64 {
        let stamp_ns = self.header.timestamp_ns;
        stamp_ns.max(self.looked_ns).min(self.received_ns)
    }

    /// Appends the message as JSON; `keys` are the [`Input::signal_keys`](crate::header::Input::signal_keys).
    pub(crate) fn write(&self, keys: &[String], into: &mut Vec<u8>) -> serde_json::Result<()> {
        let surplus = self.elements.iter().skip(keys.len());
        let written = Written {
            sequence: self.header.sequence,
            timestamp_ns: self.header.timestamp_ns,
            publisher: format!("{:x}", self.publisher),
            looked_ns: self.looked_ns,
            received_ns: self.received_ns,
            signals: WrittenSignals(keys, &self.elements),
            surplus: surplus.copied().map(Number).collect(),
        };
        serde_json::to_writer(into, &written)
    }

    /// The message in `json`, of an input with the signals `keys`.
    pub(crate) fn read(json: &[u8], input: usize, keys: &[String]) -> Result<Self, MessageError> {
        let read: Read = serde_json::from_slice(json)?;
        let publisher = u128::from_str_radix(&read.publisher, 16);
        let mut elements = Vec::with_capacity(keys.len());
        for key in keys.iter().take(read.signals.len()) {
            let element = read
                .signals
                .get(key)
                .ok_or_else(|| MessageError::Missing(key.clone()))?;
            elements.push(element.0);
        }
        elements.extend(read.surplus.iter().map(|element| element.0));
        Ok(Self {
            input,
            publisher: publisher.map_err(|_| MessageError::NotHexadecimal(read.publisher))?,
            header: SampleHeader {
                sequence: read.sequence,
                timestamp_ns: read.timestamp_ns,
            },
            looked_ns: read.looked_ns,
            received_ns: read.received_ns,
            elements,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sample_arrives_at_its_stamp_moved_into_the_interval_in_which_it_came() {
        let sample = |stamp_ns, looked_ns, received_ns| SampleMessage {
            input: 0,
            publisher: 1,
            header: SampleHeader {
                sequence: 0,
                timestamp_ns: stamp_ns,
            },
            looked_ns,
            received_ns,
            elements: Vec::new(),
        };
        assert_eq!(sample(100, 90, 200).arrival_ns(), 100);
        assert_eq!(sample(100, 150, 151).arrival_ns(), 150, "sent late");
        assert_eq!(sample(100, 50, 51).arrival_ns(), 51, "stamped in the future");
    }
}
