//! Writes a recording.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufWriter, Seek, Write};
use std::path::Path;

use mcap::records::{MessageHeader, Metadata};
use mcap::{McapError, WriteOptions};
use residual_shared::alarm::AlarmTransition;
use serde_json::Value;

use crate::header::{self, Header};
use crate::message::{self, RecordMessage, SampleMessage};
use crate::totals::{self, SequenceGaps, StepGaps, TopicTotals, Totals};
use crate::{schema, topic};

/// Key of a topic's metadata: what its messages are.
pub(crate) const KIND: &str = "kind";
/// Key of a topic's metadata: the diagnoser or input.
pub(crate) const OF: &str = "of";
/// Kind: step records.
pub(crate) const RECORDS: &str = "records";
/// Kind: alarm transitions.
pub(crate) const ALARMS: &str = "alarms";
/// Kind: samples.
pub(crate) const SAMPLES: &str = "samples";

/// Why a recording could not be written.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// The file cannot be made, or is there already.
    #[error("cannot create the recording: {0}; choose another file with --output")]
    Create(io::Error),
    /// The file cannot be written, for instance because its disk is full.
    #[error("cannot write the recording: {0}")]
    Write(#[from] McapError),
    /// A message cannot be made.
    #[error("cannot write a message: {0}")]
    Message(#[from] serde_json::Error),
    /// The writing thread ended abnormally.
    #[error("the thread that writes the recording ended abnormally")]
    Thread,
}

/// Writes a recording; [`finish`](Self::finish) makes it whole.
pub struct Writer<W: Write + Seek> {
    mcap: mcap::Writer<W>,
    header: Header,
    records: Vec<Option<RecordTopic>>,
    samples: Vec<SampleTopic>,
    alarms: Topic,
    json: Vec<u8>,
}

struct Topic {
    name: String,
    channel: u16,
    keys: Vec<String>,
    totals: TopicTotals,
}

struct RecordTopic {
    topic: Topic,
    gaps: StepGaps,
}

struct SampleTopic {
    topic: Topic,
    gaps: SequenceGaps,
    missing: i64,
}

impl Writer<BufWriter<File>> {
    /// Creates the file, which must not be there yet; see [`new`](Self::new).
    pub fn create(path: &Path, header: Header, slots: &[usize], samples: bool) -> Result<Self, WriteError> {
        let file = File::create_new(path).map_err(WriteError::Create)?;
        Self::new(BufWriter::new(file), header, slots, samples)
    }
}

impl<W: Write + Seek> Writer<W> {
    /// A recording of the diagnosers in `slots`, with or without the samples of the inputs.
    pub fn new(into: W, header: Header, slots: &[usize], samples: bool) -> Result<Self, WriteError> {
        let options = WriteOptions::new()
            .library(concat!("residual-recording ", env!("CARGO_PKG_VERSION")))
            // A chunk is written as a whole when it is flushed, so that a killed recorder leaves no half of one.
            .disable_seeking(true)
            .chunk_size(None)
            .compression_threads(0);
        let mut mcap = options.create(into)?;
        mcap.write_metadata(&Metadata {
            name: header::NAME.into(),
            metadata: header.to_metadata(),
        })?;
        let mut records = Vec::new();
        for (slot, diagnoser) in header.diagnosers.iter().enumerate() {
            let keys = diagnoser.channel_keys();
            let schema = schema::record(diagnoser, &keys);
            let name = topic::records(&header.instance, &diagnoser.name);
            let add = || Topic::add(&mut mcap, name, RECORDS, &diagnoser.name, keys, &schema);
            let topic = slots.contains(&slot).then(add).transpose()?;
            records.push(topic.map(|topic| RecordTopic {
                topic,
                gaps: StepGaps::default(),
            }));
        }
        let alarms = topic::alarms(&header.instance);
        let alarms = Topic::add(&mut mcap, alarms, ALARMS, "", Vec::new(), &schema::alarm())?;
        let mut sample_topics = Vec::new();
        for input in header.inputs.iter().filter(|_| samples) {
            let keys = input.signal_keys();
            let schema = schema::sample(input, &keys);
            let name = topic::samples(&header.instance, &input.name);
            sample_topics.push(SampleTopic {
                topic: Topic::add(&mut mcap, name, SAMPLES, &input.name, keys, &schema)?,
                gaps: SequenceGaps::default(),
                missing: 0,
            });
        }
        Ok(Self {
            mcap,
            header,
            records,
            samples: sample_topics,
            alarms,
            json: Vec::new(),
        })
    }

    /// Writes a record received at `received_ns` (daemon's time), unless its diagnoser is not recorded.
    pub fn write_record(&mut self, message: &RecordMessage, received_ns: u64) -> Result<(), WriteError> {
        let diagnoser = self.header.diagnosers.get(message.slot);
        let topic = self.records.get_mut(message.slot).and_then(Option::as_mut);
        let (Some(diagnoser), Some(RecordTopic { topic, gaps })) = (diagnoser, topic) else {
            return Ok(());
        };
        let missing = gaps.follow(&message.record);
        topic.totals.missing = topic.totals.missing.saturating_add(missing);
        self.json.clear();
        message.write(&diagnoser.faults, &topic.keys, &mut self.json)?;
        let times = [received_ns, message.record.instant_ns].map(|time| self.header.wall_clock_ns(time));
        topic.write(&mut self.mcap, message.sequence, times, &self.json)
    }

    /// Writes an alarm transition received at `received_ns` (daemon's time), unless its diagnoser is not recorded.
    pub fn write_alarm(&mut self, transition: &AlarmTransition, received_ns: u64) -> Result<(), WriteError> {
        let slot = usize::try_from(transition.slot).unwrap_or(usize::MAX);
        if matches!(self.records.get(slot), Some(None)) {
            return Ok(());
        }
        self.json.clear();
        message::alarm::write(transition, &self.header.diagnosers, &mut self.json)?;
        let times = [received_ns, transition.instant_ns].map(|time| self.header.wall_clock_ns(time));
        let number = transition.number.number;
        self.alarms.write(&mut self.mcap, number, times, &self.json)
    }

    /// Writes a sample, if the samples are recorded.
    pub fn write_sample(&mut self, message: &SampleMessage) -> Result<(), WriteError> {
        let Some(SampleTopic { topic, gaps, missing }) = self.samples.get_mut(message.input) else {
            return Ok(());
        };
        *missing = missing.saturating_add(gaps.follow(message.publisher, &message.header));
        topic.totals.missing = (*missing).max(0).cast_unsigned();
        self.json.clear();
        message.write(&topic.keys, &mut self.json)?;
        let times = [message.received_ns, message.header.timestamp_ns];
        let times = times.map(|time| self.header.wall_clock_ns(time));
        topic.write(&mut self.mcap, message.header.sequence, times, &self.json)
    }

    /// Writes out all that was given so far: a recorder that is killed afterwards does not lose it.
    pub fn flush(&mut self) -> Result<(), WriteError> {
        Ok(self.mcap.flush()?)
    }

    /// Messages and missing ones by topic so far.
    pub fn topics(&self) -> BTreeMap<String, TopicTotals> {
        let records = self.records.iter().flatten().map(|records| &records.topic);
        let samples = self.samples.iter().map(|samples| &samples.topic);
        let topics = records.chain(samples).chain([&self.alarms]);
        topics.map(|topic| (topic.name.clone(), topic.totals)).collect()
    }

    /// Missing samples by input so far.
    pub(crate) fn missing_samples(&self) -> impl Iterator<Item = u64> {
        self.samples.iter().map(|samples| samples.topic.totals.missing)
    }

    /// Which samples came last, by topic: for the recording that goes on behind this one.
    pub(crate) fn sample_gaps(&self) -> BTreeMap<String, SequenceGaps> {
        let samples = self.samples.iter();
        samples
            .map(|samples| (samples.topic.name.clone(), samples.gaps.clone()))
            .collect()
    }

    /// Counts samples as missing that lie between the recording before and this one.
    pub(crate) fn go_on_behind(&mut self, gaps: &BTreeMap<String, SequenceGaps>) {
        for samples in &mut self.samples {
            if let Some(gaps) = gaps.get(&samples.topic.name) {
                samples.gaps = gaps.clone();
            }
        }
    }

    /// Writes the totals and the end of the file.
    pub fn finish(mut self, totals: &Totals) -> Result<(), WriteError> {
        self.mcap.write_metadata(&Metadata {
            name: totals::NAME.into(),
            metadata: totals.to_metadata(),
        })?;
        self.mcap.finish()?;
        self.mcap
            .into_inner()
            .flush()
            .map_err(|error| WriteError::Write(error.into()))
    }
}

impl Topic {
    fn add<W: Write + Seek>(
        mcap: &mut mcap::Writer<W>,
        name: String,
        kind: &str,
        of: &str,
        keys: Vec<String>,
        schema: &Value,
    ) -> Result<Self, WriteError> {
        let title = format!("residual.{kind}.{of}");
        let title = title.trim_end_matches('.');
        let schema = mcap.add_schema(title, "jsonschema", schema.to_string().as_bytes())?;
        let words = [(KIND, kind), (OF, of)].map(|(key, word)| (key.to_owned(), word.to_owned()));
        let channel = mcap.add_channel(schema, &name, "json", &words.into())?;
        Ok(Self {
            name,
            channel,
            keys,
            totals: TopicTotals::default(),
        })
    }

    /// Writes a message received and published at `times` (wall clock).
    fn write<W: Write + Seek>(
        &mut self,
        mcap: &mut mcap::Writer<W>,
        sequence: u64,
        [log_time, publish_time]: [u64; 2],
        json: &[u8],
    ) -> Result<(), WriteError> {
        self.totals.messages += 1;
        let header = MessageHeader {
            channel_id: self.channel,
            sequence: sequence as u32,
            log_time,
            publish_time,
        };
        Ok(mcap.write_to_known_channel(&header, json)?)
    }
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use residual_shared::clock::DaemonTime;
    use residual_shared::sample::SampleHeader;

    use super::*;
    use crate::header::Input;

    #[test]
    fn samples_between_two_recordings_are_missing_in_the_second_one() {
        let header = Header {
            instance: "car".into(),
            epoch: 1,
            pid: 1,
            time: DaemonTime::MONOTONIC,
            wall_clock_offset_ns: 0,
            schedule_epoch_ns: 0,
            configuration: None,
            earlier_samples: 0,
            diagnosers: vec![],
            inputs: vec![Input {
                name: "imu".into(),
                signals: vec!["ax".into()],
            }],
        };
        let sample = |sequence| SampleMessage {
            input: 0,
            publisher: 7,
            header: SampleHeader {
                sequence,
                timestamp_ns: 0,
            },
            looked_ns: 0,
            received_ns: 0,
            elements: vec![0.5],
        };
        let writer = || Writer::new(Cursor::new(Vec::new()), header.clone(), &[], true).unwrap();
        let mut first = writer();
        first.write_sample(&sample(4)).unwrap();
        let mut second = writer();
        second.go_on_behind(&first.sample_gaps());
        second.write_sample(&sample(8)).unwrap();
        let missing = |writer: &Writer<_>| writer.missing_samples().collect::<Vec<_>>();
        assert_eq!((missing(&first), missing(&second)), (vec![0], vec![3]));
    }
}
