//! The daemon and what lies, or does not lie, where its files should be.

use std::fs::{self, Permissions};
use std::os::unix::fs::PermissionsExt;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::Command;

use crate::support::daemon::{Daemon, Finished, finish, program};
use crate::support::{DIAGNOSER, Stage, is_root, wait_until};
use residual_client::{DaemonState, Freshness, Monitor, OpenError, StepRecord};

/// A user and a group that no account needs to have.
const STRANGER: u32 = 61_002;

#[test]
fn a_foreign_file_in_the_place_of_the_table_is_replaced_and_clients_find_the_table() {
    let stage = Stage::new();
    let path = stage.instance.bounds_path();
    fs::write(&path, "not a table\n".repeat(1000)).unwrap();
    let mut monitor = Monitor::connect(&stage.instance);
    let mut record = StepRecord::new(0);
    assert_eq!(
        monitor.read(DIAGNOSER, &mut record).unwrap().freshness,
        Freshness::Dead
    );
    assert!(matches!(
        monitor.state(),
        DaemonState::Unreachable(OpenError::NotATable { .. })
    ));
    let daemon = Daemon::start(&stage);
    wait_until("the table", || matches!(monitor.state(), DaemonState::Running));
    daemon.stop();
    stage.assert_only_table_and_lock_are_left();
}

#[test]
fn a_damaged_table_is_refused_by_clients_and_replaced_by_the_next_daemon() {
    let stage = Stage::new();
    Daemon::start(&stage).stop();
    let path = stage.instance.bounds_path();
    let mut bytes = fs::read(&path).unwrap();
    for byte in &mut bytes[200..400] {
        *byte ^= 0x5a;
    }
    fs::write(&path, &bytes).unwrap();
    let error = Monitor::open(&stage.instance).unwrap_err();
    assert!(error.to_string().contains("damaged"), "{error}");
    let mut monitor = Monitor::connect(&stage.instance);
    assert!(matches!(
        monitor.state(),
        DaemonState::Unreachable(OpenError::Damaged { .. })
    ));
    let daemon = Daemon::start(&stage);
    wait_until("the table", || matches!(monitor.state(), DaemonState::Running));
    daemon.stop();
}

#[test]
fn a_directory_in_the_place_of_the_table_is_a_clear_error_that_leaves_nothing() {
    let stage = Stage::new();
    fs::create_dir(stage.instance.bounds_path()).unwrap();
    let run = finish(program().arg("run").arg(stage.configuration_file()));
    assert_eq!(run.code, Some(1), "{}", run.messages);
    assert!(
        run.messages.contains("cannot move the new bounds table to"),
        "{}",
        run.messages
    );
    stage.assert_only_table_and_lock_are_left();
}

#[test]
fn a_missing_runtime_directory_is_named() {
    let mut stage = Stage::new();
    stage.set("daemon", "runtime_directory", "/dev/shm/there-is-no-such");
    let run = finish(program().arg("run").arg(stage.configuration_file()));
    assert_eq!(run.code, Some(1));
    assert!(
        run.messages.contains("/dev/shm/there-is-no-such") && run.messages.contains("does not exist"),
        "{}",
        run.messages
    );
}

#[test]
fn a_runtime_directory_that_may_not_be_written_is_named() {
    let stage = Stage::new();
    let configuration = stage.configuration_file();
    fs::set_permissions(stage.files.path(), Permissions::from_mode(0o755)).unwrap();
    fs::set_permissions(stage.directory.path(), Permissions::from_mode(0o555)).unwrap();
    let mut command = program();
    command.arg("run").arg(configuration);
    if is_root() {
        command.uid(STRANGER).gid(STRANGER);
    }
    let run = finish(&mut command);
    assert_eq!(run.code, Some(1), "{}", run.messages);
    let directory = stage.directory.path().display().to_string();
    assert!(
        run.messages.contains(&directory) && run.messages.contains("Permission denied"),
        "{}",
        run.messages
    );
    assert_eq!(stage.runtime_files(), Vec::<String>::new());
}

/// Runs a daemon that sees a tmpfs of so many KiB at `place`, which nobody else sees; gives what it said.
///
/// A daemon that still runs after `limit_s` ends with the code 124.
fn with_little_room(stage: &Stage, place: &Path, kibibytes: u32, limit_s: u32) -> Finished {
    let script = "mount -t tmpfs -o size=$0k,mode=755 tmpfs $1 && mkdir -p $2 && exec timeout $5 $3 run $4";
    let mut command = Command::new("unshare");
    command.args(["--mount", "sh", "-c", script]);
    command
        .arg(kibibytes.to_string())
        .arg(place)
        .arg(stage.directory.path());
    command
        .arg(env!("CARGO_BIN_EXE_residuald"))
        .arg(stage.configuration_file())
        .arg(limit_s.to_string());
    finish(&mut command)
}

#[test]
fn a_full_file_system_is_a_clear_error_and_no_crash() {
    if !is_root() {
        return;
    }
    let stage = Stage::new();
    let (shared_memory, own) = (Path::new("/dev/shm"), stage.directory.path());
    if with_little_room(&stage, own, 4096, 2).code != Some(124) {
        eprintln!("SKIPPED: a tmpfs cannot be mounted here");
        return;
    }
    // Too little for iceoryx2's management, for its data, and for both.
    for (place, kibibytes) in [
        (own, 4),
        (own, 64),
        (shared_memory, 4),
        (shared_memory, 64),
        (shared_memory, 512),
        (shared_memory, 8192),
    ] {
        let run = with_little_room(&stage, place, kibibytes, 20);
        let place = place.display();
        assert_eq!(
            run.code,
            Some(1),
            "{place} with {kibibytes} KiB: {}",
            run.messages
        );
        assert!(
            run.messages.contains("has no room for"),
            "{place} with {kibibytes} KiB: {}",
            run.messages
        );
    }
    assert_eq!(stage.runtime_files(), Vec::<String>::new());
}

#[test]
fn a_table_too_large_for_its_file_system_is_a_clear_error_and_leaves_nothing() {
    if !is_root() {
        return;
    }
    let mut stage = Stage::new();
    let first = stage.diagnosers()[0].clone();
    for number in 0..150 {
        let mut other = first.clone();
        other
            .as_table_mut()
            .unwrap()
            .insert("name".into(), format!("d{number}").into());
        stage.diagnosers().push(other);
    }
    let run = with_little_room(&stage, stage.directory.path(), 300, 60);
    if run.messages.contains("mount") && run.code != Some(1) {
        eprintln!("SKIPPED: a tmpfs cannot be mounted here");
        return;
    }
    assert_eq!(run.code, Some(1), "{}", run.messages);
    assert!(
        run.messages.contains("bytes of the bounds table"),
        "{}",
        run.messages
    );
    assert_eq!(stage.shared_memory_files(), Vec::<std::path::PathBuf>::new());
}
