//! Step records as lines of a CSV file: one group of four columns a channel.
//!
//! Numbers are written with all their digits, so two files are equal exactly when their records agree in every
//! bit.

use residual_shared::record::{StepRecord, fault_names};

/// The names of the columns, of a diagnoser with these channels.
pub fn names<'a>(channels: impl Iterator<Item = &'a str>) -> Vec<String> {
    let head = [
        "run",
        "step",
        "time_ns",
        "verdict",
        "certainly_faulty",
        "possibly_faulty",
        "flags",
        "skipped_instants",
        "inputs_valid",
        "fault_estimate",
        "fault_estimate_half_width",
    ];
    let parts = ["lower", "residual", "upper", "ratio"];
    let channels = channels.flat_map(|channel| parts.map(|part| format!("{channel}.{part}")));
    head.map(str::to_owned).into_iter().chain(channels).collect()
}

/// The cells of one record of a run, of a diagnoser with these faults.
pub fn cells(run: &str, record: &StepRecord, faults: &[String]) -> Vec<String> {
    let names = |set| fault_names(faults, set).collect::<Vec<_>>().join("+");
    let mut cells = vec![
        run.to_owned(),
        record.step.to_string(),
        record.instant_ns.to_string(),
        record.verdict().name().to_owned(),
        names(record.certainly_faulty),
        names(record.possibly_faulty),
        record.flags.to_string(),
        record.skipped_instants.to_string(),
        record.inputs_valid.to_string(),
        record.fault_estimate.to_string(),
        record.fault_estimate_half_width.to_string(),
    ];
    for channel in record.channels() {
        let numbers = [channel.lower, channel.residual, channel.upper, channel.ratio];
        cells.extend(numbers.map(|number| number.to_string()));
    }
    cells
}
