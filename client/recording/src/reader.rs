//! Reads a recording from beginning to end, message by message.

use std::collections::HashMap;
use std::fs::File;
use std::io::{self, BufReader, Read as _};
use std::path::{Path, PathBuf};

use mcap::McapError;
use mcap::records::{Channel, Record};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};

use residual_shared::alarm::AlarmTransition;

use crate::header::{self, Header};
use crate::message::{MessageError, RecordMessage, SampleMessage, alarm};
use crate::totals::{self, Totals};
use crate::writer::{ALARMS, KIND, OF, RECORDS, SAMPLES};

/// Longest record that a recording may have, bytes: more than a second of everything.
const LONGEST_RECORD: usize = 1 << 30;

/// Why a recording could not be read.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// The file cannot be read.
    #[error("cannot read `{path}`: {source}")]
    File {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// The file is no MCAP file, or a damaged one.
    #[error("`{path}` is no MCAP file, or damaged: {source}")]
    Mcap {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: McapError,
    },
    /// The file is not a recording of this program.
    #[error("`{0}` is an MCAP file, but no recording of a residuald daemon; make one with `residual record`")]
    Foreign(PathBuf),
    /// A word of the header or of the totals is missing or has no meaning.
    #[error("`{path}`: `{key}` of the metadata `{name}` is missing or of another version of this program")]
    Metadata {
        /// The file.
        path: PathBuf,
        /// The metadata record.
        name: &'static str,
        /// The word's key.
        key: &'static str,
    },
    /// A message cannot be read.
    #[error("`{path}`: a message of `{topic}` cannot be read: {source}")]
    Message {
        /// The file.
        path: PathBuf,
        /// Its topic.
        topic: String,
        /// What is wrong.
        source: MessageError,
    },
}

/// One message of a recording.
#[derive(Clone, Debug)]
#[expect(
    clippy::large_enum_variant,
    reason = "handed over one at a time, never stored in numbers"
)]
pub enum Event {
    /// A step record.
    Record(RecordMessage),
    /// A sample.
    Sample(SampleMessage),
    /// An alarm transition.
    Alarm(AlarmTransition),
}

/// What the messages of a topic are.
enum Kind {
    Records {
        slot: usize,
        keys: Vec<String>,
    },
    Samples {
        input: usize,
        keys: Vec<String>,
    },
    Alarms,
    /// Somebody else's.
    Foreign,
}

/// Reads a recording.
pub struct Reader {
    path: PathBuf,
    file: BufReader<File>,
    records: LinearReader,
    header: Header,
    topics: HashMap<u16, (String, Kind)>,
    totals: Option<Totals>,
    cut_off: bool,
}

