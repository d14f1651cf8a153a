//! Whether the records of an MCAP recording come out of a replay again.

use std::collections::VecDeque;
use std::fmt::Write as _;

use residual_recording::{Event, Reader};
use residual_shared::record::{StepRecord, flags};

use super::recorded::{Recorded, RecordedError};
use super::records::ReplayRecord;
use crate::configuration::Configuration;

/// Compares replayed records with recorded ones as they come, without holding more than a few of either.
pub struct Comparison {
    reader: Reader,
    /// Name and slot in the recording of each configured diagnoser, if it is recorded.
    diagnosers: Vec<(String, Option<usize>)>,
    /// By slot of the recording.
    waiting: Vec<VecDeque<StepRecord>>,
    outcomes: Vec<Agreement>,
}

/// How the records of one diagnoser agree.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Agreement {
    /// Records that are the same to the last bit.
    pub same: u64,
    /// Records that are the same but for the flag of an overrun: the daemon was late, which no replay is.
    pub same_but_late: u64,
    /// Records that differ otherwise.
    pub different: u64,
    /// Recorded ones that the replay does not have.
    pub not_replayed: u64,
    /// Step and first difference of the first record that differs.
    pub first_difference: Option<(u64, String)>,
}

impl Comparison {
    /// Compares with the records of `recorded`.
    pub fn new(recorded: &Recorded, configuration: &Configuration) -> Result<Self, RecordedError> {
        let header = recorded.header();
        let slot_of = |name: &str| {
            header
                .diagnosers
                .iter()
                .position(|diagnoser| diagnoser.name == name)
        };
        let configured = configuration.diagnosers.iter();
        let diagnosers: Vec<_> = configured
            .map(|diagnoser| (diagnoser.name.clone(), slot_of(&diagnoser.name)))
            .collect();
        Ok(Self {
            reader: recorded.reread()?,
            waiting: vec![VecDeque::new(); header.diagnosers.len()],
            outcomes: vec![Agreement::default(); diagnosers.len()],
            diagnosers,
        })
    }

    /// Takes the next replayed record.
    pub fn take(&mut self, replayed: &ReplayRecord) -> Result<(), RecordedError> {
        let Some((_, Some(slot))) = self.diagnosers.get(replayed.slot) else {
            return Ok(());
        };
        let slot = *slot;
        let outcome = &mut self.outcomes[replayed.slot];
        loop {
            while let Some(recorded) = self.waiting[slot].front() {
                if recorded.step > replayed.record.step {
                    return Ok(());
                }
                if recorded.step == replayed.record.step {
                    outcome.compare(recorded, &replayed.record);
                    self.waiting[slot].pop_front();
                    return Ok(());
                }
                outcome.not_replayed += 1;
                self.waiting[slot].pop_front();
            }
            match self.reader.next_event()? {
                Some(Event::Record(message)) => self.waiting[message.slot].push_back(message.record),
                Some(_) => {}
                None => return Ok(()),
            }
        }
    }

    /// Ends the comparison; gives the name of each diagnoser with what was found.
    pub fn finish(mut self) -> Result<Vec<(String, Agreement)>, RecordedError> {
        while let Some(event) = self.reader.next_event()? {
            if let Event::Record(message) = event {
                self.waiting[message.slot].push_back(message.record);
            }
        }
        let waiting = &self.waiting;
        let outcomes = self.diagnosers.into_iter().zip(self.outcomes);
        Ok(outcomes
            .map(|((name, slot), mut outcome)| {
                outcome.not_replayed += slot.map_or(0, |slot| waiting[slot].len() as u64);
                (name, outcome)
            })
            .collect())
    }
}

impl Agreement {
    /// Whether there are recorded records and all of them came out again, overruns left aside.
    pub fn is_complete(&self) -> bool {
        self.same + self.same_but_late > 0 && self.different == 0 && self.not_replayed == 0
    }

    fn compare(&mut self, recorded: &StepRecord, replayed: &StepRecord) {
        if recorded.same_bits(replayed) {
            self.same += 1;
            return;
        }
        let punctual = StepRecord {
            flags: recorded.flags & !flags::OVERRUN,
            ..*recorded
        };
        if punctual.same_bits(replayed) {
            self.same_but_late += 1;
            return;
        }
        self.different += 1;
        if self.first_difference.is_none() {
            self.first_difference = Some((recorded.step, difference(recorded, replayed)));
        }
    }

    /// In words.
    pub fn describe(&self) -> String {
        let all = self.same + self.same_but_late + self.different + self.not_replayed;
        if all == 0 {
            return "no records in the recording to compare with".into();
        }
        let mut text = format!(
            "{} of {all} recorded records are the same to the last bit",
            self.same
        );
        // Writing to a text cannot fail.
        if self.same_but_late > 0 {
            let _ = write!(
                text,
                "; {} are the same but for the flag of an overrun: the daemon was late there",
                self.same_but_late
            );
        }
        if let Some((step, what)) = &self.first_difference {
            let _ = write!(text, "; the first that differs is that of step {step}: {what}");
        }
        if self.not_replayed > 0 {
            let _ = write!(text, "; {} have no counterpart", self.not_replayed);
        }
        text
    }
}

/// The first part of a record that differs.
fn difference(recorded: &StepRecord, replayed: &StepRecord) -> String {
    let heads = |record: &StepRecord| {
        [
            ("instant_ns", record.instant_ns),
            ("flags", u64::from(record.flags)),
            ("inputs_valid", record.inputs_valid),
            ("skipped_instants", u64::from(record.skipped_instants)),
            ("channels", u64::from(record.channel_count)),
            ("verdict", u64::from(record.verdict)),
            ("certainly_faulty", record.certainly_faulty),
            ("possibly_faulty", record.possibly_faulty),
        ]
    };
    for ((name, recorded), (_, replayed)) in heads(recorded).into_iter().zip(heads(replayed)) {
        if recorded != replayed {
            return format!("{name} was {recorded} and is {replayed}");
        }
    }
    for (index, (recorded, replayed)) in recorded.channels().iter().zip(replayed.channels()).enumerate() {
        let bits = |channel: &residual_shared::record::Channel| {
            [channel.lower, channel.residual, channel.upper, channel.ratio].map(f64::to_bits)
        };
        if bits(recorded) != bits(replayed) {
            return format!("channel {index} was {recorded:?} and is {replayed:?}");
        }
    }
    "the fault estimate".into()
}
