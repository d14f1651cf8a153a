//! Many requests, and several clients.

use std::fs;
use std::thread;

use residual_client::Control;

use super::control;
use super::support::daemon::Daemon;
use super::support::scalar;
use super::support::{DIAGNOSER, PATIENCE, Stage, wait_until};

/// Open files, mapped regions and resident memory (KiB) of a process.
#[derive(Clone, Copy, Debug)]
struct Held {
    files: usize,
    regions: usize,
    resident: u64,
}

impl Held {
    fn by(pid: u32) -> Self {
        let read = |file: &str| fs::read_to_string(format!("/proc/{pid}/{file}")).unwrap();
        let status = read("status");
        let resident = status
            .lines()
            .find_map(|line| line.strip_prefix("VmRSS:"))
            .unwrap();
        Self {
            files: fs::read_dir(format!("/proc/{pid}/fd")).unwrap().count(),
            regions: read("maps").lines().count(),
            resident: resident.trim().trim_end_matches(" kB").parse().unwrap(),
        }
    }
}

/// 2 MiB: what an allocator may keep back.
const MEMORY_NOISE_KIB: u64 = 2048;
/// What an allocator maps for itself. Were a region lost with every request, there would be many more.
const REGIONS_NOISE: usize = 8;

#[test]
fn two_hundred_requests_in_a_row_leave_files_and_memory_as_they_were() {
    let stage = Stage::new();
    let daemon = Daemon::start(&stage);
    let control = control(&stage);
    let ask = |count| {
        for _ in 0..count {
            control.list().unwrap();
            control.describe(DIAGNOSER).unwrap();
            control.reset(DIAGNOSER).unwrap();
            control.describe("nobody").unwrap_err();
        }
    };
    ask(5);
    let before = Held::by(daemon.pid());
    ask(50);
    let after = Held::by(daemon.pid());
    assert_eq!(after.files, before.files);
    assert!(
        after.regions <= before.regions + REGIONS_NOISE,
        "{before:?}, {after:?}"
    );
    assert!(
        after.resident <= before.resident + MEMORY_NOISE_KIB,
        "{before:?}, {after:?}"
    );
    assert_eq!(daemon.stop().control.answered, 4 * 55);
}

#[test]
fn a_reset_of_two_hundred_slow_diagnosers_is_obeyed_in_time() {
    let mut stage = scalar::stage();
    let mut slow = stage.diagnosers()[0].clone();
    stage.diagnosers().clear();
    for number in 0..200 {
        let diagnoser = slow.as_table_mut().unwrap();
        diagnoser.insert("name".into(), format!("slow{number}").into());
        diagnoser.insert("sample_time_s".into(), 1.0.into());
        stage.diagnosers().push(slow.clone());
    }
    let daemon = Daemon::start(&stage);
    assert_eq!(control(&stage).reset_all().unwrap(), 200);
    daemon.stop();
}

#[test]
fn clients_that_come_and_go_leave_nothing_in_the_daemon() {
    let stage = Stage::new();
    let daemon = Daemon::start(&stage);
    let come_and_go = |count| {
        for _ in 0..count {
            control(&stage).list().unwrap();
        }
    };
    come_and_go(3);
    let before = Held::by(daemon.pid());
    come_and_go(30);
    // A client that has gone is noticed with the next request.
    control(&stage).list().unwrap();
    wait_until("as many files as before", || {
        Held::by(daemon.pid()).files <= before.files
    });
    let after = Held::by(daemon.pid());
    assert!(
        after.regions <= before.regions + REGIONS_NOISE,
        "{before:?}, {after:?}"
    );
    assert!(
        after.resident <= before.resident + MEMORY_NOISE_KIB,
        "{before:?}, {after:?}"
    );
    daemon.stop();
    stage.assert_only_table_and_lock_are_left();
}

#[test]
fn two_clients_at_once_are_both_answered() {
    let stage = Stage::new();
    let daemon = Daemon::start(&stage);
    let clients: Vec<_> = (0..2)
        .map(|_| {
            let instance = stage.instance.clone();
            thread::spawn(move || {
                let control = Control::connect(&instance).unwrap().with_timeout(PATIENCE);
                for _ in 0..25 {
                    control.reset(DIAGNOSER).unwrap();
                    assert_eq!(control.describe(DIAGNOSER).unwrap().name, DIAGNOSER);
                }
            })
        })
        .collect();
    for client in clients {
        client.join().unwrap();
    }
    let control = daemon.stop().control;
    assert_eq!(
        (control.answered, control.rejected, control.timed_out),
        (100, 0, 0)
    );
}
