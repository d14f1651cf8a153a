//! `_layout.py` is what the Rust code says.

use std::fmt::Write;
use std::fs;

use residual_client::{AlarmState, AlarmStatus, DEFAULT_RUNTIME_DIRECTORY, RUNTIME_DIRECTORY_VARIABLE};
use residual_shared::bounds_table::layout::{self, alarm_ring, header, slot_entry};
use residual_shared::bounds_table::{HUNG_AFTER_NS, protocol};

/// Lines `NAME = value` of the constants of a module, each with this prefix.
macro_rules! constants {
    ($text:expr, $prefix:literal, $module:ident: $($name:ident)*) => {
        $(writeln!($text, "{}{} = {}", $prefix, stringify!($name), $module::$name).unwrap();)*
    };
}

fn generate() -> String {
    let mut text = String::from(
        "\"\"\"Where everything lies in a bounds table.\n\nGenerated from the Rust code; do not edit.\n\"\"\"\n\n",
    );
    constants!(text, "", layout: MAGIC VERSION HASH WORD_BYTES LINE_WORDS RECORD_HEAD_WORDS CHANNEL_WORDS ALARM_WORDS
        STATE_RUNNING FNV_START FNV_PRIME);
    constants!(text, "HEADER_", header: MAGIC VERSION HASH TOTAL_BYTES DIRECTORY_BYTES CHECKSUM SLOT_COUNT
        SLOT_ENTRIES INSTANCE PID EPOCH BOOT_ID_LOW BOOT_ID_HIGH TIME_ORIGIN_NS TIME_SPEED STALE_AFTER_PERIODS
        ALARM_RING ALARM_CAPACITY ALARM_ORIGIN STATE HEARTBEAT WORDS);
    constants!(text, "SLOT_ENTRY_", slot_entry: NAME METHOD PERIOD_NS PHASE_NS MARGIN_NS CHANNEL_COUNT CHANNELS
        FAULT_COUNT FAULTS SLOT CELL_BYTES ALARM WORDS);
    constants!(text, "ALARM_RING_", alarm_ring: NEWEST WAKE ENTRIES);
    writeln!(text, "HUNG_AFTER_NS = {HUNG_AFTER_NS}").unwrap();
    writeln!(text, "READ_ATTEMPTS = {}", protocol::READ_ATTEMPTS).unwrap();
    let states: Vec<_> = (0..)
        .map_while(AlarmState::from_number)
        .map(AlarmState::name)
        .collect();
    writeln!(text, "ALARM_STATES = {states:?}").unwrap();
    writeln!(text, "ALARM_STATUS = {:?}", AlarmStatus::NAMES).unwrap();
    writeln!(
        text,
        "RUNTIME_DIRECTORY_VARIABLE = {RUNTIME_DIRECTORY_VARIABLE:?}"
    )
    .unwrap();
    writeln!(text, "DEFAULT_RUNTIME_DIRECTORY = {DEFAULT_RUNTIME_DIRECTORY:?}").unwrap();
    text
}

#[test]
fn the_layout_constants_are_those_of_the_code() {
    let path = super::package().join("residual_client/_layout.py");
    let generated = generate();
    if std::env::var_os("RESIDUAL_WRITE_GENERATED").is_some() {
        fs::write(&path, &generated).unwrap();
    }
    assert!(
        fs::read_to_string(&path).unwrap_or_default() == generated,
        "{} is not that of the code; run `RESIDUAL_WRITE_GENERATED=1 cargo test -p residual-client --test python`",
        path.display()
    );
}
