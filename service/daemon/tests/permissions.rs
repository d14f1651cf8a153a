//! Who may read what the daemon writes: `group` and `mode` of the configuration, seen by other users' processes.
//!
//! Needs root, to act as other users; otherwise the tests say that they were skipped.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod support;

use std::fs::{self, OpenOptions, Permissions};
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::os::unix::process::CommandExt;

use residual_client::{AlarmEvent, AlarmListener, AlarmStart, Control, Monitor, StepRecord};
use residual_shared::clock::{monotonic_ns, sleep_until_monotonic};
use support::daemon::Daemon;
use support::helper::{Helper, instance};
use support::publisher::{Drivers, at_rest};
use support::{DIAGNOSER, PATIENCE, PERIOD_NS, Stage, is_root, wait_until};

/// Ids that no account needs to have.
const GROUP: u32 = 61_001;
const USER: u32 = 61_002;
const OTHER_GROUP: u32 = 61_003;

/// The body of a client process: writes what it could do with the table.
#[test]
#[ignore = "the body of a helper process"]
fn client_process() {
    let Some(instance) = instance() else { return };
    match Monitor::open(&instance) {
        Ok(mut monitor) => {
            let reading = monitor.read(DIAGNOSER, &mut StepRecord::new(0)).unwrap();
            println!("read {}", reading.freshness.name());
        }
        Err(error) => println!("refused {error}"),
    }
    let writable = OpenOptions::new().write(true).open(instance.bounds_path());
    println!("writable {}", writable.is_ok());
    match Control::connect(&instance) {
        Ok(_) => println!("controls"),
        Err(error) => println!("no control: {error}"),
    }
}

/// The body of an alarm consumer: sleeps until an alarm is raised.
#[test]
#[ignore = "the body of a helper process"]
fn consumer_process() {
    let Some(instance) = instance() else { return };
    match AlarmListener::open(&instance, AlarmStart::Oldest) {
        Ok(mut listener) => {
            println!("listening");
            while let Some(event) = listener.wait(PATIENCE) {
                if let AlarmEvent::Transition(alarm) = event {
                    println!("heard {}", alarm.transition.state.name());
                    if alarm.transition.state.is_active() {
                        return;
                    }
                }
            }
            println!("heard nothing");
        }
        Err(error) => println!("refused {error}"),
    }
}

/// A process of another user, in this group.
fn start_as(stage: &Stage, body: &str, group: u32) -> Helper {
    let mut command = Helper::command(stage, body);
    command.uid(USER).gid(group);
    Helper::start_command(stage, body, &mut command)
}

/// What a client of another user and group finds.
fn as_stranger(stage: &Stage, group: u32) -> String {
    let lines = start_as(stage, "client_process", group).finish();
    let said = |line: &&String| {
        ["read ", "refused ", "writable ", "control"]
            .iter()
            .any(|word| line.contains(word))
    };
    lines.iter().filter(said).cloned().collect::<Vec<_>>().join("\n")
}

/// A stage whose directory everybody may search.
fn open_stage() -> Stage {
    let stage = Stage::new();
    fs::set_permissions(stage.directory.path(), Permissions::from_mode(0o755)).unwrap();
    stage
}

#[test]
fn the_configured_group_reads_and_nobody_else_does() {
    if !is_root() {
        return;
    }
    let mut stage = open_stage();
    stage.set("daemon", "group", i64::from(GROUP));
    let daemon = Daemon::start(&stage);
    let metadata = fs::metadata(stage.instance.bounds_path()).unwrap();
    assert_eq!((metadata.gid(), metadata.mode() & 0o7777), (GROUP, 0o640));

    let member = as_stranger(&stage, GROUP);
    assert!(
        member.contains("read starting") && member.contains("writable false"),
        "{member}"
    );
    let outsider = as_stranger(&stage, OTHER_GROUP);
    assert!(
        outsider.contains("refused") && outsider.contains(&format!("gid {GROUP}")),
        "{outsider}"
    );
    assert!(outsider.contains("writable false"), "{outsider}");
    daemon.stop();
}

#[test]
fn only_the_daemons_own_user_controls_it_and_others_are_told_why() {
    if !is_root() {
        return;
    }
    let mut stage = open_stage();
    stage.set("daemon", "group", i64::from(GROUP));
    let daemon = Daemon::start(&stage);
    for group in [GROUP, OTHER_GROUP] {
        let said = as_stranger(&stage, group);
        assert!(said.contains("no control: "), "{said}");
        assert!(said.contains("open to the user `root` only"), "{said}");
    }
    Control::connect(&stage.instance).unwrap().list().unwrap();
    assert_eq!(daemon.stop().control.answered, 1);
}

#[test]
fn a_member_of_the_group_sleeps_until_an_alarm_wakes_it_and_nobody_else_hears_it() {
    if !is_root() {
        return;
    }
    let mut stage = open_stage();
    stage.set("daemon", "group", i64::from(GROUP));
    let daemon = Daemon::start(&stage);
    let outsider = start_as(&stage, "consumer_process", OTHER_GROUP)
        .finish()
        .join("\n");
    assert!(
        outsider.contains("refused") && outsider.contains(&format!("gid {GROUP}")),
        "{outsider}"
    );
    let mut member = start_as(&stage, "consumer_process", GROUP);
    wait_until("the member listens", || {
        member.lines().iter().any(|line| line.contains("listening"))
    });
    assert!(member.is_alive());

    // The first actuator is stuck: what is commanded has no effect.
    let mut drivers = Drivers::open(&stage.instance);
    let start_ns = monotonic_ns();
    for k in 0.. {
        if !member.is_alive() {
            break;
        }
        let stamp_ns = start_ns + k * PERIOD_NS;
        sleep_until_monotonic(stamp_ns);
        drivers.sensors.send(stamp_ns, &at_rest(k)).unwrap();
        drivers.commands.send(stamp_ns, &[-2.0, 0.0]).unwrap();
    }
    let heard = member.finish().join("\n");
    assert!(
        heard.contains("heard raised") || heard.contains("heard isolated"),
        "{heard}"
    );
    daemon.stop();
}

#[test]
fn the_configured_mode_opens_the_table_to_everybody_and_to_no_writer() {
    if !is_root() {
        return;
    }
    let mut stage = open_stage();
    stage.set("daemon", "mode", "0644");
    let daemon = Daemon::start(&stage);
    let stranger = as_stranger(&stage, OTHER_GROUP);
    assert!(
        stranger.contains("read starting") && stranger.contains("writable false"),
        "{stranger}"
    );
    daemon.stop();
}

#[test]
fn nothing_but_the_table_is_open_to_others() {
    if !is_root() {
        return;
    }
    let mut stage = open_stage();
    stage.set("daemon", "mode", "0644");
    let daemon = Daemon::start(&stage);
    let mode = |path: &std::path::Path| fs::metadata(path).unwrap().mode() & 0o7777;
    assert_eq!(mode(&stage.instance.iceoryx_root()), 0o700);
    assert_eq!(mode(&stage.instance.lock_path()), 0o600);
    let shared_memory = stage.shared_memory_files();
    assert!(!shared_memory.is_empty());
    for path in shared_memory {
        assert_eq!(mode(&path) & 0o007, 0, "{}", path.display());
    }
    daemon.stop();
}
