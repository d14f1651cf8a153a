//! One record as one line: any method, because records say all that a client needs.

use residual_shared::bounds_table::SlotSpec;
use residual_shared::record::StepRecord;

/// Width of the columns for diagnoser and verdict.
const NAME_WIDTH: usize = 22;
const VERDICT_WIDTH: usize = 13;

/// Time since the start, diagnoser, verdict, isolated faults, and the channel closest to its bound or beyond it.
pub fn line(slot: &SlotSpec, since_start_ns: u64, record: &StepRecord) -> String {
    let time_s = since_start_ns as f64 * 1e-9;
    let mut line = format!(
        "t = {time_s:6.2} s  {:NAME_WIDTH$} {:VERDICT_WIDTH$}",
        slot.name,
        record.verdict().name()
    );
    if let Some((place, channel)) = record.worst_channel() {
        let name = slot
            .channels
            .get(place)
            .map_or("", |channel| channel.name.as_str());
        let mark = if channel.ratio > 1.0 { " !" } else { "" };
        line += &format!(
            " {name} {:+.3} in [{:+.3}, {:+.3}]{mark}",
            channel.residual, channel.lower, channel.upper
        );
    }
    if record.certainly_faulty != 0 {
        line += &format!("  fault: {}", faults(slot, record.certainly_faulty).join("+"));
        if record.fault_estimate.is_finite() {
            line += &format!(
                " {:+.3} ± {:.3}",
                record.fault_estimate, record.fault_estimate_half_width
            );
        }
    }
    line
}

/// Names of the faults in a set.
pub fn faults(slot: &SlotSpec, set: u64) -> Vec<String> {
    let names = slot.faults.iter().enumerate();
    let chosen = names.filter(|(bit, _)| set >> bit & 1 == 1);
    chosen.map(|(_, name)| name.clone()).collect()
}

/// Names of the channels out of their bounds.
pub fn violated(slot: &SlotSpec, record: &StepRecord) -> Vec<String> {
    let channels = slot.channels.iter().zip(record.channels());
    let violated = channels.filter(|(_, channel)| channel.ratio > 1.0);
    violated
        .map(|(description, _)| description.name.clone())
        .collect()
}
