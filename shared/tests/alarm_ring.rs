//! Alarm transitions through the bounds table: numbers, gaps, lives of the daemon, sleeping consumers.
#![allow(clippy::unwrap_used, clippy::panic)]

mod common;

use std::thread;
use std::time::{Duration, Instant};

use common::{OWN, directory, slot, spec};
use residual_shared::alarm::{AlarmState, AlarmTransition, NONE, alarm_flags};
use residual_shared::bounds_table::layout::{ALARM_WORDS, alarm_ring, header};
use residual_shared::bounds_table::{AlarmRead, PreparedTable, TableReader, TableWriter};
use residual_shared::clock::monotonic_ns;
use residual_shared::counters::AlarmStatus;

fn transition(slot: u32, step: u64) -> AlarmTransition {
    AlarmTransition {
        number: Default::default(),
        written_ns: 0,
        instant_ns: 10 * step,
        step,
        slot,
        identity: 0,
        state: AlarmState::Raised,
        flags: 0,
        verdict: 2,
        occurrence: step,
        certainly_faulty: 1,
        possibly_faulty: 3,
        channel: 0,
        ratio: 1.5,
        fault_estimate: f64::NAN,
        fault_estimate_half_width: f64::NAN,
    }
}

fn read(table: &TableReader, number: u64) -> AlarmTransition {
    match table.read_alarm(number) {
        AlarmRead::Transition(transition) => transition,
        other => panic!("{number}: {other:?}"),
    }
}

#[test]
fn a_transition_is_read_as_written_and_shows_in_the_status_of_its_diagnoser() {
    let directory = directory();
    let path = directory.path().join("bounds");
    let spec = spec(vec![slot("a", 1), slot("b", 2)]);
    let mut daemon = TableWriter::create(&path, &spec, &OWN).unwrap();
    let table = TableReader::open(&path).unwrap();
    assert_eq!(
        (table.newest_alarm(), table.read_alarm(1)),
        (0, AlarmRead::Waiting)
    );
    let before = monotonic_ns();
    let number = daemon.raise(&transition(1, 7));
    assert_eq!((number.epoch, number.number), (daemon.epoch(), 1));
    let seen = read(&table, 1);
    assert_eq!((seen.number, seen.step, seen.slot), (number, 7, 1));
    assert_eq!(seen.identity, spec.slots[1].identity());
    assert!((before..=monotonic_ns()).contains(&seen.written_ns));
    let status = table.read_alarm_status(1).unwrap();
    assert_eq!((status.state, status.occurrences, status.number), (2, 7, 1));
    assert_eq!(table.read_alarm_status(0).unwrap().number, 0);
}

#[test]
fn the_oldest_transitions_are_lost_first_and_known_to_be_lost() {
    let directory = directory();
    let path = directory.path().join("bounds");
    let mut daemon = TableWriter::create(&path, &spec(vec![slot("a", 1)]), &OWN).unwrap();
    let table = TableReader::open(&path).unwrap();
    for step in 1..=100 {
        daemon.raise(&transition(0, step));
    }
    assert_eq!(table.newest_alarm(), 100);
    for number in 1..=36 {
        assert_eq!(table.read_alarm(number), AlarmRead::Lost);
    }
    for number in 37..=100 {
        assert_eq!(read(&table, number).step, number);
    }
}

#[test]
fn a_new_life_goes_on_with_the_numbers_and_keeps_the_transitions_of_the_old_one() {
    let directory = directory();
    let path = directory.path().join("bounds");
    let mut first = TableWriter::create(&path, &spec(vec![slot("a", 1), slot("b", 2)]), &OWN).unwrap();
    first.raise(&transition(0, 1));
    first.raise(&transition(1, 2));
    let first_epoch = first.epoch();
    std::mem::forget(first); // killed: nobody marks its table closed
    let old = TableReader::open(&path).unwrap();

    // The diagnosers have changed places, and one has other channels now.
    let prepared = PreparedTable::create(&path, &spec(vec![slot("b", 2), slot("a", 4)]), &OWN).unwrap();
    let status = prepared.alarm_status();
    assert_eq!(status[0].unwrap().number, 2);
    assert_eq!(status[1], None);
    let mut second = prepared.publish().unwrap();
    assert!(old.is_replaced());
    // Number 3 withdraws the alarm of the one that has other channels now.
    assert_eq!(second.raise(&transition(1, 4)).number, 4);

    let table = TableReader::open(&path).unwrap();
    let origin = table.directory().alarm_origin;
    assert_eq!(origin, first_epoch);
    let all: Vec<_> = (1..=4).map(|number| read(&table, number)).collect();
    let epochs: Vec<_> = all.iter().map(|transition| transition.number.epoch).collect();
    assert_eq!(epochs, [first_epoch, first_epoch, second.epoch(), second.epoch()]);
    let slots: Vec<_> = all.iter().map(|transition| transition.slot).collect();
    assert_eq!(slots, [NONE, 0, NONE, 1]);
}

