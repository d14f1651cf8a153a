//! What the records of one run say about one diagnoser.

use residual_shared::record::{StepRecord, Verdict, flags};

/// Detection and isolation in one run. Times are nanoseconds since the start of the run.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Outcome {
    /// Steps done.
    pub steps: u64,
    /// Steps at which something could be tested.
    pub evaluated: u64,
    /// Steps with an alarm before the fault's onset (all alarms, when there is no fault).
    pub false_alarms: u64,
    /// First alarm at or after the onset.
    pub detected_ns: Option<u64>,
    /// First isolation at or after the onset, and the faults isolated.
    pub isolated: Option<(u64, u64)>,
}

impl Outcome {
    /// Takes the next record; `onset_ns`: when the injected fault begins, if there is one.
    pub fn take(&mut self, record: &StepRecord, onset_ns: Option<u64>) {
        self.steps += 1;
        let evaluated = record.channels().iter().any(|channel| channel.is_evaluated());
        self.evaluated += u64::from(evaluated);
        let alarm = record.flags & flags::ALARM_NOW != 0;
        let faulty = onset_ns.is_some_and(|onset| record.instant_ns >= onset);
        if !faulty {
            self.false_alarms += u64::from(alarm);
            return;
        }
        if alarm && self.detected_ns.is_none() {
            self.detected_ns = Some(record.instant_ns);
        }
        if record.verdict() == Verdict::Isolated && self.isolated.is_none() {
            self.isolated = Some((record.instant_ns, record.certainly_faulty));
        }
    }
}

/// The median of a list of delays, nanoseconds; none of an empty list. Of an even number the lower middle.
pub fn median(mut delays: Vec<u64>) -> Option<u64> {
    delays.sort_unstable();
    delays.get(delays.len().saturating_sub(1) / 2).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(instant_ns: u64, verdict: Verdict, alarm: bool) -> StepRecord {
        StepRecord {
            instant_ns,
            verdict: verdict as u32,
            flags: if alarm { flags::ALARM_NOW } else { 0 },
            certainly_faulty: u64::from(verdict == Verdict::Isolated) << 1,
            ..StepRecord::new(1)
        }
    }

    #[test]
    fn alarms_before_the_onset_are_false_and_later_ones_detect() {
        let mut outcome = Outcome::default();
        outcome.take(&record(1, Verdict::Fault, true), Some(3));
        outcome.take(&record(2, Verdict::Nominal, false), Some(3));
        outcome.take(&record(3, Verdict::Nominal, false), Some(3));
        outcome.take(&record(4, Verdict::Fault, true), Some(3));
        outcome.take(&record(5, Verdict::Isolated, true), Some(3));
        assert_eq!(outcome.false_alarms, 1);
        assert_eq!(outcome.detected_ns, Some(4));
        assert_eq!(outcome.isolated, Some((5, 0b10)));
    }

    #[test]
    fn the_median_is_the_middle() {
        assert_eq!(median(vec![]), None);
        assert_eq!(median(vec![3, 1, 2]), Some(2));
        assert_eq!(median(vec![4, 1, 2, 3]), Some(2));
    }
}
