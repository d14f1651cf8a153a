//! A daemon that is killed behind any one of the stores of a transition, its clients, and its next life.
#![cfg(not(miri))]

use std::cell::Cell;
use std::fs;
use std::path::Path;
use std::sync::atomic::AtomicU64;
use std::time::{Duration, Instant};

use super::super::directory::Image;
use super::super::layout::{ALARM_WORDS, WORD_BYTES};
use super::super::protocol::{ReadWord, WriteWord};
use super::super::{Access, AlarmRead, PreparedTable, SlotSpec, TableReader, TableSpec, TableWriter};
use super::write_transition;
use crate::alarm::{AlarmNumber, AlarmState, AlarmTransition, NONE};
use crate::clock::DaemonTime;
use crate::counters::AlarmStatus;

const CAPACITY: u64 = 16;
const BEFORE: u64 = 20;
/// First word to 0, the others, the number; `newest`; the futex; the status.
const STORES: u32 = 1 + ALARM_WORDS as u32 + 1 + 1 + AlarmStatus::COUNT as u32;
const OWN: Access = Access {
    group: None,
    mode: 0o600,
};

thread_local! {
    /// How many stores the writer lives to do.
    static STORES_LEFT: Cell<u32> = const { Cell::new(0) };
}

/// A word that keeps its value once the writer has been killed.
struct MortalWord(AtomicU64);

impl MortalWord {
    fn store_if_alive(&self, value: u64) {
        if let Some(left) = STORES_LEFT.get().checked_sub(1) {
            STORES_LEFT.set(left);
            WriteWord::store(&self.0, value);
        }
    }
}

impl ReadWord for MortalWord {
    fn load(&self) -> u64 {
        ReadWord::load(&self.0)
    }
    fn acquire_fence() {}
}

impl WriteWord for MortalWord {
    fn store(&self, value: u64) {
        self.store_if_alive(value);
    }
    fn store_release(&self, value: u64) {
        self.store_if_alive(value);
    }
    fn release_fence() {}
}

fn spec() -> TableSpec {
    let slot = |name: &str| SlotSpec {
        name: name.into(),
        method: "chi_square".into(),
        period_ns: 1,
        phase_ns: 0,
        margin_ns: 0,
        channels: Vec::new(),
        faults: Vec::new(),
    };
    TableSpec {
        instance: "test".into(),
        slots: vec![slot("a"), slot("b")],
        inputs: Vec::new(),
        time: DaemonTime::MONOTONIC,
        schedule_epoch_ns: 0,
        stale_after_periods: 3,
        alarm_capacity: CAPACITY as u32,
    }
}

fn transition(slot: u32, step: u64) -> AlarmTransition {
    let states = [AlarmState::Cleared, AlarmState::Raised, AlarmState::Isolated];
    AlarmTransition {
        number: AlarmNumber::default(),
        written_ns: 0,
        instant_ns: 10 * step,
        step,
        slot,
        identity: 0,
        state: states[step as usize % 3],
        flags: step as u32 % 2,
        verdict: 2,
        occurrence: step,
        certainly_faulty: 0,
        possibly_faulty: 0,
        channel: NONE,
        ratio: f64::NAN,
        fault_estimate: f64::NAN,
        fault_estimate_half_width: f64::NAN,
    }
}

/// Writes transition `BEFORE + 1` into the file at `path`, but no more than `stores` of its stores.
fn write_until_killed(path: &Path, image: &Image, transition: &AlarmTransition, stores: u32) {
    let bytes = fs::read(path).unwrap();
    let (words, _) = bytes.as_chunks::<WORD_BYTES>();
    let words: Vec<_> = (words.iter())
        .map(|word| MortalWord(AtomicU64::new(u64::from_ne_bytes(*word))))
        .collect();
    STORES_LEFT.set(stores);
    write_transition(&words, image, transition, |value| {
        let mut bytes = [0; WORD_BYTES];
        bytes[..4].copy_from_slice(&value.to_ne_bytes());
        words[image.alarms.wake()].store_if_alive(u64::from_ne_bytes(bytes));
    });
    let bytes: Vec<u8> = words.iter().flat_map(|word| word.load().to_ne_bytes()).collect();
    fs::write(path, bytes).unwrap();
}

#[test]
fn every_transition_is_there_or_known_to_be_lost_and_nobody_spins() {
    for stores in 0..=STORES {
        let directory = tempfile::tempdir_in("/dev/shm").unwrap();
        let path = directory.path().join("bounds");
        let mut first = TableWriter::create(&path, &spec(), &OWN).unwrap();
        (1..=BEFORE).for_each(|step| _ = first.raise(&transition(step as u32 % 2, step)));
        let slot = (BEFORE + 1) as u32 % 2;
        write_until_killed(&path, &first.image, &transition(slot, BEFORE + 1), stores);
        std::mem::forget(first);

        let table = TableReader::open(&path).unwrap();
        let newest = table.newest_alarm();
        // `newest` is stored behind the entry.
        assert_eq!(
            newest,
            BEFORE + u64::from(stores > 1 + ALARM_WORDS as u32 - 1 + 1)
        );
        let (begin, sleep) = (Instant::now(), Duration::from_millis(20));
        table.wait_for_alarm(newest, sleep);
        assert!(begin.elapsed() >= sleep, "{stores}: {:?}", begin.elapsed());

        let prepared = PreparedTable::create(&path, &spec(), &OWN).unwrap();
        for (slot, status) in prepared.alarm_status().into_iter().enumerate() {
            let step = (1..=newest).rev().find(|step| step % 2 == slot as u64).unwrap();
            let mut latest = transition(slot as u32, step);
            latest.number.number = step;
            assert_eq!(status, Some(AlarmStatus::after(&latest)), "{stores}");
        }
        let mut second = prepared.publish().unwrap();
        assert_eq!(second.raise(&transition(0, newest + 1)).number, newest + 1);
        let table = TableReader::open(&path).unwrap();
        for number in 1..=newest + 1 {
            match table.read_alarm(number) {
                AlarmRead::Transition(transition) => assert_eq!(transition.step, number),
                other => assert!(
                    other == AlarmRead::Lost && number <= BEFORE + 1 - CAPACITY + 1,
                    "{stores}"
                ),
            }
        }
    }
}
