//! From a change of state to the transition that clients see.

use residual_shared::alarm::{AlarmNumber, AlarmTransition, NONE};
use residual_shared::record::StepRecord;

use super::machine::Change;

/// The transition of the alarm of the diagnoser in `slot` whose latest record is `record`. Number, identity and
/// writing time are the bounds table's to give.
pub fn transition(slot: usize, record: &StepRecord, change: &Change) -> AlarmTransition {
    let worst = record.worst_channel();
    AlarmTransition {
        number: AlarmNumber::default(),
        written_ns: 0,
        instant_ns: record.instant_ns,
        step: record.step,
        slot: u32::try_from(slot).unwrap_or(NONE),
        identity: 0,
        state: change.state,
        flags: change.flags,
        verdict: record.verdict,
        occurrence: change.occurrence,
        certainly_faulty: record.certainly_faulty,
        possibly_faulty: record.possibly_faulty,
        channel: worst.map_or(NONE, |(index, _)| index as u32),
        ratio: worst.map_or(f64::NAN, |(_, channel)| channel.ratio),
        fault_estimate: record.fault_estimate,
        fault_estimate_half_width: record.fault_estimate_half_width,
    }
}
