//! The bounds table as a file: round trips, lives of the daemon, many readers, killed writers.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use common::{OWN, directory, slot, spec};
use residual_shared::bounds_table::{
    Access, CreateError, HUNG_AFTER_NS, Liveness, ReadError, ReadOutcome, SpecError, TableReader,
    TableWriter, layout,
};
use residual_shared::clock::monotonic_ns;
use residual_shared::counters::{InputCounters, ScheduleCounters};
use residual_shared::record::{Channel, MAX_CHANNELS, StepRecord, Verdict};

/// A record of which every word depends on `number`, so that a mixture of two shows.
fn record(channels: usize, number: u64) -> StepRecord {
    let mut record = StepRecord::new(channels);
    record.step = number;
    record.instant_ns = number * 3;
    record.certainly_faulty = number ^ 5;
    record.possibly_faulty = number ^ 7;
    record.inputs_valid = !number;
    record.fault_estimate = number as f64;
    record.fault_estimate_half_width = -(number as f64);
    record.verdict = Verdict::Nominal as u32;
    record.flags = number as u32;
    record.skipped_instants = (number >> 1) as u32;
    for (index, channel) in record.channels_mut().iter_mut().enumerate() {
        let value = number as f64 + index as f64;
        *channel = Channel {
            lower: value,
            residual: value + 0.25,
            upper: value + 0.5,
            ratio: value + 0.75,
        };
    }
    record
}

#[test]
fn what_the_daemon_describes_and_publishes_is_what_a_client_reads() {
    let directory = directory();
    let path = directory.path().join("bounds");
    let spec = spec(vec![slot("front", 0), slot("rear", 1), slot("all", MAX_CHANNELS)]);
    let mut writer = TableWriter::create(&path, &spec, &OWN).unwrap();
    let reader = TableReader::open(&path).unwrap();
    assert_eq!(reader.directory().spec, spec);
    assert_eq!(reader.directory().pid, std::process::id());
    assert_eq!(reader.directory().slot_of("all"), Some(2));

    let mut back = StepRecord::new(0);
    for (index, slot) in spec.slots.iter().enumerate() {
        assert_eq!(reader.read(index, &mut back), Ok(ReadOutcome::NeverWritten));
        for number in 1..=5 {
            let sent = record(slot.channels.len(), number);
            writer.publish(index, &sent);
            assert_eq!(reader.read(index, &mut back), Ok(ReadOutcome::Record { number }));
            assert!(back.same_bits(&sent));
        }
    }
    assert_eq!(
        reader.read(3, &mut back),
        Err(ReadError::NoSuchSlot { slot: 3, count: 3 })
    );

    let schedule = ScheduleCounters {
        steps: 1,
        records_dropped: 9,
        ..Default::default()
    };
    let input = InputCounters {
        accepted: 4,
        publisher_changes: 2,
        ..Default::default()
    };
    writer.publish_schedule_counters(1, &schedule);
    writer.publish_input_counters(0, &input);
    assert_eq!(reader.read_schedule_counters(1), Ok(schedule));
    assert_eq!(reader.read_schedule_counters(0), Ok(ScheduleCounters::default()));
    assert_eq!(reader.read_input_counters(0), Ok(input));
    assert_eq!(
        reader.read_input_counters(1),
        Err(ReadError::NoSuchInput { input: 1, count: 1 })
    );
}

#[test]
fn a_table_without_diagnosers_and_inputs_can_be_read() {
    let directory = directory();
    let path = directory.path().join("bounds");
    let mut spec = spec(vec![]);
    spec.inputs.clear();
    let _writer = TableWriter::create(&path, &spec, &OWN).unwrap();
    assert_eq!(TableReader::open(&path).unwrap().directory().spec, spec);
}

#[test]
fn a_specification_that_clients_could_not_use_is_refused() {
    let directory = directory();
    let path = directory.path().join("bounds");
    let refusal = |slots| match TableWriter::create(&path, &spec(slots), &OWN) {
        Err(CreateError::Spec(error)) => error,
        other => panic!("{other:?}"),
    };
    assert!(matches!(
        refusal(vec![slot("a", 1), slot("a", 1)]),
        SpecError::Duplicate { .. }
    ));
    assert!(matches!(
        refusal(vec![slot("", 1)]),
        SpecError::Unnamed { index: 0, .. }
    ));
    assert!(matches!(
        refusal(vec![slot("a", MAX_CHANNELS + 1)]),
        SpecError::TooMany { .. }
    ));
    assert!(matches!(
        refusal(vec![slot(&"a".repeat(257), 1)]),
        SpecError::Text { .. }
    ));
    assert!(matches!(refusal(vec![slot("a\0b", 1)]), SpecError::Text { .. }));
    let mode = |mode| TableWriter::create(&path, &spec(vec![]), &Access { group: None, mode });
    assert!(matches!(mode(0o660), Err(CreateError::Mode { mode: 0o660 })));
    assert!(matches!(mode(0o440), Err(CreateError::Mode { .. })));
    assert!(!path.exists());
}

