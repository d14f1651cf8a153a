//! What the records of a run say about its diagnosers.

use residual_shared::alarm::{AlarmState, AlarmTransition, alarm_flags};
use residual_shared::record::{StepRecord, Verdict, flags};

/// A run and what each diagnoser made of it. Times are nanoseconds of the recording since the start of the run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RunOutcome {
    /// The run; empty for the only one.
    pub run: String,
    /// Its kind; empty where the recording names none.
    pub kind: String,
    /// When its fault, injected or labelled, begins.
    pub onset_ns: Option<u64>,
    /// What each diagnoser said.
    pub outcomes: Vec<Outcome>,
}

/// Detection and isolation in one run by one diagnoser. Times are nanoseconds since the start of the run.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Outcome {
    /// Steps done.
    pub steps: u64,
    /// Steps at which something could be tested.
    pub evaluated: u64,
    /// Steps with an alarm before the fault's onset (all alarms, when there is no fault).
    pub false_alarms: u64,
    /// First alarm at or after the onset; an alarm that has been on since before the onset is none.
    pub detected_ns: Option<u64>,
    /// First isolation at or after the detection, and the faults isolated.
    pub isolated: Option<(u64, u64)>,
    /// Whether a false alarm has been on without a break until now.
    pub false_alarm_on: bool,
    /// How often the lifecycle raised its alarm.
    pub raised: u64,
    /// How often it cleared a raised alarm.
    pub cleared: u64,
    /// When it first raised the alarm at or after the onset; an alarm that has been up since before it is none.
    pub raised_ns: Option<u64>,
    /// Whether the alarm is up.
    pub alarm_up: bool,
}

impl Outcome {
    /// Takes the next transition of the alarm, of the instant `at_ns`.
    pub fn take_alarm(&mut self, transition: &AlarmTransition, at_ns: u64, onset_ns: Option<u64>) {
        let acknowledged = transition.flags & alarm_flags::ACKNOWLEDGED != 0;
        if transition.state == AlarmState::Raised && !acknowledged {
            self.raised += 1;
            if onset_ns.is_some_and(|onset| at_ns >= onset) && self.raised_ns.is_none() {
                self.raised_ns = Some(at_ns);
            }
        }
        let was_up = std::mem::replace(&mut self.alarm_up, transition.state.is_active());
        self.cleared += u64::from(was_up && !self.alarm_up);
    }

    /// Takes the next record, made at `at_ns`; `onset_ns`: when the fault begins, if there is one.
    pub fn take(&mut self, record: &StepRecord, at_ns: u64, onset_ns: Option<u64>) {
        self.steps += 1;
        let evaluated = record.channels().iter().any(|channel| channel.is_evaluated());
        self.evaluated += u64::from(evaluated);
        let alarm = record.flags & flags::ALARM_NOW != 0;
        if onset_ns.is_none_or(|onset| at_ns < onset) {
            self.false_alarms += u64::from(alarm);
            self.false_alarm_on = alarm;
            return;
        }
        self.false_alarm_on &= alarm;
        if alarm && !self.false_alarm_on && self.detected_ns.is_none() {
            self.detected_ns = Some(at_ns);
        }
        let isolated = record.verdict() == Verdict::Isolated && self.detected_ns.is_some();
        if isolated && self.isolated.is_none() {
            self.isolated = Some((at_ns, record.certainly_faulty));
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
    use crate::lifecycle::{Change, transition};

    fn record(instant_ns: u64, verdict: Verdict, alarm: bool) -> StepRecord {
        StepRecord {
            instant_ns,
            verdict: verdict as u32,
            flags: if alarm { flags::ALARM_NOW } else { 0 },
            certainly_faulty: u64::from(verdict == Verdict::Isolated) << 1,
            ..StepRecord::new(1)
        }
    }

    fn outcome(records: &[StepRecord], onset_ns: Option<u64>) -> Outcome {
        let mut outcome = Outcome::default();
        for record in records {
            outcome.take(record, record.instant_ns, onset_ns);
        }
        outcome
    }

    #[test]
    fn alarms_before_the_onset_are_false_and_later_ones_detect() {
        let records = [
            record(1, Verdict::Fault, true),
            record(2, Verdict::Nominal, false),
            record(3, Verdict::Nominal, false),
            record(4, Verdict::Fault, true),
            record(5, Verdict::Isolated, true),
        ];
        let found = outcome(&records, Some(3));
        assert_eq!(found.false_alarms, 1);
        assert_eq!(found.detected_ns, Some(4));
        assert_eq!(found.isolated, Some((5, 0b10)));
        assert_eq!(outcome(&records, None).false_alarms, 3);
    }

    #[test]
    fn an_alarm_that_was_on_before_the_onset_detects_nothing_until_it_rises_anew() {
        let mut records = vec![
            record(1, Verdict::Isolated, true),
            record(2, Verdict::Isolated, true),
            record(3, Verdict::Isolated, true),
        ];
        let continuing = outcome(&records, Some(2));
        assert_eq!(continuing.false_alarms, 1);
        assert_eq!((continuing.detected_ns, continuing.isolated), (None, None));
        records.push(record(4, Verdict::Nominal, false));
        records.push(record(5, Verdict::Fault, true));
        assert_eq!(outcome(&records, Some(2)).detected_ns, Some(5));
    }

    #[test]
    fn alarms_are_counted_and_the_first_one_raised_by_the_fault_is_remembered() {
        use AlarmState::{Cleared, Isolated, Pending, Raised};
        let nothing = StepRecord::new(1);
        let states = [
            (1, Raised),
            (2, Cleared),
            (3, Pending),
            (5, Pending),
            (6, Raised),
            (7, Isolated),
            (9, Cleared),
        ];
        let mut outcome = Outcome::default();
        for (at_ns, state) in states {
            let change = Change {
                state,
                flags: 0,
                occurrence: 0,
            };
            outcome.take_alarm(&transition(0, &nothing, &change), at_ns, Some(4));
        }
        // An acknowledgement is no new alarm.
        let acknowledged = Change {
            state: Raised,
            flags: alarm_flags::ACKNOWLEDGED,
            occurrence: 0,
        };
        outcome.take_alarm(&transition(0, &nothing, &acknowledged), 10, Some(4));
        assert_eq!(
            (outcome.raised, outcome.cleared, outcome.raised_ns),
            (2, 2, Some(6))
        );
    }

    #[test]
    fn the_median_is_the_middle() {
        assert_eq!(median(vec![]), None);
        assert_eq!(median(vec![3, 1, 2]), Some(2));
        assert_eq!(median(vec![4, 1, 2, 3]), Some(2));
    }
}