impl Reader {
    /// Opens a recording and reads its header.
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        let failed = |source| ReadError::File {
            path: path.into(),
            source,
        };
        let options = LinearReaderOptions::default()
            .with_prevalidate_chunk_crcs(true)
            .with_record_length_limit(LONGEST_RECORD);
        let mut file = BufReader::new(File::open(path).map_err(failed)?);
        let mut records = LinearReader::new_with_options(options);
        let header = loop {
            match next(&mut records, &mut file, path)? {
                Next::Record(Record::Metadata(metadata)) if metadata.name == header::NAME => {
                    break Header::from_metadata(&metadata.metadata).map_err(|key| ReadError::Metadata {
                        path: path.into(),
                        name: header::NAME,
                        key,
                    })?;
                }
                // The header stands before all messages.
                Next::Record(Record::Message { .. }) | Next::CutOff | Next::End => {
                    return Err(ReadError::Foreign(path.into()));
                }
                Next::Record(_) => {}
            }
        };
        Ok(Self {
            path: path.into(),
            file,
            records,
            header,
            topics: HashMap::new(),
            totals: None,
            cut_off: false,
        })
    }

    /// What the recording says about itself.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// The totals, once everything has been read; none in a recording without end.
    pub fn totals(&self) -> Option<&Totals> {
        self.totals.as_ref()
    }

    /// Whether the end of the recording is missing, once everything has been read: its recorder was killed.
    pub fn is_cut_off(&self) -> bool {
        self.cut_off
    }

    /// The next message in the order in which they were received; `None` at the end.
    pub fn next_event(&mut self) -> Result<Option<Event>, ReadError> {
        while !self.cut_off {
            let record = match next(&mut self.records, &mut self.file, &self.path)? {
                Next::Record(record) => record,
                Next::CutOff => {
                    self.cut_off = true;
                    break;
                }
                Next::End => break,
            };
            match record {
                Record::Channel(channel) => {
                    let kind = self.kind(&channel);
                    self.topics.insert(channel.id, (channel.topic, kind));
                }
                Record::Metadata(metadata) if metadata.name == totals::NAME => {
                    let totals = Totals::from_metadata(&metadata.metadata);
                    self.totals = Some(totals.map_err(|key| ReadError::Metadata {
                        path: self.path.clone(),
                        name: totals::NAME,
                        key,
                    })?);
                }
                Record::Message { header, data } => {
                    if let Some(event) = self.event(header.channel_id, &data)? {
                        return Ok(Some(event));
                    }
                }
                _ => {}
            }
        }
        Ok(None)
    }

    fn event(&self, channel: u16, json: &[u8]) -> Result<Option<Event>, ReadError> {
        let Some((topic, kind)) = self.topics.get(&channel) else {
            return Ok(None);
        };
        let event = match kind {
            Kind::Records { slot, keys } => RecordMessage::read(json, *slot, keys).map(Event::Record),
            Kind::Samples { input, keys } => SampleMessage::read(json, *input, keys).map(Event::Sample),
            Kind::Alarms => alarm::read(json).map(Event::Alarm),
            Kind::Foreign => return Ok(None),
        };
        event.map(Some).map_err(|source| ReadError::Message {
            path: self.path.clone(),
            topic: topic.clone(),
            source,
        })
    }

    fn kind(&self, channel: &Channel) -> Kind {
        let word = |key| channel.metadata.get(key).map_or("", String::as_str);
        let header = &self.header;
        match word(KIND) {
            RECORDS => {
                let slot = header.diagnosers.iter().position(|other| other.name == word(OF));
                slot.and_then(|slot| {
                    let keys = header.diagnosers.get(slot)?.channel_keys();
                    Some(Kind::Records { slot, keys })
                })
            }
            SAMPLES => {
                let input = header.inputs.iter().position(|other| other.name == word(OF));
                input.and_then(|input| {
                    let keys = header.inputs.get(input)?.signal_keys();
                    Some(Kind::Samples { input, keys })
                })
            }
            ALARMS => Some(Kind::Alarms),
            _ => None,
        }
        .unwrap_or(Kind::Foreign)
    }
}

enum Next {
    Record(Record<'static>),
    CutOff,
    End,
}

/// The next record of the file; chunks are unpacked.
fn next(records: &mut LinearReader, file: &mut BufReader<File>, path: &Path) -> Result<Next, ReadError> {
    let damaged = |source| ReadError::Mcap {
        path: path.into(),
        source,
    };
    while let Some(event) = records.next_event() {
        match event {
            Ok(LinearReadEvent::ReadRequest(bytes)) => {
                let count = file
                    .read(records.insert(bytes))
                    .map_err(|source| ReadError::File {
                        path: path.into(),
                        source,
                    })?;
                records.notify_read(count);
            }
            Ok(LinearReadEvent::Record { data, opcode }) => {
                let record = mcap::parse_record(opcode, data).map_err(damaged)?;
                return Ok(Next::Record(record.into_owned()));
            }
            Err(McapError::UnexpectedEof) => return Ok(Next::CutOff),
            Err(error) => return Err(damaged(error)),
        }
    }
    Ok(Next::End)
}
