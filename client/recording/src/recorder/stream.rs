//! All that a daemon says: the stream of its step records, and what its inputs receive.

use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::path::Path;

use residual_client::{AlarmEvent, AlarmListener, AlarmStart, StepRecords};
use residual_shared::alarm::AlarmTransition;
use residual_shared::bounds_table::{Liveness, TableReader};
use residual_shared::clock::monotonic_ns;
use residual_shared::counters::InputCounters;
use residual_shared::names::Instance;
use residual_shared::record::StepRecord;
use residual_shared::transport::{self, Node, RecordHeader, SampleSubscriber};

use super::RecordError;
use crate::header::Header;
use crate::message::{RecordMessage, SampleMessage};
use crate::totals::SequenceGaps;

/// Something that was received.
#[derive(Clone, Debug)]
#[expect(clippy::large_enum_variant, reason = "most of them are records")]
pub enum Received {
    /// A step record.
    Record {
        /// The record.
        message: RecordMessage,
        /// When it was received, nanoseconds of the daemon's time.
        received_ns: u64,
    },
    /// A sample.
    Sample(SampleMessage),
    /// An alarm transition.
    Alarm {
        /// The transition.
        transition: AlarmTransition,
        /// When it was received, nanoseconds of the daemon's time.
        received_ns: u64,
    },
}

/// What a daemon says from now on, until its table is replaced: by a reload, or by a restart of the daemon. What it
/// says then, of slots that may be other diagnosers, is kept for the next stream, [`next`](Self::next).
pub struct Stream {
    instance: Instance,
    header: Header,
    table: TableReader,
    records: StepRecords,
    samples: Vec<SampleSubscriber>,
    alarms: AlarmListener,
    /// Samples that the daemon had counted as lost at the beginning, by input.
    lost_before: Vec<u64>,
    /// When each input was looked at the last time.
    looked_ns: Vec<u64>,
    /// Epoch of the stream before; what is of an epoch in between has no table any more.
    previous_epoch: Option<u64>,
    /// Where the samples of the recording before ended, by topic.
    pub(super) sample_gaps: BTreeMap<String, SequenceGaps>,
    /// Received, but of a later table.
    later_records: Vec<(RecordHeader, StepRecord)>,
    /// Received, but of a later table.
    later_alarms: Vec<AlarmTransition>,
    /// Records that had been lost at the beginning.
    lost_records_before: u64,
    /// Records of an epoch without table.
    nameless_records: u64,
    lost_alarms: u64,
    // After the ports.
    node: Node,
}

impl Stream {
    /// Connects to the daemon of `instance`; with its samples, if asked for.
    pub fn open(instance: &Instance, samples: bool) -> Result<Self, RecordError> {
        let table = TableReader::open(&instance.bounds_path())?;
        let node = transport::open_node(instance)?;
        let records = match table.liveness(monotonic_ns()) {
            Liveness::Closed => return Err(RecordError::NoDaemon(instance.name.to_string())),
            _ => StepRecords::open(instance)?,
        };
        let alarms = AlarmListener::open(instance, AlarmStart::Now)?;
        let mut stream = Self {
            instance: instance.clone(),
            header: Header::of(table.directory()),
            table,
            records,
            samples: Vec::new(),
            alarms,
            lost_before: Vec::new(),
            looked_ns: Vec::new(),
            previous_epoch: None,
            sample_gaps: BTreeMap::new(),
            later_records: Vec::new(),
            later_alarms: Vec::new(),
            lost_records_before: 0,
            nameless_records: 0,
            lost_alarms: 0,
            node,
        };
        stream.begin(samples, &mut Vec::new())?;
        Ok(stream)
    }

    /// The stream of what the daemon says since its table was replaced. Nothing is lost in between: what has come
    /// already comes with the first look.
    pub fn next(mut self) -> Result<Self, RecordError> {
        self.table = TableReader::open(&self.instance.bounds_path())?;
        let configuration = self.header.configuration.take();
        let before = std::mem::replace(&mut self.header, Header::of(self.table.directory()));
        self.header.configuration = configuration;
        self.previous_epoch = Some(before.epoch);
        self.lost_records_before = self.records.counts().lost;
        (self.nameless_records, self.lost_alarms) = (0, 0);
        let samples = self.has_samples();
        let names = before.inputs.into_iter().map(|input| input.name);
        let mut open = names.zip(std::mem::take(&mut self.samples)).collect();
        self.begin(samples, &mut open)?;
        Ok(self)
    }

    /// Subscribes to the samples if asked for, but for those of the inputs that are `open` already, and remembers
    /// what has been counted so far.
    fn begin(
        &mut self,
        samples: bool,
        open: &mut Vec<(String, SampleSubscriber)>,
    ) -> Result<(), RecordError> {
        for input in self.header.inputs.iter().filter(|_| samples) {
            let subscriber = match open.iter().position(|(name, _)| *name == input.name) {
                Some(position) => open.swap_remove(position).1,
                None => SampleSubscriber::open(&self.node, &self.instance, &input.name)?,
            };
            self.samples.push(subscriber);
        }
        self.looked_ns = vec![self.header.time.now_ns(); self.samples.len()];
        // After the subscription: a sample that the daemon has not counted by now is received here as well.
        let counters = counters(&self.table);
        self.header.earlier_samples = counters.iter().map(received).sum();
        self.lost_before = counters.iter().map(|counters| counters.lost).collect();
        Ok(())
    }

