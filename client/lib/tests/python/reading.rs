//! What Python reads is what Rust reads.

use std::process::Command;

use super::scenes::{
    alarms_are_heard_over_gaps_and_restarts, every_number_is_accounted_for, records_are_read_in_every_bit,
};
use super::support::{daemon, instance, spec, transition};

fn dump() -> Option<Command> {
    let mut python = super::python()?;
    python.arg(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/python/dump.py"));
    Some(python)
}

#[test]
fn python_reads_every_bit_of_the_records_that_rust_wrote() {
    dump().iter_mut().for_each(records_are_read_in_every_bit);
}

#[test]
fn python_hears_every_alarm_over_gaps_and_restarts() {
    dump()
        .iter_mut()
        .for_each(alarms_are_heard_over_gaps_and_restarts);
}

#[test]
fn python_accounts_for_every_number_while_the_daemon_writes_and_restarts() {
    dump().iter_mut().for_each(every_number_is_accounted_for);
}

#[test]
fn python_refuses_a_table_with_any_word_of_its_directory_changed() {
    let Some(mut python) = super::python() else { return };
    let (directory, instance) = instance();
    let _writer = daemon(&instance, &spec(&["a", "b"], 16));
    let script = "
import sys
from residual_client import Monitor, TableError
from residual_client import _layout as L
directory, = sys.argv[1:]
with open(f'{directory}/residuald.test.bounds', 'rb') as file:
    table = file.read()
count = int.from_bytes(table[8 * L.HEADER_DIRECTORY_BYTES:][:8], sys.byteorder) // 8
def refused(changed):
    with open(f'{directory}/residuald.changed.bounds', 'wb') as file:
        file.write(changed)
    try:
        Monitor('changed', directory)
    except TableError:
        return True
    return False
assert not refused(table)
for index in range(count):
    for bit in (0, 37, 63):
        word = int.from_bytes(table[8 * index:][:8], sys.byteorder) ^ 1 << bit
        changed = table[: 8 * index] + word.to_bytes(8, sys.byteorder) + table[8 * index + 8 :]
        assert refused(changed) != (index in (L.HEADER_STATE, L.HEADER_HEARTBEAT)), index
for length in (0, 7, 8, 255, 256, 8 * count, len(table) - 8):
    assert refused(table[:length]), length
print(count)
";
    let output = python
        .args(["-c", script])
        .arg(directory.path())
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    assert!(
        String::from_utf8(output.stdout)
            .unwrap()
            .trim()
            .parse::<u64>()
            .unwrap()
            > 64
    );
}

#[test]
fn python_sleeps_and_begins_now_on_what_a_killed_daemon_left() {
    let Some(mut python) = super::python() else { return };
    let (directory, instance) = instance();
    let mut writer = daemon(&instance, &spec(&["a"], 16));
    (1..=3).for_each(|step| _ = writer.raise(&transition(0, step)));
    let script = "
import sys, time
from residual_client import AlarmListener
from residual_client import _layout as L
directory, = sys.argv[1:]
with open(f'{directory}/residuald.test.bounds', 'r+b', buffering=0) as file:
    file.seek(8 * L.HEADER_ALARM_RING)
    ring = int.from_bytes(file.read(8), sys.byteorder)
    file.seek(ring + 8 * L.ALARM_RING_WAKE)
    file.write((2).to_bytes(4, sys.byteorder))
    file.seek(ring + 8 * (L.ALARM_RING_ENTRIES + 2 * L.ALARM_WORDS))
    file.write(bytes(8))
listener = AlarmListener('test', directory)
assert listener.position.number == 3, listener.position
began = time.process_time()
assert listener.wait(1.0) is None
assert time.process_time() - began < 0.3, time.process_time() - began
";
    let output = python
        .args(["-c", script])
        .arg(directory.path())
        .output()
        .unwrap();
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{error}");
}
