//! Clients over many lives of a daemon that is killed again and again.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod support;

use std::sync::atomic::Ordering;
use std::time::Duration;

use residual_client::{DaemonState, Freshness, Monitor, SlotSpec, StepRecord, TableSpec, monotonic_ns};
use support::daemon::Daemon;
use support::helper::{Helper, instance, told_to_end};
use support::publisher::publish_until_told_to_end;
use support::{DIAGNOSER, Stage, wait_for, wait_until};

const ROUNDS: usize = 20;
const CLIENTS: usize = 4;

/// Within this time of a new table every client has a fresh record again.
const BACK_WITHIN_NS: u64 = 1_000_000_000;

#[test]
#[ignore = "the body of a helper process"]
fn publisher_process() {
    publish_until_told_to_end();
}

/// The body of a client process: polls each millisecond, writes a line at every first fresh record of a life
/// (`fresh EPOCH MONOTONIC_NS`) and one for every record that contradicts itself (`torn …`).
#[test]
#[ignore = "the body of a helper process"]
fn client_process() {
    let Some(instance) = instance() else { return };
    let end = told_to_end();
    let mut monitor = Monitor::connect(&instance);
    let followed = monitor.follow(DIAGNOSER).unwrap();
    let mut record = StepRecord::new(0);
    let (mut fresh_in, mut reads) = (0, 0_u64);
    while !end.load(Ordering::Relaxed) {
        let reading = monitor.read_followed(followed, &mut record).unwrap();
        reads += 1;
        if let (Some(table), true) = (monitor.table(), reading.number > 0) {
            let spec = &table.directory().spec;
            if let Some(contradiction) = contradiction(spec, &spec.slots[0], &record) {
                println!("torn {contradiction}");
            }
        }
        if reading.freshness == Freshness::Fresh && fresh_in != reading.epoch {
            fresh_in = reading.epoch;
            println!("fresh {} {}", reading.epoch, monotonic_ns());
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    println!("reads {reads}");
}

/// What in a record cannot have been written in one piece.
fn contradiction(spec: &TableSpec, slot: &SlotSpec, record: &StepRecord) -> Option<String> {
    let instant_ns = spec.schedule_epoch_ns + slot.phase_ns + record.step * slot.period_ns;
    if record.instant_ns != instant_ns {
        return Some(format!("step {} at {}", record.step, record.instant_ns));
    }
    if record.channels().len() != slot.channels.len() {
        return Some(format!("{} channels", record.channels().len()));
    }
    let torn = slot
        .channels
        .iter()
        .zip(record.channels())
        .position(|(description, channel)| {
            if !channel.is_evaluated() {
                return [channel.lower, channel.residual, channel.upper] != [0.0; 3];
            }
            let inside = (channel.lower..=channel.upper).contains(&channel.residual);
            // Floors and estimates are not tested; all others are tested against symmetric bounds.
            match description.name.as_str() {
                name if name.contains("_fault_estimate_") => channel.ratio != 0.0 || !inside,
                name if name.contains("able_fault_") => channel.ratio != 0.0,
                _ if channel.residual == 0.0 => channel.ratio != 0.0,
                _ => {
                    channel.lower != -channel.upper || channel.ratio != channel.residual.abs() / channel.upper
                }
            }
        })?;
    Some(format!("channel {torn}: {:?}", record.channels()[torn]))
}

/// When a client first read a fresh record of a life.
fn fresh_since(client: &Helper, epoch: u64) -> Option<u64> {
    let begin = format!("fresh {epoch} ");
    let lines = client.lines();
    lines
        .iter()
        .find_map(|line| line.strip_prefix(&begin)?.parse().ok())
}

#[test]
fn clients_survive_twenty_kills_and_are_fresh_within_a_second() {
    let stage = Stage::new();
    let mut daemon = Daemon::spawn(&stage, &[]);
    let mut epoch = daemon.wait_ready().directory().epoch;
    let publisher = Helper::start(&stage, "publisher_process");
    let mut clients: Vec<Helper> = (0..CLIENTS)
        .map(|_| Helper::start(&stage, "client_process"))
        .collect();
    for client in &clients {
        wait_for("the first fresh record", || fresh_since(client, epoch));
    }

    let mut delays_ns = Vec::new();
    for _ in 0..ROUNDS {
        daemon.kill();
        daemon = Daemon::spawn(&stage, &[]);
        let table = daemon.wait_ready();
        let ready_ns = monotonic_ns();
        assert!(table.directory().epoch > epoch, "epochs rise");
        epoch = table.directory().epoch;
        for client in &clients {
            let fresh_ns = wait_for("a fresh record", || fresh_since(client, epoch));
            delays_ns.push(fresh_ns.saturating_sub(ready_ns));
        }
    }
    delays_ns.sort_unstable();
    let milliseconds = |share: f64| {
        let index = (share * (delays_ns.len() - 1) as f64) as usize;
        delays_ns[index] as f64 * 1e-6
    };
    println!(
        "from the new table to the first fresh record, {} clients and restarts: p50 {:.1} ms, p90 {:.1} ms, max {:.1} ms",
        delays_ns.len(),
        milliseconds(0.5),
        milliseconds(0.9),
        milliseconds(1.0)
    );
    assert!(
        delays_ns.iter().all(|&delay| delay <= BACK_WITHIN_NS),
        "{delays_ns:?}"
    );

    let counters = stage.input_counters(0);
    assert_eq!(
        counters.publisher_changes, 0,
        "one publisher lived through it all"
    );
    assert!(clients.iter_mut().all(Helper::is_alive));
    for client in clients {
        let lines = client.finish();
        assert!(!lines.iter().any(|line| line.starts_with("torn")), "{lines:?}");
        let reads = lines.iter().find_map(|line| line.strip_prefix("reads "));
        assert!(reads.unwrap().parse::<u64>().unwrap() > 100, "{lines:?}");
    }
    publisher.finish();
    daemon.stop();
    stage.assert_only_table_and_lock_are_left();
}

#[test]
fn a_killed_client_disturbs_nobody() {
    let stage = Stage::new();
    let daemon = Daemon::start(&stage);
    let epoch = stage.table().directory().epoch;
    let publisher = Helper::start(&stage, "publisher_process");
    let (killed, spared) = (
        Helper::start(&stage, "client_process"),
        Helper::start(&stage, "client_process"),
    );
    for client in [&killed, &spared] {
        wait_for("a fresh record", || fresh_since(client, epoch));
    }
    let files = (stage.runtime_files(), stage.shared_memory_files().len());
    killed.kill();
    let steps = stage.schedule_counters().steps;
    wait_until("ten steps more", || stage.schedule_counters().steps >= steps + 10);
    let mut monitor = Monitor::open(&stage.instance).unwrap();
    let mut record = StepRecord::new(0);
    wait_until("a fresh record", || {
        monitor.read(DIAGNOSER, &mut record).unwrap().freshness == Freshness::Fresh
    });
    assert!(matches!(monitor.state(), DaemonState::Running));
    assert_eq!(files, (stage.runtime_files(), stage.shared_memory_files().len()));
    let lines = spared.finish();
    assert!(!lines.iter().any(|line| line.starts_with("torn")), "{lines:?}");
    publisher.finish();
    daemon.stop();
    stage.assert_only_table_and_lock_are_left();
}

#[test]
fn a_publisher_that_outlives_the_daemon_leaves_nothing_that_the_next_one_does_not_clear() {
    let stage = Stage::new();
    let daemon = Daemon::start(&stage);
    let publisher = Helper::start(&stage, "publisher_process");
    wait_until("a sample", || stage.input_counters(0).accepted > 0);
    daemon.stop();
    publisher.kill();
    Daemon::start(&stage).stop();
    stage.assert_only_table_and_lock_are_left();
}
