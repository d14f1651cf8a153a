//! A running daemon reads its configuration again: what is right is taken between two sampling instants, what is
//! wrong is refused, and whatever stayed the same goes on.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod support;

use std::collections::BTreeSet;
use std::fs;
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use nix::sys::signal::Signal;
use residual_client::{Changes, Control, Freshness, Monitor, StepRecord};
use residual_shared::alarm::{AlarmState, NONE, alarm_flags};
use residual_shared::bounds_table::AlarmRead;
use residual_shared::counters::ScheduleCounters;
use residual_shared::transport::{self, RecordSubscriber};
use support::daemon::{Daemon, program};
use support::scalar::{SENSORS, SYSTEMS, Sensor, at_rest, stage};
use support::{Stage, wait_until};
use toml::Value;

/// Growth of the daemon's memory that reloads may leave behind: what allocators keep for later, not what is lost.
/// A leak of one table, 0.2 MB, would be a hundred times as much over the reloads of the long run.
const MEMORY_TOLERANCE_KB: u64 = 2048;

fn control(stage: &Stage) -> Control {
    Control::connect(&stage.instance)
        .unwrap()
        .with_timeout(Duration::from_secs(60))
}

fn names(names: &[&str]) -> Vec<String> {
    names.iter().map(|name| (*name).to_owned()).collect()
}

/// Removes the diagnoser and the input with this number.
fn remove(stage: &mut Stage, number: usize) -> [Value; 2] {
    ["diagnoser", "input"].map(|section| {
        let list = stage.configuration[section].as_array_mut().unwrap();
        list.remove(number)
    })
}

/// Adds a diagnoser and an input at the end.
fn add(stage: &mut Stage, [diagnoser, input]: [Value; 2]) {
    for (section, value) in [("diagnoser", diagnoser), ("input", input)] {
        stage.configuration[section].as_array_mut().unwrap().push(value);
    }
}

#[test]
fn the_answer_says_what_was_added_removed_changed_and_kept() {
    let mut stage = stage();
    let removed = remove(&mut stage, 2);
    let daemon = Daemon::start(&stage);
    let control = control(&stage);
    let epoch = stage.table().directory().epoch;

    let outcome = control.reload().unwrap();
    let unchanged = |count| Changes {
        unchanged: count,
        ..Changes::default()
    };
    assert_eq!((outcome.diagnosers, outcome.inputs), (unchanged(2), unchanged(2)));
    assert!(stage.table().directory().epoch > epoch);

    let first = remove(&mut stage, 0);
    stage.set_diagnoser("priority", 4);
    add(&mut stage, removed);
    stage.configuration_file();
    let outcome = control.reload().unwrap();
    let expected = Changes {
        unchanged: 0,
        changed: names(&[SYSTEMS[1]]),
        added: names(&[SYSTEMS[2]]),
        removed: names(&[SYSTEMS[0]]),
        more: 0,
    };
    assert_eq!(outcome.diagnosers, expected);
    let expected = Changes {
        unchanged: 1,
        added: names(&[SENSORS[2]]),
        removed: names(&[SENSORS[0]]),
        ..Changes::default()
    };
    assert_eq!(outcome.inputs, expected);
    assert_eq!(control.list().unwrap().diagnosers.len(), 2);
    assert_eq!(control.describe(SYSTEMS[2]).unwrap().slot, 1);

    // Samples of the input that comes back arrive again.
    add(&mut stage, first);
    stage.configuration_file();
    control.reload().unwrap();
    let sensor = Sensor::start(&stage, at_rest);
    wait_until("samples", || {
        stage.table().read_input_counters(2).unwrap().accepted > 5
    });
    drop(sensor);
    daemon.stop();
}

