//! A monitor over the lives of a daemon, played by a table writer.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::thread::sleep;
use std::time::Duration;

use residual_client::{
    DaemonState, DaemonTime, Freshness, Instance, Monitor, MonitorError, OpenError, RETRY_PERIOD_NS,
    SlotSpec, StepRecord, TableSpec, Verdict, monotonic_ns,
};
use residual_shared::bounds_table::{Access, HUNG_AFTER_NS, TableWriter};
use tempfile::TempDir;

const OWN: Access = Access {
    group: None,
    mode: 0o600,
};
const PERIOD_NS: u64 = 20_000_000_000;

fn slot(name: &str) -> SlotSpec {
    SlotSpec {
        name: name.into(),
        method: "chi_square".into(),
        period_ns: PERIOD_NS,
        phase_ns: 0,
        margin_ns: 1_000_000_000,
        channels: vec![],
        faults: vec![],
    }
}

/// A directory and an instance in it.
fn instance() -> (TempDir, Instance) {
    let directory = tempfile::Builder::new()
        .prefix("residuald-test-")
        .tempdir_in("/dev/shm")
        .unwrap();
    let instance = Instance::new("test".parse().unwrap(), directory.path());
    (directory, instance)
}

/// A new life of the daemon with these diagnosers.
fn daemon(instance: &Instance, names: &[&str]) -> TableWriter {
    let spec = TableSpec {
        instance: "test".into(),
        slots: names.iter().map(|name| slot(name)).collect(),
        inputs: vec![],
        time: DaemonTime::MONOTONIC,
        schedule_epoch_ns: 0,
        stale_after_periods: 2,
        alarm_capacity: 64,
    };
    let writer = TableWriter::create(&instance.bounds_path(), &spec, &OWN).unwrap();
    // A sign of life from the future: the daemon counts as alive however slow the machine is.
    writer.heartbeat(monotonic_ns() + 3_600_000_000_000);
    writer
}

fn record(step: u64, verdict: Verdict, instant_ns: u64) -> StepRecord {
    let mut record = StepRecord::new(0);
    record.step = step;
    record.instant_ns = instant_ns;
    record.verdict = verdict as u32;
    record
}

fn pass_retry_period() {
    sleep(Duration::from_nanos(RETRY_PERIOD_NS + 1_000_000));
}

#[test]
fn without_a_daemon_open_fails_and_connect_waits_for_one() {
    let (_directory, instance) = instance();
    assert!(matches!(
        Monitor::open(&instance),
        Err(OpenError::NotFound { .. })
    ));
    let mut monitor = Monitor::connect(&instance);
    let mut back = StepRecord::new(0);
    let followed = monitor.follow("b").unwrap();
    let reading = monitor.read_followed(followed, &mut back).unwrap();
    assert_eq!((reading.freshness, reading.number), (Freshness::Dead, 0));
    assert!(matches!(
        monitor.state(),
        DaemonState::Unreachable(OpenError::NotFound { .. })
    ));

    let mut daemon = daemon(&instance, &["a", "b"]);
    daemon.publish(1, &record(7, Verdict::Nominal, monotonic_ns()));
    pass_retry_period();
    let reading = monitor.read_followed(followed, &mut back).unwrap();
    assert_eq!(
        (reading.freshness, reading.number, back.step),
        (Freshness::Fresh, 1, 7)
    );
    assert!(matches!(monitor.state(), DaemonState::Running));
}

#[test]
fn a_record_is_fresh_until_its_periods_and_margin_are_over() {
    let (_directory, instance) = instance();
    let mut daemon = daemon(&instance, &["a"]);
    let mut monitor = Monitor::open(&instance).unwrap();
    let mut back = StepRecord::new(0);
    let mut freshness_at_age = |age_ns: u64, verdict| {
        // CLOCK_MONOTONIC begins at boot and may be smaller than the age that is tried.
        let now = monotonic_ns();
        let instant_ns = now.checked_sub(age_ns)?;
        daemon.publish(0, &record(1, verdict, instant_ns));
        Some(monitor.read("a", &mut back).unwrap().freshness)
    };
    assert_eq!(freshness_at_age(0, Verdict::Nominal), Some(Freshness::Fresh));
    assert_eq!(
        freshness_at_age(0, Verdict::GuaranteeLost),
        Some(Freshness::Fresh)
    );
    assert_eq!(freshness_at_age(0, Verdict::Starting), Some(Freshness::Starting));
    assert_eq!(
        freshness_at_age(0, Verdict::NotEvaluated),
        Some(Freshness::NotEvaluated)
    );
    // Two periods and the margin are 41 s.
    if let Some(freshness) = freshness_at_age(40_000_000_000, Verdict::Nominal) {
        assert_eq!(freshness, Freshness::Fresh);
    }
    for verdict in [Verdict::Nominal, Verdict::Starting, Verdict::NotEvaluated] {
        if let Some(freshness) = freshness_at_age(41_000_000_001, verdict) {
            assert!(matches!(freshness, Freshness::Stale { age } if age.as_secs() == 41));
        }
    }
}