#[test]
fn what_is_shown_of_an_alarm_before_the_table_is_published_stands_in_it_unless_the_old_table_knows_better() {
    let directory = directory();
    let path = directory.path().join("bounds");
    let mut first = TableWriter::create(&path, &spec(vec![slot("a", 1)]), &OWN).unwrap();
    first.raise(&transition(0, 1));
    let known = TableReader::open(&path).unwrap().read_alarm_status(0).unwrap();
    let prepared = PreparedTable::create(&path, &spec(vec![slot("b", 2), slot("a", 1)]), &OWN).unwrap();
    let restored = AlarmStatus {
        state: AlarmState::Raised as u64,
        occurrences: 7,
        ..AlarmStatus::default()
    };
    prepared.show_alarm_status(0, &restored);
    prepared.show_alarm_status(1, &restored);
    prepared.show_alarm_status(2, &restored);
    let _second = prepared.publish().unwrap();
    let table = TableReader::open(&path).unwrap();
    assert_ne!(known, restored);
    assert_eq!(
        [0, 1].map(|slot| table.read_alarm_status(slot).unwrap()),
        [restored, known]
    );
}

#[test]
fn a_smaller_ring_takes_over_the_newest_transitions() {
    let directory = directory();
    let path = directory.path().join("bounds");
    let mut spec = spec(vec![slot("a", 1)]);
    let mut first = TableWriter::create(&path, &spec, &OWN).unwrap();
    (1..=70).for_each(|step| _ = first.raise(&transition(0, step)));
    drop(first);
    spec.alarm_capacity = 16;
    let _second = TableWriter::create(&path, &spec, &OWN).unwrap();
    let table = TableReader::open(&path).unwrap();
    assert_eq!(table.newest_alarm(), 70);
    assert_eq!(table.read_alarm(54), AlarmRead::Lost);
    assert!((55..=70).all(|number| read(&table, number).step == number));
}

#[test]
fn numbers_begin_anew_when_the_old_table_is_damaged() {
    let directory = directory();
    let path = directory.path().join("bounds");
    let spec = spec(vec![slot("a", 1)]);
    let mut first = TableWriter::create(&path, &spec, &OWN).unwrap();
    first.raise(&transition(0, 1));
    let (first_epoch, mut words) = (first.epoch(), common::words(&path));
    words[header::SLOT_COUNT] += 1;
    drop(first);
    common::write(&path, &words);
    let mut second = TableWriter::create(&path, &spec, &OWN).unwrap();
    assert_eq!(second.raise(&transition(0, 2)).number, 1);
    let table = TableReader::open(&path).unwrap();
    assert_eq!(table.directory().alarm_origin, second.epoch());
    assert!(second.epoch() > first_epoch);
}

#[test]
fn sleepers_wake_by_a_transition_and_by_the_end_of_the_daemon() {
    let directory = directory();
    let path = directory.path().join("bounds");
    let mut daemon = TableWriter::create(&path, &spec(vec![slot("a", 1)]), &OWN).unwrap();
    let limit = Duration::from_secs(20);
    let sleep = |seen: u64| {
        let path = path.clone();
        let (ready, is_ready) = std::sync::mpsc::channel();
        let sleeper = thread::spawn(move || {
            let table = TableReader::open(&path).unwrap();
            ready.send(()).unwrap();
            let begin = Instant::now();
            table.wait_for_alarm(seen, limit);
            begin.elapsed()
        });
        is_ready.recv().unwrap();
        sleeper
    };
    // Whether the sleeper sleeps already or not: it is back long before the limit.
    let sleepers: Vec<_> = (0..4).map(|_| sleep(0)).collect();
    daemon.raise(&transition(0, 1));
    assert!(
        sleepers
            .into_iter()
            .all(|sleeper| sleeper.join().unwrap() < limit / 2)
    );
    let sleeper = sleep(1);
    thread::sleep(Duration::from_millis(100));
    daemon.close();
    assert!(sleeper.join().unwrap() < limit / 2);
}