#[test]
fn what_is_wrong_is_refused_with_its_place_and_changes_nothing() {
    let mut stage = stage();
    let daemon = Daemon::start(&stage);
    let control = control(&stage);
    let epoch = stage.table().directory().epoch;
    let path = stage.configuration_file();
    let good = fs::read_to_string(&path).unwrap();
    let refused = |what: &str, phrase: &str| {
        let message = control.reload().unwrap_err().to_string();
        assert!(message.contains(phrase), "{what}: {message}");
        assert_eq!(stage.table().directory().epoch, epoch, "{what}");
    };
    fs::write(&path, format!("{good}\nno toml")).unwrap();
    refused("no TOML", "1 mistake");
    fs::write(
        &path,
        good.replace("priority", "piority")
            .replace("[daemon]", "[daemon]\npriority = 1"),
    )
    .unwrap();
    refused("an unknown key", "priority");
    fs::write(
        &path,
        good.replace("sample_time_s = 0.01", "sample_time_s = -1.0"),
    )
    .unwrap();
    refused("an impossible period", "a period of -1 s is not possible");
    fs::write(
        &path,
        good.replace("[daemon]", "[daemon]\ngains_file = \"none.toml\""),
    )
    .unwrap();
    refused("a missing gains file", "none.toml");
    fs::remove_file(&path).unwrap();
    refused("no file", "cannot read the configuration");

    stage.set("daemon", "record_queue", 77);
    stage.set("realtime", "lock_memory", false);
    stage.configuration["input"][0]
        .as_table_mut()
        .unwrap()
        .insert("buffer_samples".into(), 9.into());
    stage.configuration_file();
    let message = control.reload().unwrap_err().to_string();
    for key in [
        "a restart is needed",
        "`record_queue`",
        "[realtime]",
        "`buffer_samples` of the input `stable_sensor`",
    ] {
        assert!(message.contains(key), "{message}");
    }
    let steps = stage.schedule_counters().steps;
    wait_until("steps", || stage.schedule_counters().steps > steps + 5);
    daemon.stop();
}

#[test]
fn a_configuration_from_standard_input_cannot_be_read_again() {
    let stage = stage();
    let mut command = Command::new("sh");
    command
        .args(["-c", "exec \"$0\" run --summary json - < \"$1\""])
        .arg(program().get_program())
        .arg(stage.configuration_file());
    let mut daemon = Daemon::spawn_command(&stage, &mut command);
    daemon.wait_ready();
    let message = control(&stage).reload().unwrap_err().to_string();
    assert!(message.contains("standard input"), "{message}");
    daemon.stop();
}

#[test]
fn a_hangup_signal_reloads_and_a_wrong_configuration_leaves_the_daemon_as_it_was() {
    let mut stage = stage();
    let mut daemon = Daemon::start(&stage);
    let epoch = || stage_epoch(&stage.instance);
    let before = epoch();
    daemon.signal(Signal::SIGHUP);
    wait_until("a new table", || epoch() > before);
    let before = epoch();
    fs::write(stage.configuration_file(), "wrong").unwrap();
    daemon.signal(Signal::SIGHUP);
    wait_until("the log", || daemon.messages().contains("1 mistake"));
    assert!(daemon.is_alive());
    assert_eq!(epoch(), before);
    remove(&mut stage, 2);
    stage.configuration_file();
    daemon.signal(Signal::SIGHUP);
    wait_until("a smaller table", || {
        stage.table().directory().spec.slots.len() == 2
    });
    daemon.stop();
}

fn stage_epoch(instance: &residual_shared::names::Instance) -> u64 {
    let table = residual_shared::bounds_table::TableReader::open(&instance.bounds_path()).unwrap();
    table.directory().epoch
}

#[test]
fn the_alarm_of_a_diagnoser_that_is_gone_is_withdrawn_and_that_of_another_one_goes_on() {
    let mut stage = stage();
    let daemon = Daemon::start(&stage);
    let control = control(&stage);
    let sensor = Sensor::start(&stage, |k| if k % 100 < 50 { 100.0 } else { -100.0 });
    let is_active = |stage: &Stage| stage.table().read_alarm_status(0).unwrap().state >= 2;
    wait_until("an alarm", || is_active(&stage));
    let newest = stage.table().newest_alarm();

    // Kept: the alarm goes on, shown in the new table.
    remove(&mut stage, 2);
    stage.configuration_file();
    control.reload().unwrap();
    assert!(is_active(&stage));
    let withdrawn = |stage: &Stage| {
        let table = stage.table();
        let of = |number| match table.read_alarm(number) {
            AlarmRead::Transition(transition) => {
                (transition.flags & alarm_flags::WITHDRAWN != 0).then_some(transition)
            }
            _ => None,
        };
        (newest + 1..=table.newest_alarm())
            .filter_map(of)
            .collect::<Vec<_>>()
    };
    assert_eq!(withdrawn(&stage).len(), 0);

    drop(sensor);
    wait_until("an alarm", || is_active(&stage));
    let identity = stage.table().directory().spec.slots[0].identity();
    remove(&mut stage, 0);
    stage.configuration_file();
    control.reload().unwrap();
    let withdrawn = withdrawn(&stage);
    assert_eq!(withdrawn.len(), 1, "{withdrawn:?}");
    let transition = withdrawn[0];
    assert_eq!(transition.state, AlarmState::Cleared);
    assert_eq!((transition.slot, transition.identity), (NONE, identity));
    assert_eq!(transition.number.epoch, stage.table().directory().epoch);
    daemon.stop();
}

