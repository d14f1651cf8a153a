//! What Python reads is what Rust reads.

use std::process::Command;

use super::scenes::{alarms_are_heard_over_gaps_and_restarts, records_are_read_in_every_bit};

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
