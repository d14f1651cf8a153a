//! The known input u: held between its own change instants.

use super::packet_store::PacketStore;
use serde::{Deserialize, Serialize};

/// Whole microseconds nearest to a time in nanoseconds.
pub(super) fn microseconds(time_ns: i64) -> i64 {
    time_ns.saturating_add(500).div_euclid(1000)
}

/// The commands of the recent past, with the instants from which on they hold.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct InputHistory {
    /// What holds before the first change that is kept.
    base: Vec<f64>,
    /// (time, sequence number) of the base; `None` if it is the configured one.
    base_key: Option<(i64, u64)>,
    changes: PacketStore,
}

impl InputHistory {
    /// `base` until changes come; room for `capacity` of them.
    pub fn new(base: &[f64], capacity: usize) -> Self {
        Self {
            base: base.to_vec(),
            base_key: None,
            changes: PacketStore::new(capacity, base.len()),
        }
    }

    /// `base` before the first of the given changes: (from when on, ns; value).
    pub fn with_changes(base: &[f64], changes: &[(i64, Vec<f64>)]) -> Self {
        let mut history = Self::new(base, changes.len());
        for (index, (time_ns, value)) in changes.iter().enumerate() {
            let kept = history.changes.insert(*time_ns, 0, index as u64, value);
            debug_assert!(kept);
        }
        history
    }

    /// The command in force at `time_us` and the next time at which it becomes another one.
    pub fn at(&self, time_us: i64) -> (&[f64], Option<i64>) {
        let changes = self.changes.packets();
        let known = changes.partition_point(|change| microseconds(change.time_ns) <= time_us);
        let (past, future) = changes.split_at(known.min(changes.len()));
        let value = past.last().map_or(self.base.as_slice(), |change| change.values());
        let next = future.iter().find(|change| change.values() != value);
        (value, next.map(|change| microseconds(change.time_ns)))
    }

    /// The changes that are kept.
    pub(super) fn changes(&self) -> &PacketStore {
        &self.changes
    }

    /// Keeps a change; false if there is no room.
    #[must_use]
    pub(super) fn insert(&mut self, time_ns: i64, sequence: u64, value: &[f64]) -> bool {
        self.changes.insert(time_ns, 0, sequence, value)
    }

    /// Takes a change older than all that are kept as what holds before them; false if a newer one holds already.
    #[must_use]
    pub(super) fn insert_below(&mut self, time_ns: i64, sequence: u64, value: &[f64]) -> bool {
        let newer = self.base_key.is_none_or(|key| key < (time_ns, sequence));
        if newer {
            self.base.copy_from_slice(value);
            self.base_key = Some((time_ns, sequence));
        }
        newer
    }

    /// Forgets what was changed up to `time_ns`, apart from what holds then.
    pub(super) fn forget_until(&mut self, time_ns: i64) {
        if let Some(last) = self.changes.between(i64::MIN, time_ns).last() {
            self.base.copy_from_slice(last.values());
            self.base_key = Some((last.time_ns, last.sequence));
        }
        self.changes.remove_until(time_ns);
    }

    /// Becomes as it was at first.
    pub(super) fn clear(&mut self, base: &[f64]) {
        self.base.copy_from_slice(base);
        self.base_key = None;
        self.changes.clear();
    }

    /// Whether a saved history has the room of another.
    pub(super) fn fits(&self, other: &Self) -> bool {
        self.base.len() == other.base.len() && self.changes.fits(&other.changes, &[self.base.len()])
    }
}
