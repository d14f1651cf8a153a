//! The bounds table against the system's permissions and a full file system.
//!
//! Needs root, to act as other users and to mount a tmpfs; otherwise the tests say that they were skipped.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use std::fs::{self, OpenOptions, Permissions};
use std::io::ErrorKind;
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::path::Path;
use std::process::Command;
use std::thread;

use common::{OWN, directory, slot, spec};
use nix::sched::{CloneFlags, unshare};
use nix::unistd::{Gid, Uid, setfsgid, setfsuid};
use residual_shared::bounds_table::{
    Access, CreateError, Liveness, OpenError, ReadOutcome, TableReader, TableWriter,
};
use residual_shared::clock::monotonic_ns;
use residual_shared::record::{MAX_CHANNELS, StepRecord};

/// Ids that no account needs to have.
const GROUP: u32 = 61_001;
const USER: u32 = 61_002;
const OTHER_GROUP: u32 = 61_003;

fn is_root() -> bool {
    let root = Uid::effective().is_root();
    if !root {
        eprintln!("SKIPPED: only root can act as other users and mount file systems");
    }
    root
}

/// Runs `action` in a thread that the file system takes for this user and group.
fn as_user<T: Send>(user: u32, group: u32, action: impl FnOnce() -> T + Send) -> T {
    thread::scope(|scope| {
        let thread = scope.spawn(|| {
            setfsgid(Gid::from_raw(group));
            setfsuid(Uid::from_raw(user));
            action()
        });
        thread.join().unwrap()
    })
}

fn open_to(directory: &Path, mode: u32) {
    fs::set_permissions(directory, Permissions::from_mode(mode)).unwrap();
}

#[test]
fn a_member_of_the_group_reads_and_cannot_write_and_a_stranger_is_told_which_group() {
    if !is_root() {
        return;
    }
    let directory = directory();
    open_to(directory.path(), 0o755);
    let path = directory.path().join("bounds");
    let access = Access {
        group: Some(GROUP),
        mode: 0o640,
    };
    let mut writer = TableWriter::create(&path, &spec(vec![slot("a", 1)]), &access).unwrap();
    writer.publish(0, &StepRecord::new(1));
    assert_eq!(fs::metadata(&path).unwrap().gid(), GROUP);

    as_user(USER, GROUP, || {
        let reader = TableReader::open(&path).unwrap();
        let mut record = StepRecord::new(0);
        assert_eq!(reader.read(0, &mut record), Ok(ReadOutcome::Record { number: 1 }));
        let write = OpenOptions::new().write(true).open(&path);
        assert_eq!(write.unwrap_err().kind(), ErrorKind::PermissionDenied);
    });
    as_user(USER, OTHER_GROUP, || {
        let error = TableReader::open(&path).unwrap_err();
        assert!(matches!(error, OpenError::PermissionDenied { .. }), "{error:?}");
        let message = error.to_string();
        assert!(
            message.contains("group") && message.contains("gid 61001"),
            "{message}"
        );
    });
}

#[test]
fn a_stranger_of_a_private_table_is_told_that_no_group_was_configured() {
    if !is_root() {
        return;
    }
    let directory = directory();
    open_to(directory.path(), 0o755);
    let path = directory.path().join("bounds");
    let _writer = TableWriter::create(&path, &spec(vec![]), &OWN).unwrap();
    let error = as_user(USER, GROUP, || TableReader::open(&path).unwrap_err().to_string());
    assert!(error.contains("user `root` only"), "{error}");
    open_to(directory.path(), 0o700);
    let error = as_user(USER, GROUP, || TableReader::open(&path).unwrap_err().to_string());
    assert!(error.contains("directory"), "{error}");
}

#[test]
fn a_daemon_outside_the_group_is_told_so_and_leaves_nothing() {
    if !is_root() {
        return;
    }
    let directory = directory();
    open_to(directory.path(), 0o777);
    let path = directory.path().join("bounds");
    as_user(USER, OTHER_GROUP, || {
        let access = Access {
            group: Some(GROUP),
            mode: 0o640,
        };
        let error = TableWriter::create(&path, &spec(vec![]), &access).unwrap_err();
        assert!(
            matches!(error, CreateError::Group { group: GROUP, .. }),
            "{error:?}"
        );
    });
    assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 0);
}

#[test]
fn a_table_of_another_user_is_neither_marked_nor_replaced_in_a_sticky_directory() {
    if !is_root() {
        return;
    }
    let directory = directory();
    open_to(directory.path(), 0o1777);
    let path = directory.path().join("bounds");
    let _writer = TableWriter::create(&path, &spec(vec![]), &OWN).unwrap();
    let reader = TableReader::open(&path).unwrap();
    as_user(USER, GROUP, || {
        let error = TableWriter::create(&path, &spec(vec![]), &OWN).unwrap_err();
        assert!(matches!(error, CreateError::Io { .. }), "{error:?}");
    });
    assert_eq!(reader.liveness(monotonic_ns()), Liveness::Running);
    assert!(!reader.is_replaced());
    assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 1);
}

#[test]
fn a_full_file_system_is_an_error_that_says_so_and_leaves_the_old_table_alone() {
    if !is_root() {
        return;
    }
    let directory = directory();
    thread::scope(|scope| {
        scope.spawn(|| in_small_file_system(directory.path(), full_file_system));
    });
}

/// Runs `action` with a tmpfs of 64 KiB at `directory`, which only this thread sees and which ends with it.
fn in_small_file_system(directory: &Path, action: fn(&Path)) {
    let mount = |arguments: &[&str]| {
        let status = Command::new("mount").args(arguments).arg(directory).status();
        status.is_ok_and(|status| status.success())
    };
    let private = unshare(CloneFlags::CLONE_NEWNS).is_ok()
        && Command::new("mount")
            .args(["--make-rprivate", "/"])
            .status()
            .is_ok_and(|s| s.success());
    if !private || !mount(&["-t", "tmpfs", "-o", "size=64k", "tmpfs"]) {
        eprintln!("SKIPPED: a tmpfs cannot be mounted here");
        return;
    }
    action(directory);
}

fn full_file_system(directory: &Path) {
    let path = directory.join("bounds");
    let _small = TableWriter::create(&path, &spec(vec![slot("a", 1)]), &OWN).unwrap();
    let reader = TableReader::open(&path).unwrap();
    let slots = (0..100)
        .map(|index| slot(&format!("d{index}"), MAX_CHANNELS))
        .collect();
    let error = TableWriter::create(&path, &spec(slots), &OWN).unwrap_err();
    assert!(matches!(error, CreateError::NoSpace { .. }), "{error:?}");
    assert!(error.to_string().contains("no room"), "{error}");
    assert_eq!(
        fs::read_dir(directory).unwrap().count(),
        1,
        "the temporary file was left behind"
    );
    assert_eq!(reader.liveness(monotonic_ns()), Liveness::Running);
    assert!(!reader.is_replaced());
}
