//! What C reads is what Rust reads.

use std::process::Command;

use super::compiler::{Linked, compile};
use super::scenes::{
    alarms_are_heard_over_gaps_and_restarts, every_number_is_accounted_for, records_are_read_in_every_bit,
};

/// Lets the program that writes what C reads go through a scene.
fn play(linked: Linked, scene: impl FnOnce(&mut Command)) {
    let folder = tempfile::tempdir().unwrap();
    if let Some(program) = compile("tests/c/dump.c", linked, &folder) {
        scene(&mut Command::new(program));
    }
}

#[test]
fn c_reads_every_bit_of_the_records_that_rust_wrote() {
    play(Linked::Dynamically, records_are_read_in_every_bit);
}

#[test]
fn c_hears_every_alarm_over_gaps_and_restarts() {
    play(Linked::Statically, alarms_are_heard_over_gaps_and_restarts);
}

#[test]
fn c_accounts_for_every_number_while_the_daemon_writes_and_restarts() {
    play(Linked::Dynamically, every_number_is_accounted_for);
}
