//! A daemon goes on from its checkpoint, whatever ended the one before; without a usable one it starts afresh.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod support;

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::PathBuf;
use std::time::Duration;

use residual_client::Control;
use residual_shared::alarm::AlarmTransition;
use residual_shared::record::{StepRecord, flags};
use residual_shared::sample::SampleHeader;
use residual_shared::transport::{self, Node, RecordSubscriber};
use residuald::assembly::assemble;
use residuald::configuration::Configuration;
use residuald::runtime::checkpoint::Checkpoint;
use residuald::runtime::engine::RecordSink;
use residuald::runtime::snapshot::parts;
use support::daemon::Daemon;
use support::scalar::{SYSTEMS, Sensor, at_rest, stage};
use support::{PERIOD_NS, Stage, wait_until};

fn checkpoint_file(stage: &Stage) -> PathBuf {
    stage.files.path().join("state")
}

fn with_checkpoint(period_s: Option<f64>) -> Stage {
    let mut stage = stage();
    let path = checkpoint_file(&stage).display().to_string();
    stage.set("daemon", "checkpoint_file", path);
    if let Some(period_s) = period_s {
        stage.set("daemon", "checkpoint_period_s", period_s);
    }
    stage
}

fn wait_for_log(daemon: &Daemon, text: &str) {
    wait_until(text, || daemon.messages().contains(text));
}

fn steps(stage: &Stage) -> u64 {
    stage.schedule_counters().steps
}

/// Receives the records of the first diagnoser, over one life of the daemon.
struct Recorder {
    subscriber: RecordSubscriber,
    _node: Node,
}

impl Recorder {
    fn open(stage: &Stage) -> Self {
        let node = transport::open_node(&stage.instance).unwrap();
        Self {
            subscriber: RecordSubscriber::open(&node, &stage.instance).unwrap(),
            _node: node,
        }
    }

    fn receive(&self, records: &mut Vec<StepRecord>) {
        self.subscriber.receive(|header, record| {
            if header.slot == 0 {
                records.push(*record);
            }
        });
    }
}

/// Keeps the latest record.
struct Latest(Option<StepRecord>);

impl RecordSink for Latest {
    fn publish(&mut self, slot: usize, record: &StepRecord) -> bool {
        if slot == 0 {
            self.0 = Some(*record);
        }
        true
    }

    fn alarm(&mut self, _: &AlarmTransition) {}
}

/// Fails unless one engine that never ended says the same as the records of two lives, of which the second one goes
/// on from the step `resumed`.
fn assert_as_uninterrupted(stage: &Stage, first: &[StepRecord], resumed: u64, second: &[StepRecord]) {
    let loaded = Configuration::from_text("reference", &stage.configuration.to_string()).unwrap();
    let mut configuration = loaded.configuration.clone();
    // It skips whatever it is late for.
    configuration.daemon.catch_up_limit = 0;
    let epoch_ns = stage.table().directory().spec.schedule_epoch_ns;
    let mut engine = assemble(&configuration, loaded.build_diagnosers().unwrap(), epoch_ns, 1.0);
    let margin_ns = configuration.diagnosers[0].margin_ns;
    let before = first.iter().filter(|record| record.step < resumed);
    for step in 0..first[0].step {
        engine.step_due(epoch_ns + step * PERIOD_NS + margin_ns, || 0, &mut Latest(None));
    }
    let mut compared = 0;
    for record in before.chain(second) {
        let instant_ns = epoch_ns + record.step * PERIOD_NS;
        assert_eq!(record.instant_ns, instant_ns);
        if record.inputs_valid != 0 {
            let header = SampleHeader {
                sequence: record.step,
                timestamp_ns: instant_ns,
            };
            engine.accept(0, 1, header, &[at_rest(record.step)], instant_ns);
        }
        let mut latest = Latest(None);
        engine.step_due(instant_ns + margin_ns, || 0, &mut latest);
        let scheduling = flags::OVERRUN | flags::LATE_SAMPLE;
        let plain = |record: &StepRecord| StepRecord {
            flags: record.flags & !scheduling,
            ..*record
        };
        let expected = latest.0.unwrap();
        assert!(
            plain(record).same_bits(&plain(&expected)),
            "{record:?}\n{expected:?}"
        );
        compared += usize::from(record.inputs_valid != 0);
    }
    assert!(compared > 40, "{compared}");
}

