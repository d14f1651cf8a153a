//! Scenes that clients in other languages must read as the Rust client does.

use std::fs;
use std::process::Command;

use residual_client::{
    AlarmListener, AlarmNumber, AlarmStart, AlarmState, Channel, Instance, Monitor, NONE, StepRecord,
    TableSpec, monotonic_ns,
};

use super::dump::{self, Dump};
use super::support::{daemon, instance, slot, spec, transition};

/// Numbers that a careless client would change: zeros, infinities, subnormal ones, NaN with a payload.
const VALUES: [f64; 10] = [
    0.0,
    -0.0,
    1.0 / 3.0,
    f64::MIN_POSITIVE / 4.0,
    f64::MAX,
    f64::INFINITY,
    f64::NEG_INFINITY,
    f64::NAN,
    f64::from_bits(0x7ff8_dead_beef_0001),
    -1e-300,
];

/// A record with all kinds of values.
fn record(channels: usize, seed: usize) -> StepRecord {
    let value = |index: usize| VALUES[(index + seed) % VALUES.len()];
    let mut record = StepRecord::new(channels);
    record.step = u64::MAX - seed as u64;
    record.instant_ns = monotonic_ns() + 3_600_000_000_000;
    record.certainly_faulty = 1 << 63 | 1;
    record.possibly_faulty = u64::MAX;
    record.inputs_valid = 0x0123_4567_89ab_cdef;
    record.fault_estimate = value(3);
    record.fault_estimate_half_width = value(8);
    record.verdict = (seed % 7) as u32;
    record.flags = u32::MAX - 5;
    record.skipped_instants = 0x8000_0001;
    for (index, channel) in record.channels_mut().iter_mut().enumerate() {
        *channel = Channel {
            lower: value(index),
            residual: value(index + 1),
            upper: value(index + 2),
            ratio: value(index + 3),
        };
    }
    record
}

/// What the Rust client reads of all records.
fn records(instance: &Instance, spec: &TableSpec) -> String {
    let mut monitor = Monitor::open(instance).unwrap();
    let mut text = String::new();
    for slot in &spec.slots {
        let mut record = StepRecord::new(0);
        let reading = monitor.read(&slot.name, &mut record).unwrap();
        text += &dump::diagnoser(slot, &reading, &record);
    }
    text
}

/// Every kind of record, name and freshness is read as Rust reads it, in every bit.
pub fn records_are_read_in_every_bit(client: &mut Command) {
    let (_directory, instance) = instance();
    let mut spec = spec(&["front", "straße", "silent"], 16);
    spec.slots[0].channels = (0..64)
        .map(|index| slot("x").channels[index % 2].clone())
        .collect();
    spec.slots[1].faults = (0..64).map(|index| format!("fault {index}")).collect();
    let mut writer = daemon(&instance, &spec);
    let mut dump = Dump::start(client, &instance, writer.epoch(), 0);
    for seed in 0..14 {
        writer.publish(0, &record(64, seed));
        writer.publish(1, &record(2, seed + 1));
        let expected = format!("daemon running {}\n{}", writer.epoch(), records(&instance, &spec));
        assert_eq!(dump.ask("records"), expected);
    }
    let mut old = record(2, 1);
    old.instant_ns = 0;
    writer.publish(1, &old);
    assert!(dump.ask("records").contains("reading stale 15"));
    writer.close();
    let expected = format!("daemon closed {}\n{}", writer.epoch(), records(&instance, &spec));
    assert!(expected.contains("reading dead 15"), "{expected}");
    assert_eq!(dump.ask("records"), expected);
    drop(writer);
    let next = daemon(&instance, &spec);
    std::thread::sleep(std::time::Duration::from_millis(25));
    let expected = format!("daemon running {}\n{}", next.epoch(), records(&instance, &spec));
    assert_eq!(dump.ask("records"), expected);
}

/// Transitions, gaps, a kill, a restart with other diagnosers and a new numbering are heard as Rust hears them.
pub fn alarms_are_heard_over_gaps_and_restarts(client: &mut Command) {
    let (_directory, instance) = instance();
    let mut writer = daemon(&instance, &spec(&["a", "b"], 16));
    let (epoch, number) = (writer.epoch(), 0);
    let mut dump = Dump::start(client, &instance, epoch, number);
    let after = AlarmStart::After(AlarmNumber { epoch, number });
    let mut listener = AlarmListener::open(&instance, after).unwrap();
    let mut same = |count: usize| {
        let mut expected = String::new();
        for _ in 0..count {
            let event = listener.wait(std::time::Duration::from_secs(20));
            expected += &dump::event(&event.expect("an event in time"));
        }
        assert_eq!(dump.ask(&format!("alarms {count}")), expected);
        expected
    };
    for (index, value) in VALUES.into_iter().enumerate() {
        let mut one = transition(index as u32 % 3, u64::MAX / 16);
        one.state = AlarmState::from_number(index as u32 % 4).unwrap();
        (one.ratio, one.fault_estimate, one.fault_estimate_half_width) = (value, -value, value);
        one.flags = u32::MAX - 1;
        one.channel = [0, 1, 2, NONE][index % 4];
        one.verdict = index as u32 % 7; // 6 is none that this client knows
        one.certainly_faulty = 1 << (index % 4) | 1 << 63;
        writer.raise(&one);
    }
    assert!(same(10).contains("[b] [χ²]"));
    (0..100).for_each(|step| _ = writer.raise(&transition(1, step)));
    assert!(same(17).starts_with("gap 11 94\n"));
    writer.raise(&transition(0, 1));
    std::mem::forget(writer); // killed
    let mut writer = daemon(&instance, &spec(&["c", "b"], 32));
    writer.raise(&transition(1, 2));
    // In between, the alarm of the one that is gone is withdrawn.
    let heard = same(3);
    assert!(heard.contains("[a]") && heard.contains("[b]"), "{heard}");
    drop(writer);
    fs::remove_file(instance.bounds_path()).unwrap();
    let mut writer = daemon(&instance, &spec(&["a"], 16));
    (0..18).for_each(|step| _ = writer.raise(&transition(0, step)));
    let heard = same(18);
    assert!(
        heard.starts_with("new numbering") && heard.contains("\ngap 1 2\n"),
        "{heard}"
    );
}

/// While the daemon writes, is killed and started again, each number comes once or lies in one gap.
pub fn every_number_is_accounted_for(client: &mut Command) {
    const TOTAL: u64 = 40_000;
    let (_directory, instance) = instance();
    let mut writer = daemon(&instance, &spec(&["a"], 64));
    let mut dump = Dump::start(client, &instance, writer.epoch(), 0);
    let answer = std::thread::scope(|scope| {
        scope.spawn(|| {
            for step in 1..=TOTAL {
                writer.raise(&transition(0, step));
                // Bursts of a length that the client can take, and of one that it cannot.
                if step % 50 == 0 && step % 10_000 < 2_000 {
                    std::thread::sleep(std::time::Duration::from_millis(2));
                }
                if step % 10_000 == 0 {
                    let next = daemon(&instance, &spec(&["a"], 64));
                    std::mem::forget(std::mem::replace(&mut writer, next));
                }
            }
        });
        dump.ask(&format!("account {TOTAL}"))
    });
    let counts: Vec<u64> = answer
        .split_whitespace()
        .map(|word| word.parse().unwrap())
        .collect();
    let [seen, missing] = counts[..] else {
        panic!("{answer}")
    };
    assert_eq!(seen + missing, TOTAL);
    assert!(seen >= 64 && missing > 0, "{answer}");
}
