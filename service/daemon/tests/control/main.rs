//! Control of a running daemon: every request has its effect, and none harms it.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[path = "../support/mod.rs"]
mod support;

mod effects;
mod hostile;
mod load;
mod tasks;

use std::time::Duration;

use residual_client::{Control, StepRecord, StepRecords};
use support::publisher::publish_until_told_to_end;
use support::{PATIENCE, Stage, wait_for};

#[test]
#[ignore = "the body of a helper process"]
fn publisher_process() {
    publish_until_told_to_end();
}

/// Control that waits as long as a test may.
fn control(stage: &Stage) -> Control {
    Control::connect(&stage.instance).unwrap().with_timeout(PATIENCE)
}

/// The first record from now on that fits.
fn record(records: &mut StepRecords, what: &str, fits: impl Fn(&StepRecord) -> bool) -> StepRecord {
    wait_for(what, || {
        let mut found = None;
        records.receive(|_, record| {
            if found.is_none() && fits(record) {
                found = Some(*record);
            }
        });
        found
    })
}

/// A timeout that is over soon.
const SHORT: Duration = Duration::from_millis(300);
