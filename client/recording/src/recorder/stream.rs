//! All that a daemon says: the stream of its step records, and what its inputs receive.

use std::path::Path;

use residual_client::{AlarmEvent, AlarmListener, AlarmStart};
use residual_shared::alarm::AlarmTransition;
use residual_shared::bounds_table::{Liveness, TableReader};
use residual_shared::clock::monotonic_ns;
use residual_shared::counters::InputCounters;
use residual_shared::names::Instance;
use residual_shared::transport::{self, Node, RecordSubscriber, SampleSubscriber};

use super::RecordError;
use crate::header::Header;
use crate::message::{RecordMessage, SampleMessage};

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

/// What a daemon says from now on.
pub struct Stream {
    header: Header,
    table: TableReader,
    records: RecordSubscriber,
    samples: Vec<SampleSubscriber>,
    alarms: AlarmListener,
    /// Samples that the daemon had counted as lost at the beginning, by input.
    lost_before: Vec<u64>,
    /// When each input was looked at the last time.
    looked_ns: Vec<u64>,
    next_sequence: Option<u64>,
    lost_records: u64,
    lost_alarms: u64,
    // After the ports.
    _node: Node,
}

impl Stream {
    /// Connects to the daemon of `instance`; with its samples, if asked for.
    pub fn open(instance: &Instance, samples: bool) -> Result<Self, RecordError> {
        let table = TableReader::open(&instance.bounds_path())?;
        let node = transport::open_node(instance)?;
        let records = match table.liveness(monotonic_ns()) {
            Liveness::Closed => return Err(RecordError::NoDaemon(instance.name.to_string())),
            _ => RecordSubscriber::open(&node, instance)?,
        };
        let alarms = AlarmListener::open(instance, AlarmStart::Now)?;
        let mut header = Header::of(table.directory());
        let inputs = header.inputs.iter().filter(|_| samples);
        let subscribers = inputs.map(|input| SampleSubscriber::open(&node, instance, &input.name));
        let subscribers = subscribers.collect::<Result<Vec<_>, _>>()?;
        let began_ns = header.time.now_ns();
        // After the subscription: a sample that the daemon has not counted by now is received here as well.
        let counters = counters(&table);
        header.earlier_samples = counters.iter().map(received).sum();
        Ok(Self {
            lost_before: counters.iter().map(|counters| counters.lost).collect(),
            looked_ns: vec![began_ns; subscribers.len()],
            header,
            table,
            records,
            samples: subscribers,
            alarms,
            next_sequence: None,
            lost_records: 0,
            lost_alarms: 0,
            _node: node,
        })
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
        self.lost_records
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
        let (next, lost) = (&mut self.next_sequence, &mut self.lost_records);
        self.records.receive(|header, record| {
            let expected = next
                .replace(header.sequence.saturating_add(1))
                .unwrap_or(header.sequence);
            *lost += header.sequence.saturating_sub(expected);
            let message = RecordMessage {
                sequence: header.sequence,
                slot: usize::try_from(header.slot).unwrap_or(usize::MAX),
                record: *record,
            };
            all.push(Received::Record { message, received_ns });
        });
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
        while let Some(event) = self.alarms.try_next() {
            match event {
                AlarmEvent::Transition(alarm) if alarm.transition.number.epoch == self.header.epoch => {
                    all.push(Received::Alarm {
                        transition: alarm.transition,
                        received_ns,
                    });
                }
                AlarmEvent::Gap { first, last } => self.lost_alarms += last.saturating_sub(first) + 1,
                // Of another life of the daemon.
                AlarmEvent::Transition(_) | AlarmEvent::NewNumbering { .. } => {}
            }
        }
        all
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
