//! String diagnostics in the style of ROS: `diagnostic_msgs/DiagnosticArray` with keys and values of text, serialised
//! as CDR (XCDR 1, little endian) as ROS 2 does, and read back into numbers.
//!
//! | message | fields |
//! |---|---|
//! | `DiagnosticArray` | stamp (sec, nanosec), frame_id, list of status |
//! | `DiagnosticStatus` | level (one byte), name, message, hardware_id, list of key and value |

use std::fmt::Write as _;

use residual_shared::record::{Channel, StepRecord};

/// Parts of a channel, each with a key of its own.
const PARTS: [&str; 4] = ["lower", "residual", "upper", "ratio"];

/// One status with its keys and values.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Diagnostic {
    /// When, as ROS writes it.
    pub stamp: (i32, u32),
    /// 0 ok, 1 warning, 2 error.
    pub level: u8,
    /// Which component.
    pub name: String,
    /// What is the matter.
    pub message: String,
    /// Keys and values.
    pub values: Vec<(String, String)>,
}

impl Diagnostic {
    /// The diagnostic of a record; `channels` are the names of its channels.
    ///
    /// Numbers are written with as many digits as it takes to read the same number back.
    pub fn of(record: &StepRecord, name: &str, channels: &[String]) -> Self {
        let mut values = Vec::with_capacity(1 + PARTS.len() * channels.len());
        values.push(("step".to_owned(), record.step.to_string()));
        for (channel, name) in record.channels().iter().zip(channels) {
            let numbers = [channel.lower, channel.residual, channel.upper, channel.ratio];
            values.extend(PARTS.iter().zip(numbers).map(|(part, number)| {
                let mut text = String::new();
                // Writing into a string does not fail.
                _ = write!(text, "{number}");
                (format!("{name} {part}"), text)
            }));
        }
        Self {
            stamp: (
                (record.instant_ns / 1_000_000_000) as i32,
                (record.instant_ns % 1_000_000_000) as u32,
            ),
            level: if record.certainly_faulty == 0 { 0 } else { 2 },
            name: name.to_owned(),
            message: record.verdict().name().to_owned(),
            values,
        }
    }

    /// The numbers of the channels; false if a key is missing or its value is no number.
    pub fn read(&self, channels: &[String], record: &mut StepRecord) -> bool {
        let number = |place: usize, key: (&str, &str)| {
            let (found, value) = self.values.get(place)?;
            let rest = found.strip_prefix(key.0)?.strip_prefix(' ')?;
            (rest == key.1).then(|| value.parse().ok())?
        };
        let channel = |(i, name): (usize, &String)| {
            let part = |j: usize| number(1 + PARTS.len() * i + j, (name, PARTS[j]));
            Some(Channel {
                lower: part(0)?,
                residual: part(1)?,
                upper: part(2)?,
                ratio: part(3)?,
            })
        };
        let step = self
            .values
            .first()
            .and_then(|(key, value)| (key == "step").then(|| value.parse().ok())?);
        let Some(step) = step else { return false };
        record.step = step;
        record.instant_ns = self.stamp.0 as u64 * 1_000_000_000 + u64::from(self.stamp.1);
        for (place, target) in channels.iter().enumerate().zip(record.channels_mut()) {
            let Some(found) = channel(place) else { return false };
            *target = found;
        }
        true
    }

    /// The bytes of a `DiagnosticArray` with this one status.
    pub fn serialise(&self, bytes: &mut Vec<u8>) {
        bytes.clear();
        bytes.extend([0, 1, 0, 0]);
        number(bytes, self.stamp.0 as u32);
        number(bytes, self.stamp.1);
        text(bytes, "");
        number(bytes, 1);
        bytes.push(self.level);
        text(bytes, &self.name);
        text(bytes, &self.message);
        text(bytes, "");
        number(bytes, self.values.len() as u32);
        for (key, value) in &self.values {
            text(bytes, key);
            text(bytes, value);
        }
    }

    /// The status in these bytes; `None` if they are no such message.
    pub fn deserialise(bytes: &[u8]) -> Option<Self> {
        let mut rest = Reader { bytes, at: 4 };
        let stamp = (rest.number()? as i32, rest.number()?);
        rest.text()?;
        if rest.number()? != 1 {
            return None;
        }
        let level = rest.byte()?;
        let (name, message, _) = (rest.text()?, rest.text()?, rest.text()?);
        let count = rest.number()? as usize;
        // A value takes eight bytes at least.
        let mut values = Vec::with_capacity(count.min(bytes.len() / 8));
        for _ in 0..count {
            values.push((rest.text()?, rest.text()?));
        }
        Some(Self {
            stamp,
            level,
            name,
            message,
            values,
        })
    }
}

/// Aligned to four bytes behind the head of four bytes.
fn number(bytes: &mut Vec<u8>, number: u32) {
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    bytes.extend(number.to_le_bytes());
}

fn text(bytes: &mut Vec<u8>, text: &str) {
    number(bytes, text.len() as u32 + 1);
    bytes.extend(text.as_bytes());
    bytes.push(0);
}

struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Reader<'_> {
    fn take(&mut self, count: usize) -> Option<&[u8]> {
        let taken = self.bytes.get(self.at..self.at.checked_add(count)?)?;
        self.at += count;
        Some(taken)
    }

    fn byte(&mut self) -> Option<u8> {
        self.take(1).map(|bytes| bytes[0])
    }

    fn number(&mut self) -> Option<u32> {
        self.at = self.at.next_multiple_of(4);
        Some(u32::from_le_bytes(self.take(4)?.try_into().ok()?))
    }

    fn text(&mut self) -> Option<String> {
        let length = self.number()? as usize;
        let (_, text) = self.take(length)?.split_last()?;
        String::from_utf8(text.to_vec()).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record() -> StepRecord {
        let mut record = StepRecord::new(3);
        (record.step, record.instant_ns) = (77, 12_345_678_901);
        record.channels_mut()[0] = Channel::two_sided(-1.0 / 3.0, 5e-324);
        record.channels_mut()[1] = Channel::estimate(1e300, 0.1);
        record
    }

    #[test]
    fn every_number_comes_back_to_the_last_bit() {
        let names = ["a", "b", "c"].map(str::to_owned);
        let mut bytes = Vec::new();
        Diagnostic::of(&record(), "filter", &names).serialise(&mut bytes);
        let message = Diagnostic::deserialise(&bytes).unwrap();
        let mut read = StepRecord::new(3);
        assert!(message.read(&names, &mut read));
        assert!(read.same_bits(&record()));
        assert_eq!(
            (message.name.as_str(), message.message.as_str()),
            ("filter", "starting")
        );
    }

    #[test]
    fn foreign_keys_and_cut_messages_are_refused() {
        let names = ["a", "b", "c"].map(str::to_owned);
        let mut bytes = Vec::new();
        let message = Diagnostic::of(&record(), "filter", &names);
        message.serialise(&mut bytes);
        (4..bytes.len()).for_each(|length| assert!(Diagnostic::deserialise(&bytes[..length]).is_none()));
        let others = ["a", "x", "c"].map(str::to_owned);
        assert!(!message.read(&others, &mut StepRecord::new(3)));
    }
}
