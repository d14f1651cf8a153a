//! Bounds tables without a daemon behind them.

use std::path::Path;

use anyhow::Result;
use residual_shared::alarm::{AlarmState, AlarmTransition};
use residual_shared::bounds_table::{Access, ChannelSpec, SlotSpec, TableSpec, TableWriter};
use residual_shared::clock::DaemonTime;
use residual_shared::record::{Channel, StepRecord, Verdict};

/// Creates a table with `slots` diagnosers of `channels` channels, each with a first record.
///
/// # Errors
/// There is no room, or no permission.
pub fn create(path: &Path, slots: usize, channels: usize) -> Result<TableWriter> {
    let slot = |slot| SlotSpec {
        name: format!("diagnoser_{slot}"),
        method: "none".into(),
        period_ns: 1_000_000,
        phase_ns: 0,
        margin_ns: 0,
        channels: (0..channels).map(channel).collect(),
        faults: Vec::new(),
    };
    let specification = TableSpec {
        instance: "bench".into(),
        slots: (0..slots).map(slot).collect(),
        inputs: Vec::new(),
        time: DaemonTime::MONOTONIC,
        schedule_epoch_ns: 0,
        stale_after_periods: 3,
        alarm_capacity: 64,
    };
    let access = Access {
        group: None,
        mode: 0o600,
    };
    let mut table = TableWriter::create(path, &specification, &access)?;
    let record = record(channels);
    for slot in 0..slots {
        table.publish(slot, &record);
    }
    Ok(table)
}

/// A record with `channels` channels.
pub fn record(channels: usize) -> StepRecord {
    let mut record = StepRecord::new(channels);
    record.verdict = Verdict::Nominal as u32;
    record.channels_mut().fill(Channel::two_sided(0.5, 1.0));
    record
}

/// An alarm of the first diagnoser.
pub fn transition() -> AlarmTransition {
    AlarmTransition {
        number: Default::default(),
        written_ns: 0,
        instant_ns: 0,
        step: 0,
        slot: 0,
        identity: 0,
        state: AlarmState::Raised,
        flags: 0,
        verdict: Verdict::Fault as u32,
        occurrence: 1,
        certainly_faulty: 0,
        possibly_faulty: 0,
        channel: 0,
        ratio: 1.5,
        fault_estimate: f64::NAN,
        fault_estimate_half_width: f64::NAN,
    }
}

fn channel(index: usize) -> ChannelSpec {
    ChannelSpec {
        name: format!("channel_{index}"),
        unit: String::new(),
    }
}