#[test]
fn numbers_begin_anew_when_the_old_table_is_cut_off_or_its_newest_number_is_absurd() {
    let cut = |words: &mut Vec<u64>| words.truncate(words.len() - 4 * ALARM_WORDS);
    let absurd = |words: &mut Vec<u64>| {
        let ring = words[header::ALARM_RING] as usize / 8;
        words[ring + alarm_ring::NEWEST] = u64::MAX;
    };
    let damages: [fn(&mut Vec<u64>); 2] = [cut, absurd];
    for damage in damages {
        let directory = directory();
        let path = directory.path().join("bounds");
        let spec = spec(vec![slot("a", 1)]);
        let mut first = TableWriter::create(&path, &spec, &OWN).unwrap();
        first.raise(&transition(0, 1));
        let mut words = common::words(&path);
        drop(first);
        damage(&mut words);
        common::write(&path, &words);
        let mut second = TableWriter::create(&path, &spec, &OWN).unwrap();
        assert_eq!(second.raise(&transition(0, 2)).number, 1);
        let table = TableReader::open(&path).unwrap();
        assert_eq!(table.directory().alarm_origin, second.epoch());
    }
}

#[test]
fn an_active_alarm_of_a_diagnoser_that_is_gone_is_withdrawn_once() {
    let directory = directory();
    let path = directory.path().join("bounds");
    let both = spec(vec![slot("a", 1), slot("b", 2), slot("c", 1)]);
    let mut first = TableWriter::create(&path, &both, &OWN).unwrap();
    first.raise(&transition(0, 1));
    first.raise(&transition(1, 2));
    first.raise(&AlarmTransition {
        state: AlarmState::Cleared,
        ..transition(2, 3)
    });
    std::mem::forget(first); // killed
    for life in 2..5 {
        let daemon = TableWriter::create(&path, &spec(vec![slot("b", 2)]), &OWN).unwrap();
        let table = TableReader::open(&path).unwrap();
        assert_eq!(table.newest_alarm(), 4);
        let withdrawn = read(&table, 4);
        let cleared = (AlarmState::Cleared, alarm_flags::WITHDRAWN);
        assert_eq!((withdrawn.state, withdrawn.flags), cleared);
        let alarm = (
            withdrawn.slot,
            withdrawn.identity,
            withdrawn.occurrence,
            withdrawn.step,
        );
        assert_eq!(alarm, (NONE, both.slots[0].identity(), 1, 1));
        if life == 2 {
            assert_eq!(withdrawn.number.epoch, daemon.epoch());
        }
        assert_eq!(table.read_alarm_status(0).unwrap().number, 2);
    }
}

#[test]
fn transitions_written_between_preparing_and_publishing_are_taken_over() {
    for more in [0, 1, 5, 63, 64, 65, 200] {
        let directory = directory();
        let path = directory.path().join("bounds");
        let mut spec = spec(vec![slot("a", 1), slot("b", 1)]);
        let mut first = TableWriter::create(&path, &spec, &OWN).unwrap();
        (1..=20).for_each(|step| _ = first.raise(&transition(1, step)));
        spec.alarm_capacity = 128;
        let prepared = PreparedTable::create(&path, &spec, &OWN).unwrap();
        (21..21 + more).for_each(|step| _ = first.raise(&transition(0, step)));
        let _second = prepared.publish().unwrap();
        let table = TableReader::open(&path).unwrap();
        let newest = 20 + more;
        assert_eq!(table.newest_alarm(), newest);
        for number in 1..=newest {
            match table.read_alarm(number) {
                AlarmRead::Transition(transition) => assert_eq!(transition.step, number),
                // Overwritten in the old ring before they could be copied.
                other => assert!(
                    other == AlarmRead::Lost && number + 64 <= newest,
                    "{number}: {other:?}"
                ),
            }
        }
        let status = |slot| table.read_alarm_status(slot).unwrap().number;
        assert_eq!((status(0), status(1)), (if more == 0 { 0 } else { newest }, 20));
    }
}