/// Receives all step records while reloads go on; counts those of the diagnoser in slot 0 and remembers a gap.
struct Recording {
    end: Arc<AtomicBool>,
    thread: thread::JoinHandle<(u64, Vec<(u64, u64)>)>,
}

impl Recording {
    fn start(stage: &Stage) -> Self {
        let (instance, end) = (stage.instance.clone(), Arc::new(AtomicBool::new(false)));
        let told = Arc::clone(&end);
        let thread = thread::spawn(move || {
            let node = transport::open_node(&instance).unwrap();
            let subscriber = RecordSubscriber::open(&node, &instance).unwrap();
            let (mut count, mut last, mut gaps) = (0, None, Vec::new());
            while !told.load(Ordering::Relaxed) {
                subscriber.receive(|header, record| {
                    if header.slot == 0 {
                        if let Some(last) = last.replace(record.step).filter(|last| last + 1 != record.step) {
                            gaps.push((last, record.step));
                        }
                        count += 1;
                    }
                });
                thread::sleep(Duration::from_millis(5));
            }
            (count, gaps)
        });
        Self { end, thread }
    }

    /// How many records there were, and where some were missing: the steps before and after.
    fn finish(self) -> (u64, Vec<(u64, u64)>) {
        self.end.store(true, Ordering::Relaxed);
        self.thread.join().unwrap()
    }
}

/// A client that polls all the time; it remembers in which tables it read a fresh record.
struct Client {
    end: Arc<AtomicBool>,
    thread: thread::JoinHandle<BTreeSet<u64>>,
}

impl Client {
    fn start(stage: &Stage) -> Self {
        let (instance, end) = (stage.instance.clone(), Arc::new(AtomicBool::new(false)));
        let told = Arc::clone(&end);
        let thread = thread::spawn(move || {
            let mut monitor = Monitor::connect(&instance);
            let followed = monitor.follow(SYSTEMS[0]).unwrap();
            let (mut record, mut epochs) = (StepRecord::new(0), BTreeSet::new());
            while !told.load(Ordering::Relaxed) {
                let reading = monitor.read_followed(followed, &mut record).unwrap();
                if reading.freshness == Freshness::Fresh {
                    epochs.insert(reading.epoch);
                }
                thread::sleep(Duration::from_micros(500));
            }
            epochs
        });
        Self { end, thread }
    }

    fn finish(self) -> BTreeSet<u64> {
        self.end.store(true, Ordering::Relaxed);
        self.thread.join().unwrap()
    }
}

/// Resident memory of a process, kB, and its open files.
fn memory_and_files(pid: u32) -> (u64, usize) {
    let status = fs::read_to_string(format!("/proc/{pid}/status")).unwrap();
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix("VmRSS:"))
        .unwrap();
    let memory = line.trim().trim_end_matches(" kB").parse().unwrap();
    (memory, fs::read_dir(format!("/proc/{pid}/fd")).unwrap().count())
}