#[test]
fn a_new_life_replaces_the_table_and_closes_the_old_one() {
    let directory = directory();
    let path = directory.path().join("bounds");
    let mut first = TableWriter::create(&path, &spec(vec![slot("a", 1)]), &OWN).unwrap();
    first.publish(0, &record(1, 8));
    let old = TableReader::open(&path).unwrap();
    assert!(!old.is_replaced());
    assert_eq!(old.liveness(monotonic_ns()), Liveness::Running);
    // The first daemon is killed: nothing of it runs any more, not even its drop.
    std::mem::forget(first);

    let stale = directory.path().join("bounds.4711.new");
    let foreign = directory.path().join("bounds.notes.new");
    fs::write(&stale, b"half a table").unwrap();
    fs::write(&foreign, b"not ours").unwrap();
    let second = TableWriter::create(&path, &spec(vec![slot("b", 2)]), &OWN).unwrap();
    assert!(!stale.exists() && foreign.exists());
    assert!(old.is_replaced());
    assert_eq!(old.liveness(monotonic_ns()), Liveness::Closed);
    let mut back = StepRecord::new(0);
    assert_eq!(old.read(0, &mut back), Ok(ReadOutcome::Record { number: 1 }));
    assert!(back.same_bits(&record(1, 8)));

    let new = TableReader::open(&path).unwrap();
    assert!(new.directory().epoch > old.directory().epoch);
    assert_eq!(new.directory().slot_of("b"), Some(0));
    drop(second);
    assert_eq!(new.liveness(monotonic_ns()), Liveness::Closed);
}

#[test]
fn a_daemon_without_heartbeat_is_hung_and_back_with_the_next_one() {
    let directory = directory();
    let path = directory.path().join("bounds");
    let writer = TableWriter::create(&path, &spec(vec![]), &OWN).unwrap();
    let reader = TableReader::open(&path).unwrap();
    writer.heartbeat(5_000_000_000);
    let later = 5_000_000_000 + HUNG_AFTER_NS + 7;
    assert_eq!(
        reader.liveness(later),
        Liveness::Hung(Duration::from_nanos(HUNG_AFTER_NS + 7))
    );
    writer.heartbeat(later);
    assert_eq!(reader.liveness(later), Liveness::Running);
}

#[test]
fn a_table_of_an_earlier_boot_is_closed() {
    let directory = directory();
    let path = directory.path().join("bounds");
    let writer = TableWriter::create(&path, &spec(vec![slot("a", 1)]), &OWN).unwrap();
    let mut words = common::words(&path);
    words[layout::header::BOOT_ID_LOW] ^= 1;
    common::sign(&mut words);
    let copy = directory.path().join("copy");
    common::write(&copy, &words);
    let reader = TableReader::open(&copy).unwrap();
    assert_eq!(reader.liveness(monotonic_ns()), Liveness::Closed);
    drop(writer);
}

#[test]
fn a_writer_killed_in_its_cell_leaves_the_last_record_for_every_later_reader() {
    let directory = directory();
    let path = directory.path().join("bounds");
    let mut writer = TableWriter::create(&path, &spec(vec![slot("a", 3)]), &OWN).unwrap();
    let last = record(3, 6);
    writer.publish(0, &record(3, 5));
    writer.publish(0, &last);
    std::mem::forget(writer);

    // Record 3 would lie in cell 1; half of it has been written, the sequence word has not.
    let mut words = common::words(&path);
    let entry = words[layout::header::SLOT_ENTRIES] as usize / 8;
    let start = words[entry + layout::slot_entry::SLOT] as usize / 8;
    let cell = start + layout::LINE_WORDS + words[entry + layout::slot_entry::CELL_BYTES] as usize / 8;
    assert_eq!(words[start], 2);
    let half = layout::record_words(3) / 2;
    words[cell..cell + half].fill(u64::MAX);
    common::write(&path, &words);

    let reader = TableReader::open(&path).unwrap();
    let mut back = StepRecord::new(0);
    assert_eq!(reader.read(0, &mut back), Ok(ReadOutcome::Record { number: 2 }));
    assert!(back.same_bits(&last));
}

