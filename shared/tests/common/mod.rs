//! Specifications and files that several tests use.
#![allow(dead_code)] // Every test file compiles this module for itself and uses a part of it.

pub mod place;

use std::fs;
use std::path::Path;

use residual_shared::bounds_table::{Access, ChannelSpec, InputSpec, SlotSpec, TableSpec, layout};
use residual_shared::clock::DaemonTime;
use tempfile::TempDir;

/// Only the daemon's user reads.
pub const OWN: Access = Access {
    group: None,
    mode: 0o600,
};

/// A directory on a tmpfs that removes itself.
pub fn directory() -> TempDir {
    tempfile::Builder::new()
        .prefix("residuald-test-")
        .tempdir_in("/dev/shm")
        .unwrap()
}

/// A diagnoser with so many channels.
pub fn slot(name: &str, channels: usize) -> SlotSpec {
    SlotSpec {
        name: name.into(),
        method: "chi_square".into(),
        period_ns: 10_000_000,
        phase_ns: 1_000_000,
        margin_ns: 500_000,
        channels: (0..channels)
            .map(|index| ChannelSpec {
                name: format!("r{index}"),
                unit: "m/s²".into(),
            })
            .collect(),
        faults: vec!["actuator 1".into(), "sensor 1".into()],
    }
}

/// A table of these diagnosers and one input.
pub fn spec(slots: Vec<SlotSpec>) -> TableSpec {
    TableSpec {
        instance: "test".into(),
        slots,
        inputs: vec![InputSpec {
            name: "imu".into(),
            signals: vec!["ax".into(), "ay".into()],
        }],
        time: DaemonTime {
            origin_ns: 17,
            speed: 2.5,
        },
        schedule_epoch_ns: 1_000,
        stale_after_periods: 3,
        alarm_capacity: 64,
    }
}

/// The words of a file.
pub fn words(path: &Path) -> Vec<u64> {
    let bytes = fs::read(path).unwrap();
    bytes
        .chunks_exact(8)
        .map(|word| u64::from_ne_bytes(word.try_into().unwrap()))
        .collect()
}

/// Writes words as a file.
pub fn write(path: &Path, words: &[u64]) {
    let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_ne_bytes()).collect();
    fs::write(path, bytes).unwrap();
}

/// Puts the checksum right, as somebody would who forges a table.
pub fn sign(words: &mut [u64]) {
    let bytes = words[layout::header::DIRECTORY_BYTES];
    let count = usize::try_from(bytes / 8).unwrap_or(0).min(words.len());
    let mut checked = words[..count].to_vec();
    for field in [
        layout::header::CHECKSUM,
        layout::header::STATE,
        layout::header::HEARTBEAT,
    ] {
        if let Some(word) = checked.get_mut(field) {
            *word = 0;
        }
    }
    words[layout::header::CHECKSUM] = layout::fnv(layout::FNV_START, &checked);
}