/// Writes the configuration of reload number `reload`: every second one is wrong, the others change, remove and add
/// the last two diagnosers by turns. The first diagnoser and its input always stay the same.
fn write_configuration(stage: &mut Stage, whole: &toml::Table, reload: usize) -> bool {
    stage.configuration = whole.clone();
    match reload / 2 % 4 {
        0 => {}
        1 => drop(remove(stage, 2)),
        2 => {
            stage.diagnosers()[1]
                .as_table_mut()
                .unwrap()
                .insert("priority".into(), 1.into());
        }
        _ => {
            let last = remove(stage, 2);
            let middle = remove(stage, 1);
            add(stage, last);
            add(stage, middle);
        }
    }
    let valid = reload.is_multiple_of(2);
    if !valid {
        match reload / 2 % 3 {
            0 => drop(
                stage.diagnosers()[0]
                    .as_table_mut()
                    .unwrap()
                    .remove("measurements"),
            ),
            1 => stage.set("daemon", "record_queue", 9),
            _ => stage.set_diagnoser("sample_time_s", 0.0),
        }
    }
    stage.configuration_file();
    valid
}

/// Reloads under load, valid and invalid by turns.
fn reload_under_load(reloads: usize) {
    let mut stage = stage();
    let whole = stage.configuration.clone();
    let daemon = Daemon::start(&stage);
    let sensor = Sensor::start(&stage, at_rest);
    let (client, recording) = (Client::start(&stage), Recording::start(&stage));
    let control = control(&stage);
    let mut epochs = vec![stage.table().directory().epoch];
    let mut settled = None;
    for reload in 0..reloads {
        let valid = write_configuration(&mut stage, &whole, reload);
        let before = stage.table().directory().epoch;
        let outcome = control.reload();
        let epoch = stage.table().directory().epoch;
        assert_eq!(outcome.is_ok(), valid, "reload {reload}: {outcome:?}");
        assert_eq!(epoch > before, valid, "reload {reload}");
        if let Ok(outcome) = outcome {
            assert!(
                outcome.diagnosers.unchanged >= 1 && outcome.inputs.unchanged >= 1,
                "{outcome:?}"
            );
            epochs.push(epoch);
            // Reloads by hand are not this quick; the client needs a turn on the processor.
            thread::sleep(Duration::from_millis(10));
        }
        // In the same configuration as at the end.
        if reload % 8 == 0 && reload >= reloads / 4 && settled.is_none() {
            settled = Some(memory_and_files(daemon.pid()));
        }
    }
    write_configuration(&mut stage, &whole, 0);
    control.reload().unwrap();
    epochs.push(stage.table().directory().epoch);
    thread::sleep(Duration::from_millis(100));
    let (memory, files) = settled.unwrap();
    let (memory_now, files_now) = memory_and_files(daemon.pid());
    let (records, gaps) = recording.finish();
    let seen = client.finish();
    drop((sensor, control));
    let counters: ScheduleCounters = stage.schedule_counters();
    println!(
        "{reloads} reloads, {records} records, {counters:?}, memory {memory} kB then {memory_now} kB, files {files} then \
         {files_now}, {} of {} tables seen fresh",
        seen.len(),
        epochs.len()
    );
    assert_eq!(gaps, [], "steps without gaps");
    assert_eq!((counters.skipped, counters.records_dropped), (0, 0));
    assert!(
        counters.steps >= records && records as usize > reloads / 2,
        "{counters:?}"
    );
    assert_eq!(files_now, files);
    assert!(
        memory_now <= memory + MEMORY_TOLERANCE_KB,
        "{memory} kB, then {memory_now} kB"
    );
    let wrong: Vec<&u64> = seen.iter().filter(|epoch| !epochs.contains(epoch)).collect();
    assert_eq!(wrong, Vec::<&u64>::new(), "tables that never were");
    // On a loaded machine the client does not get its turn during every table.
    assert!(
        seen.len() > epochs.len() / 2,
        "{} of {}",
        seen.len(),
        epochs.len()
    );
    let summary = daemon.stop();
    assert_eq!(summary.diagnosers[0].name, SYSTEMS[0]);
    stage.assert_only_table_and_lock_are_left();
}

#[test]
fn two_hundred_reloads_valid_and_invalid_by_turns_disturb_nobody() {
    reload_under_load(200);
}

#[test]
#[ignore = "one minute: cargo test -p residuald --test reload -- --ignored thousand"]
fn a_thousand_reloads_valid_and_invalid_by_turns_disturb_nobody_and_leak_nothing() {
    reload_under_load(1000);
}
