//! Alarms that go on over a restart of the daemon, also one by kill −9: neither raised again nor forgotten.

use std::path::Path;

use residual_shared::alarm::AlarmState;
use residual_shared::bounds_table::{AlarmRead, TableReader};
use residual_shared::counters::AlarmStatus;

use super::engine::Engine;
use crate::lifecycle::LifecycleState;

/// Lets the alarms of `engine` go on from where they stood in the table of the earlier life at `path`, by
/// slot. An alarm that a checkpoint has restored to just that stays as it is.
pub fn resume_alarms(engine: &mut Engine, path: &Path, status: &[Option<AlarmStatus>]) {
    let table = TableReader::open(path).ok();
    let known = status.iter().enumerate();
    for (slot, status) in known.filter_map(|(slot, status)| Some((slot, status.as_ref()?))) {
        // A checkpoint knows more than the table shows, unless it is older.
        if engine.alarm(slot).is_some_and(|alarm| alarm.agrees_with(status)) {
            continue;
        }
        let latest = table.as_ref().map(|table| table.read_alarm(status.number));
        let isolated = match latest {
            Some(AlarmRead::Transition(latest)) if latest.state == AlarmState::Isolated => {
                Some(latest.certainly_faulty)
            }
            _ => None,
        };
        engine.restore_alarm(slot, &LifecycleState::shown(status, isolated));
    }
}