#[test]
fn readers_of_a_writer_at_full_speed_see_whole_records_in_order() {
    const SECONDS: f64 = 1.5;
    let directory = directory();
    let path = directory.path().join("bounds");
    let mut writer = TableWriter::create(&path, &spec(vec![slot("a", 5), slot("b", 40)]), &OWN).unwrap();
    let stop = AtomicBool::new(false);
    thread::scope(|scope| {
        let readers: Vec<_> = [0, 1, 1]
            .map(|index| {
                let (path, stop) = (&path, &stop);
                scope.spawn(move || read_until(path, index, stop))
            })
            .into();
        let begin = Instant::now();
        let mut number = 0;
        while begin.elapsed().as_secs_f64() < SECONDS {
            for _ in 0..64 {
                number += 1;
                writer.publish(0, &record(5, number));
                writer.publish(1, &record(40, number));
            }
        }
        stop.store(true, Ordering::Relaxed);
        let (whole, contended) = readers
            .into_iter()
            .map(|reader| reader.join().unwrap())
            .fold((0, 0), |sum, one| (sum.0 + one.0, sum.1 + one.1));
        println!("{number} records written twice, {whole} read whole, {contended} given up");
        assert!(whole > 1_000, "only {whole} records were read");
    });
}

/// Reads until told to stop; gives how many records were read and how often it had to give up.
fn read_until(path: &Path, slot: usize, stop: &AtomicBool) -> (u64, u64) {
    let reader = TableReader::open(path).unwrap();
    let mut back = StepRecord::new(0);
    let (mut newest, mut whole, mut contended) = (0, 0, 0);
    while !stop.load(Ordering::Relaxed) {
        match reader.read(slot, &mut back) {
            Ok(ReadOutcome::NeverWritten) => assert_eq!(newest, 0),
            Ok(ReadOutcome::Record { number }) => {
                assert!(number >= newest, "went back from {newest} to {number}");
                let expected = record(back.channels().len(), number);
                assert!(
                    back.same_bits(&expected),
                    "record {number} is a mixture: {back:?}"
                );
                newest = number;
                whole += 1;
            }
            Err(ReadError::Contended { .. }) => contended += 1,
            Err(error) => panic!("{error}"),
        }
    }
    (whole, contended)
}

#[test]
fn slots_and_cells_share_no_cache_line() {
    let directory = directory();
    let path = directory.path().join("bounds");
    let slots = (0..7).map(|index| slot(&format!("d{index}"), index)).collect();
    let _writer = TableWriter::create(&path, &spec(slots), &OWN).unwrap();
    let words = common::words(&path);
    let first = words[layout::header::SLOT_ENTRIES] as usize / 8;
    let mut parts = vec![(0, words[layout::header::DIRECTORY_BYTES])];
    for entry in (0..7).map(|index| first + index * layout::slot_entry::WORDS) {
        let at = |field: usize| words[entry + field];
        let cell = at(layout::slot_entry::CELL_BYTES);
        let start = at(layout::slot_entry::SLOT);
        let counters = at(layout::slot_entry::COUNTERS);
        let counter_bytes = 8 * ScheduleCounters::COUNT as u64;
        parts.extend([
            (start, 8),
            (start + 64, cell),
            (start + 64 + cell, cell),
            (counters, counter_bytes),
        ]);
    }
    for pair in parts.windows(2) {
        assert!(pair[0].0 + pair[0].1 <= pair[1].0, "{pair:?} overlap");
        assert_eq!(pair[1].0 % 64, 0, "{pair:?} share a line");
    }
}

#[test]
fn a_record_with_too_many_channels_is_cut_to_those_of_its_slot() {
    let directory = directory();
    let path = directory.path().join("bounds");
    let mut writer = TableWriter::create(&path, &spec(vec![slot("a", 1), slot("b", 1)]), &OWN).unwrap();
    writer.publish(1, &record(1, 4));
    writer.publish(0, &record(MAX_CHANNELS, 9));
    let reader = TableReader::open(&path).unwrap();
    let mut back = StepRecord::new(0);
    reader.read(1, &mut back).unwrap();
    assert!(back.same_bits(&record(1, 4)));
    reader.read(0, &mut back).unwrap();
    assert_eq!(back.channels(), &record(MAX_CHANNELS, 9).channels()[..1]);
}

#[test]
fn the_file_has_the_mode_asked_for() {
    let directory = directory();
    let path = directory.path().join("bounds");
    for mode in [0o600, 0o640, 0o644] {
        let access = Access { group: None, mode };
        let _writer = TableWriter::create(&path, &spec(vec![]), &access).unwrap();
        assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, mode);
    }
}