/// Lets a daemon run, ends it, starts another one; the second one goes on as one that never ended would. `end` gives
/// the step from which the second one has to go on.
fn assert_goes_on(stage: &Stage, end: impl FnOnce(Daemon) -> u64) {
    let daemon = Daemon::start(stage);
    let epoch_ns = stage.table().directory().spec.schedule_epoch_ns;
    let recorder = Recorder::open(stage);
    let sensor = Sensor::start(stage, at_rest);
    let (mut first, mut second) = (Vec::new(), Vec::new());
    wait_until("fifty steps", || {
        recorder.receive(&mut first);
        first.len() >= 50
    });
    let resumed = end(daemon);
    recorder.receive(&mut first);

    let daemon = Daemon::start(stage);
    assert_eq!(stage.table().directory().spec.schedule_epoch_ns, epoch_ns);
    wait_until("fifty steps more", || {
        recorder.receive(&mut second);
        second.len() >= 50
    });
    drop(sensor);
    wait_for_log(&daemon, "goes on from its checkpoint");
    for records in [&first, &second] {
        for pair in records.windows(2) {
            assert_eq!(pair[1].step, pair[0].step + 1, "steps without gaps");
        }
    }
    let skipped = stage.schedule_counters().skipped;
    assert!(skipped >= 1);
    assert_eq!(second[0].step, resumed + skipped);
    assert_eq!(u64::from(second[0].skipped_instants), skipped);
    assert_as_uninterrupted(stage, &first, resumed, &second);
    daemon.stop();
}

/// The step from which the checkpoint of a stage goes on.
fn next_step(stage: &Stage) -> u64 {
    let checkpoint = Checkpoint::read(&checkpoint_file(stage)).unwrap().unwrap();
    let parts = parts(&checkpoint.snapshot).unwrap();
    // It stands at the begin of a diagnoser's part.
    u64::from_le_bytes(parts[0][..8].try_into().unwrap())
}

#[test]
fn after_a_regular_stop_the_records_go_on_to_the_last_bit_and_the_gap_is_skipped() {
    let stage = with_checkpoint(None);
    assert_goes_on(&stage, |daemon| {
        daemon.stop();
        next_step(&stage)
    });
}

#[test]
fn after_a_kill_the_records_go_on_from_the_last_checkpoint_and_the_gap_is_skipped() {
    let stage = with_checkpoint(Some(0.5));
    assert_goes_on(&stage, |daemon| {
        let written = || fs::metadata(checkpoint_file(&stage)).ok()?.modified().ok();
        let before = written();
        wait_until("a checkpoint", || written() != before);
        // So that its records have been sent as well.
        std::thread::sleep(Duration::from_millis(50));
        daemon.kill();
        next_step(&stage)
    });
}

#[test]
fn counters_go_on_after_a_restart() {
    let stage = with_checkpoint(None);
    let daemon = Daemon::start(&stage);
    let sensor = Sensor::start(&stage, at_rest);
    wait_until("samples", || stage.input_counters(0).accepted > 20);
    daemon.stop();
    let (before, accepted) = (stage.schedule_counters(), stage.input_counters(0).accepted);
    let daemon = Daemon::start(&stage);
    wait_until("samples", || stage.input_counters(0).accepted > accepted);
    assert!(stage.schedule_counters().steps >= before.steps);
    let log = daemon.messages();
    assert!(!log.contains("counter=\"input_missing\""), "{log}");
    drop(sensor);
    daemon.stop();
}

/// Starts a daemon on a checkpoint that is of no use; gives its log.
fn starts_afresh(stage: &Stage) -> String {
    let daemon = Daemon::start(stage);
    wait_until("a step", || steps(stage) > 3);
    let log = daemon.messages();
    assert_eq!(stage.schedule_counters().skipped, 0, "{log}");
    assert!(!log.contains("goes on from its checkpoint"), "{log}");
    daemon.stop();
    log
}

#[test]
fn a_checkpoint_that_is_of_no_use_is_named_and_replaced_at_the_stop() {
    let stage = with_checkpoint(None);
    let path = checkpoint_file(&stage);
    Daemon::start(&stage).stop();
    let good = fs::read(&path).unwrap();
    let mut flipped = good.clone();
    flipped[good.len() / 2] ^= 1;
    let foreign = b"instance = \"another\"".to_vec();
    let half = good[..good.len() / 2].to_vec();
    for (bytes, reason) in [
        (Vec::new(), "is not a checkpoint"),
        (foreign, "is not a checkpoint"),
        (half, "is damaged"),
        (flipped, "is damaged"),
    ] {
        fs::write(&path, bytes).unwrap();
        let log = starts_afresh(&stage);
        assert!(log.contains(reason), "{reason}: {log}");
        assert!(log.contains(&path.display().to_string()), "{log}");
        Checkpoint::read(&path).unwrap().unwrap();
    }
}