    /// What a recording of this stream says about itself.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// Names the daemon's configuration file in the recording.
    pub fn set_configuration(&mut self, path: &Path) {
        self.header.configuration = Some(path.into());
    }

    /// The slots of the named diagnosers; of all if none is named.
    pub fn slots(&self, names: &[String]) -> Result<Vec<usize>, RecordError> {
        let diagnosers = &self.header.diagnosers;
        if names.is_empty() {
            return Ok((0..diagnosers.len()).collect());
        }
        let slot = |name: &String| {
            let position = diagnosers.iter().position(|diagnoser| diagnoser.name == *name);
            position.ok_or_else(|| RecordError::NoSuchDiagnoser {
                name: name.clone(),
                known: diagnosers
                    .iter()
                    .map(|diagnoser| diagnoser.name.as_str())
                    .collect::<Vec<_>>()
                    .join(", "),
            })
        };
        names.iter().map(slot).collect()
    }

    /// Whether it has the samples of the inputs.
    pub fn has_samples(&self) -> bool {
        !self.samples.is_empty()
    }

    /// Records that were lost on the way here.
    pub fn lost_records(&self) -> u64 {
        self.records.counts().lost - self.lost_records_before + self.nameless_records
    }

    /// Alarm transitions that were overwritten before they could be read here.
    pub fn lost_alarms(&self) -> u64 {
        self.lost_alarms
    }

    /// Samples that were lost on the way here and that the daemon has, when `missing` of each input are missing.
    pub(super) fn lost_samples(&self, missing: impl Iterator<Item = u64>) -> u64 {
        let lost_at_daemon = counters(&self.table)
            .into_iter()
            .zip(&self.lost_before)
            .map(|(now, before)| now.lost.saturating_sub(*before));
        missing
            .zip(lost_at_daemon)
            .map(|(here, there)| here.saturating_sub(there))
            .sum()
    }

    /// All that has come since the last look. First the records, so that the samples of each of them are there.
    pub fn look(&mut self) -> Vec<Received> {
        let mut all = Vec::new();
        let time = self.header.time;
        let received_ns = time.now_ns();
        let mut records = std::mem::take(&mut self.later_records);
        self.records
            .receive(|header, record| records.push((header, *record)));
        for (header, record) in records {
            match header.epoch.cmp(&self.header.epoch) {
                Ordering::Equal => {
                    let message = RecordMessage {
                        sequence: header.sequence,
                        slot: usize::try_from(header.slot).unwrap_or(usize::MAX),
                        record,
                    };
                    all.push(Received::Record { message, received_ns });
                }
                Ordering::Greater => self.later_records.push((header, record)),
                Ordering::Less => self.nameless_records += u64::from(self.is_nameless(header.epoch)),
            }
        }
        for (input, (subscriber, looked_ns)) in self.samples.iter().zip(&mut self.looked_ns).enumerate() {
            let began_ns = time.now_ns();
            let first = all.len();
            subscriber.receive(|publisher, header, elements| {
                all.push(Received::Sample(SampleMessage {
                    input,
                    publisher,
                    header,
                    looked_ns: *looked_ns,
                    received_ns: began_ns,
                    elements: elements.to_vec(),
                }));
            });
            let ended_ns = time.now_ns();
            for received in all.iter_mut().skip(first) {
                if let Received::Sample(sample) = received {
                    sample.received_ns = ended_ns;
                }
            }
            *looked_ns = began_ns;
        }
        let mut alarms = std::mem::take(&mut self.later_alarms);
        while let Some(event) = self.alarms.try_next() {
            match event {
                AlarmEvent::Transition(alarm) => alarms.push(alarm.transition),
                AlarmEvent::Gap { first, last } => self.lost_alarms += last.saturating_sub(first) + 1,
                AlarmEvent::NewNumbering { .. } => {}
            }
        }
        for transition in alarms {
            match transition.number.epoch.cmp(&self.header.epoch) {
                Ordering::Equal => all.push(Received::Alarm {
                    transition,
                    received_ns,
                }),
                Ordering::Greater => self.later_alarms.push(transition),
                Ordering::Less => self.lost_alarms += u64::from(self.is_nameless(transition.number.epoch)),
            }
        }
        all
    }

    /// Whether something of an epoch before this stream's came after the end of the stream before it.
    fn is_nameless(&self, epoch: u64) -> bool {
        self.previous_epoch.is_some_and(|previous| epoch > previous)
    }

    /// Whether a record of a later table has come, behind the last one of this stream's.
    pub(super) fn has_later_records(&self) -> bool {
        !self.later_records.is_empty()
    }

    /// Whether there is a later table.
    pub(super) fn is_replaced(&self) -> bool {
        self.table.is_replaced()
    }

    /// Whether the daemon has stopped, was killed, or has been started anew.
    pub fn daemon_has_ended(&self) -> bool {
        match self.table.liveness(monotonic_ns()) {
            Liveness::Running => false,
            Liveness::Closed => true,
            // Without sign of life: killed, or stopped for a while.
            Liveness::Hung(_) => !Path::new("/proc").join(self.header.pid.to_string()).exists(),
        }
    }
}

/// The door counters of all inputs.
fn counters(table: &TableReader) -> Vec<InputCounters> {
    let inputs = 0..table.directory().spec.inputs.len();
    inputs
        .filter_map(|input| table.read_input_counters(input).ok())
        .collect()
}

/// Samples that have come to a door.
fn received(counters: &InputCounters) -> u64 {
    counters.accepted
        + counters.non_finite
        + counters.wrong_length
        + counters.duplicate
        + counters.backward
        + counters.too_far_ahead
}