#[test]
fn age_is_measured_in_the_daemons_time() {
    let (_directory, instance) = instance();
    let origin_ns = monotonic_ns();
    let spec = TableSpec {
        instance: "test".into(),
        slots: vec![SlotSpec {
            period_ns: 1_000_000_000,
            margin_ns: 0,
            ..slot("a")
        }],
        inputs: vec![],
        time: DaemonTime {
            origin_ns,
            speed: 1_000.0,
        },
        schedule_epoch_ns: 0,
        stale_after_periods: 2,
        alarm_capacity: 64,
    };
    let mut daemon = TableWriter::create(&instance.bounds_path(), &spec, &OWN).unwrap();
    daemon.publish(0, &record(1, Verdict::Nominal, origin_ns));
    // 20 ms are 20 s of a time that runs a thousand times as fast.
    sleep(Duration::from_millis(20));
    let mut back = StepRecord::new(0);
    let reading = Monitor::open(&instance).unwrap().read("a", &mut back).unwrap();
    assert!(matches!(reading.freshness, Freshness::Stale { age } if age.as_secs() >= 20));
}

#[test]
fn a_diagnoser_that_has_written_nothing_is_starting() {
    let (_directory, instance) = instance();
    let _daemon = daemon(&instance, &["a"]);
    let mut back = record(9, Verdict::Fault, 1);
    let reading = Monitor::open(&instance).unwrap().read("a", &mut back).unwrap();
    assert_eq!((reading.freshness, reading.number), (Freshness::Starting, 0));
    assert!(back.same_bits(&record(9, Verdict::Fault, 1)));
}

#[test]
fn handles_survive_a_restart_that_reorders_and_vanish_with_their_diagnoser() {
    let (_directory, instance) = instance();
    let mut first = daemon(&instance, &["a", "b"]);
    first.publish(0, &record(1, Verdict::Nominal, monotonic_ns()));
    first.publish(1, &record(2, Verdict::Nominal, monotonic_ns()));
    let mut monitor = Monitor::open(&instance).unwrap();
    let (a, b) = (monitor.follow("a").unwrap(), monitor.follow("b").unwrap());
    let mut back = StepRecord::new(0);
    let before = monitor.read_followed(b, &mut back).unwrap();
    assert_eq!(back.step, 2);
    // Killed: the old table stays "running" until the next daemon marks it.
    std::mem::forget(first);

    let mut second = daemon(&instance, &["b", "c"]);
    second.publish(0, &record(3, Verdict::Nominal, monotonic_ns()));
    let after = monitor.read_followed(b, &mut back).unwrap();
    assert_eq!((after.freshness, back.step), (Freshness::Fresh, 3));
    assert!(after.epoch > before.epoch);
    let gone = monitor.read_followed(a, &mut back).unwrap_err();
    assert!(matches!(&gone, MonitorError::NoSuchDiagnoser { name, .. } if name == "a"));
    assert!(gone.to_string().contains("`b`, `c`"), "{gone}");
    assert!(matches!(
        monitor.follow("a"),
        Err(MonitorError::NoSuchDiagnoser { .. })
    ));

    drop(second);
    let _third = daemon(&instance, &["a"]);
    pass_retry_period();
    assert_eq!(
        monitor.read_followed(a, &mut back).unwrap().freshness,
        Freshness::Starting
    );
}

#[test]
fn a_closed_daemon_is_dead_with_its_last_record_readable() {
    let (_directory, instance) = instance();
    let mut daemon = daemon(&instance, &["a"]);
    daemon.publish(0, &record(4, Verdict::Isolated, monotonic_ns()));
    let mut monitor = Monitor::open(&instance).unwrap();
    drop(daemon);
    let mut back = StepRecord::new(0);
    let reading = monitor.read("a", &mut back).unwrap();
    assert_eq!(
        (reading.freshness, reading.number, back.step),
        (Freshness::Dead, 1, 4)
    );
    assert!(matches!(monitor.state(), DaemonState::Closed));
}

#[test]
fn a_hung_daemon_is_dead_until_it_goes_on() {
    let (_directory, instance) = instance();
    let mut daemon = daemon(&instance, &["a"]);
    daemon.publish(0, &record(4, Verdict::Nominal, monotonic_ns()));
    let mut monitor = Monitor::open(&instance).unwrap();
    daemon.heartbeat(monotonic_ns());
    sleep(Duration::from_nanos(HUNG_AFTER_NS + 10_000_000));
    let mut back = StepRecord::new(0);
    assert_eq!(monitor.read("a", &mut back).unwrap().freshness, Freshness::Dead);
    assert!(matches!(monitor.state(), DaemonState::Hung(age) if age.as_millis() >= 500));
    daemon.heartbeat(monotonic_ns() + 3_600_000_000_000);
    assert_eq!(monitor.read("a", &mut back).unwrap().freshness, Freshness::Fresh);
}

#[test]
fn a_table_removed_under_a_hung_daemon_is_replaced_by_the_next_one() {
    let (_directory, instance) = instance();
    let first = daemon(&instance, &["a"]);
    first.heartbeat(0);
    let mut monitor = Monitor::open(&instance).unwrap();
    std::fs::remove_file(instance.bounds_path()).unwrap();
    let mut back = StepRecord::new(0);
    assert_eq!(monitor.read("a", &mut back).unwrap().freshness, Freshness::Dead);
    let _second = daemon(&instance, &["a"]);
    pass_retry_period();
    assert_eq!(
        monitor.read("a", &mut back).unwrap().freshness,
        Freshness::Starting
    );
}

#[test]
fn a_handle_of_another_monitor_is_refused_where_it_cannot_be_meant() {
    let (_directory, instance) = instance();
    let _daemon = daemon(&instance, &["a"]);
    let handle = Monitor::open(&instance).unwrap().follow("a").unwrap();
    let mut other = Monitor::open(&instance).unwrap();
    let outcome = other.read_followed(handle, &mut StepRecord::new(0));
    assert_eq!(outcome, Err(MonitorError::ForeignHandle));
}