#[test]
fn a_checkpoint_of_another_instance_or_boot_is_not_gone_on_from() {
    let stage = with_checkpoint(None);
    let path = checkpoint_file(&stage);
    Daemon::start(&stage).stop();
    let good = Checkpoint::read(&path).unwrap().unwrap();
    let instance = Checkpoint {
        instance: "another".into(),
        ..good.clone()
    };
    let boot = Checkpoint {
        boot_id: good.boot_id ^ 1,
        ..good.clone()
    };
    let future = Checkpoint {
        epoch_ns: u64::MAX / 2,
        ..good.clone()
    };
    let parts = Checkpoint {
        snapshot: good.snapshot[..good.snapshot.len() - 1].to_vec(),
        ..good
    };
    for (checkpoint, reason) in [
        (instance, "of the instance `another`"),
        (boot, "the machine was started since"),
        (future, "its clock is ahead"),
        (parts, "are damaged"),
    ] {
        checkpoint.write(&path).unwrap();
        let log = starts_afresh(&stage);
        assert!(log.contains(reason), "{reason}: {log}");
    }
}

#[test]
fn only_a_diagnoser_whose_configuration_changed_begins_afresh() {
    let mut stage = with_checkpoint(None);
    let daemon = Daemon::start(&stage);
    wait_until("steps", || steps(&stage) > 20);
    daemon.stop();
    let before = stage.table().read_schedule_counters(1).unwrap().steps;
    stage.set_diagnoser("priority", 3);
    let daemon = Daemon::start(&stage);
    let (first, second) = (SYSTEMS[0], SYSTEMS[1]);
    wait_for_log(&daemon, "states taken from the checkpoint");
    let log = daemon.messages();
    assert!(
        log.contains("it has another configuration or other gains now"),
        "{log}"
    );
    assert!(
        log.contains(&format!("goes on from its checkpoint diagnoser=\"{second}\"")),
        "{log}"
    );
    assert!(
        !log.contains(&format!("goes on from its checkpoint diagnoser=\"{first}\"")),
        "{log}"
    );
    let table = stage.table();
    // The counters come with the first turn.
    wait_until("the steps of both lives", || {
        table.read_schedule_counters(1).unwrap().steps > before
    });
    assert_eq!(table.read_schedule_counters(0).unwrap().skipped, 0);
    daemon.stop();
}

#[test]
fn an_alarm_outlasts_another_boot_in_the_checkpoint() {
    let stage = with_checkpoint(None);
    let path = checkpoint_file(&stage);
    let daemon = Daemon::start(&stage);
    let sensor = Sensor::start(&stage, |k| if k % 100 < 50 { 100.0 } else { -100.0 });
    let alarm = |stage: &Stage| stage.table().read_alarm_status(0).unwrap();
    wait_until("an alarm", || alarm(&stage).state >= 2);
    daemon.stop();
    drop(sensor);
    let before = alarm(&stage);
    let checkpoint = Checkpoint::read(&path).unwrap().unwrap();
    let other_boot = Checkpoint {
        boot_id: checkpoint.boot_id ^ 1,
        ..checkpoint
    };
    other_boot.write(&path).unwrap();
    // A boot takes the table away.
    fs::remove_file(stage.instance.bounds_path()).unwrap();
    let daemon = Daemon::start(&stage);
    let after = alarm(&stage);
    assert_eq!(
        (after.state, after.occurrences),
        (before.state, before.occurrences)
    );
    daemon.stop();
}

#[test]
fn a_client_has_a_checkpoint_made_for_the_owners_eyes_only() {
    let stage = with_checkpoint(None);
    let daemon = Daemon::start(&stage);
    let control = Control::connect(&stage.instance).unwrap();
    let outcome = control.checkpoint().unwrap();
    assert_eq!(outcome.diagnosers, 3);
    let metadata = fs::metadata(checkpoint_file(&stage)).unwrap();
    assert_eq!(metadata.len(), outcome.bytes);
    assert_eq!(metadata.permissions().mode() & 0o777, 0o600);
    daemon.kill();
    let daemon = Daemon::start(&stage);
    wait_for_log(&daemon, "goes on from its checkpoint");
    daemon.stop();
}

#[test]
fn without_a_configured_file_a_checkpoint_is_refused_with_the_key_to_set() {
    let stage = stage();
    let daemon = Daemon::start(&stage);
    let refused = Control::connect(&stage.instance)
        .unwrap()
        .checkpoint()
        .unwrap_err();
    assert!(refused.to_string().contains("`checkpoint_file`"), "{refused}");
    daemon.stop();
    assert!(!checkpoint_file(&stage).exists());
}
