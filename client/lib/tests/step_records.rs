//! The stream of step records through real iceoryx2 memory; the test plays the daemon.
#![cfg(feature = "transport")]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use residual_client::{Instance, RecordCounts, StepRecord, StepRecords, TransportError};
use residual_shared::transport::{RecordPublisher, open_node, remove_leftovers};
use tempfile::TempDir;

/// An instance of its own on tmpfs, removed at the end.
struct Place {
    instance: Instance,
    _directory: TempDir,
}

impl Drop for Place {
    fn drop(&mut self) {
        remove_leftovers(&self.instance).unwrap();
    }
}

fn place(name: &str) -> Place {
    let directory = (tempfile::Builder::new().prefix("rsd").tempdir_in("/dev/shm")).unwrap();
    let name = format!("{name}-{}", std::process::id());
    Place {
        instance: Instance::new(name.parse().unwrap(), directory.path()),
        _directory: directory,
    }
}

fn record(step: u64) -> StepRecord {
    let mut record = StepRecord::new(2);
    record.step = step;
    record
}

#[test]
fn without_a_daemon_the_error_says_to_start_one() {
    let place = place("nobody");
    let error = StepRecords::open(&place.instance).err().unwrap();
    assert!(matches!(error, TransportError::NoService { .. }), "{error}");
}

#[test]
fn every_record_arrives_once_or_is_counted_as_lost_over_two_lives() {
    let place = place("stream");
    let send = |epoch: u64, steps: std::ops::Range<u64>, records: &mut Option<StepRecords>| {
        let node = open_node(&place.instance).unwrap();
        let mut daemon = RecordPublisher::create(&node, &place.instance).unwrap();
        let records = records.get_or_insert_with(|| StepRecords::open(&place.instance).unwrap());
        for step in steps {
            daemon.send(epoch, 3, &record(step)).unwrap();
        }
        let mut seen = Vec::new();
        records.receive(|header, record| {
            assert_eq!((header.epoch, header.slot), (epoch, 3));
            seen.push(record.step);
        });
        seen
    };
    let mut records = None;
    assert_eq!(send(7, 0..5, &mut records), [0, 1, 2, 3, 4]);
    let seen = send(8, 100..3100, &mut records);
    assert_eq!(*seen.last().unwrap(), 3099);
    assert!(seen.is_sorted_by(|left, right| left + 1 == *right));
    let lost = 3000 - seen.len() as u64;
    assert!(lost > 0, "the second life sent too little to overwrite anything");
    let counts = RecordCounts {
        received: 5 + seen.len() as u64,
        lost,
        lives: 2,
    };
    assert_eq!(records.unwrap().counts(), counts);
}
