//! What was recorded and what was lost: the metadata record at the end of a recording.

use std::collections::{BTreeMap, HashMap};

use residual_shared::record::StepRecord;
use residual_shared::sample::SampleHeader;
use serde::{Deserialize, Serialize};

/// Name of the metadata record.
pub(crate) const NAME: &str = "residual.totals";

/// Messages of a recording, and known losses.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Totals {
    /// By topic.
    pub topics: BTreeMap<String, TopicTotals>,
    /// Records of all diagnosers that were lost between daemon and recorder, by the numbers of the stream.
    pub lost_records: u64,
    /// Samples that the recorder missed and the daemon had; what neither had was lost before both.
    pub lost_samples: u64,
    /// Alarm transitions that the ring no longer held when the recorder came to read them.
    pub lost_alarms: u64,
    /// Why the recording ended.
    pub end: Option<End>,
}

/// One topic.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TopicTotals {
    /// Messages in the file.
    pub messages: u64,
    /// Messages that should be there and are not: sampling instants without record and not skipped either, or
    /// missing sequence numbers of samples, whoever lost them.
    pub missing: u64,
}

/// Why a recording ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum End {
    /// The recorder was told to end, or its time was over.
    Asked,
    /// The daemon ended.
    DaemonEnded,
    /// The daemon read its configuration again, or was started anew: its slots may be other diagnosers now.
    TableReplaced,
}

impl Totals {
    /// Whether something was lost on the way from the daemon to the file.
    pub fn is_complete(&self) -> bool {
        self.lost_records == 0 && self.lost_samples == 0 && self.lost_alarms == 0
    }

    /// As the texts of a metadata record.
    pub(crate) fn to_metadata(&self) -> BTreeMap<String, String> {
        let mut texts = BTreeMap::from([
            ("lost_records".to_owned(), self.lost_records.to_string()),
            ("lost_samples".to_owned(), self.lost_samples.to_string()),
            ("lost_alarms".to_owned(), self.lost_alarms.to_string()),
        ]);
        let topics = serde_json::to_string(&self.topics);
        texts.extend(topics.ok().map(|json| ("topics".to_owned(), json)));
        let end = self.end.and_then(|end| serde_json::to_string(&end).ok());
        texts.extend(end.map(|json| ("end".to_owned(), json.trim_matches('"').to_owned())));
        texts
    }

    /// From the texts of a metadata record; the error is the key that is missing or has no meaning.
    pub(crate) fn from_metadata(texts: &BTreeMap<String, String>) -> Result<Self, &'static str> {
        let text = |key: &'static str| texts.get(key).ok_or(key);
        let number = |key| text(key)?.parse().map_err(|_| key);
        let end = texts
            .get("end")
            .map(|end| serde_json::from_value(end.as_str().into()));
        Ok(Self {
            topics: serde_json::from_str(text("topics")?).map_err(|_| "topics")?,
            lost_records: number("lost_records")?,
            lost_samples: number("lost_samples")?,
            lost_alarms: number("lost_alarms")?,
            end: end.transpose().map_err(|_| "end")?,
        })
    }
}

/// Finds gaps in the records of one diagnoser.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct StepGaps {
    last_step: Option<u64>,
}

impl StepGaps {
    /// Instants between the previous record and this one that have no record and were not skipped.
    pub(crate) fn follow(&mut self, record: &StepRecord) -> u64 {
        let last = self.last_step.replace(record.step);
        let between = last.map_or(0, |last| record.step.saturating_sub(last).saturating_sub(1));
        between.saturating_sub(u64::from(record.skipped_instants))
    }
}

/// Finds gaps in the samples of one input.
#[derive(Clone, Debug, Default)]
pub(crate) struct SequenceGaps {
    last: HashMap<u128, u64>,
}

impl SequenceGaps {
    /// Numbers of a publisher missing before this sample; -1 when it was counted as missing and comes late.
    pub(crate) fn follow(&mut self, publisher: u128, header: &SampleHeader) -> i64 {
        let last = self.last.entry(publisher).or_insert(header.sequence);
        let ahead = header.sequence.cast_signed().wrapping_sub(last.cast_signed());
        match ahead {
            0 => 0,
            1.. => {
                *last = header.sequence;
                ahead - 1
            }
            _ => -1,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_instant_without_record_is_missing_unless_it_was_skipped() {
        let record = |step, skipped_instants| StepRecord {
            step,
            skipped_instants,
            ..StepRecord::new(0)
        };
        let mut gaps = StepGaps::default();
        let missing: Vec<u64> = [(7, 0), (8, 0), (11, 0), (15, 3), (20, 2)]
            .into_iter()
            .map(|(step, skipped)| gaps.follow(&record(step, skipped)))
            .collect();
        assert_eq!(missing, [0, 0, 2, 0, 2]);
    }

    #[test]
    fn totals_survive_their_metadata() {
        let totals = Totals {
            topics: [(
                "/a/records/b".into(),
                TopicTotals {
                    messages: 3,
                    missing: 1,
                },
            )]
            .into(),
            lost_records: 1,
            lost_samples: 2,
            lost_alarms: 3,
            end: Some(End::DaemonEnded),
        };
        let texts = totals.to_metadata();
        assert_eq!(texts["end"], "daemon_ended");
        assert_eq!(Totals::from_metadata(&texts), Ok(totals));
        assert_eq!(Totals::from_metadata(&BTreeMap::new()), Err("topics"));
    }
}
