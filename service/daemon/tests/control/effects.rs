//! What each request brings about.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

use residual_client::{
    AlarmNumber, AlarmState, ControlCounters, ControlError, Instance, RequestError, StepRecords, Verdict,
    flags,
};
use residual_shared::clock::{monotonic_ns, sleep_until_monotonic};
use toml::Value;

use super::support::daemon::Daemon;
use super::support::helper::Helper;
use super::support::publisher::{Drivers, at_rest};
use super::support::{DIAGNOSER, INPUTS, PERIOD_NS, Stage, wait_until};
use super::{control, record};

/// The aircraft twice: the second diagnoser is called `second`.
fn two_diagnosers() -> Stage {
    let mut stage = Stage::new();
    let mut second = stage.diagnosers()[0].clone();
    second
        .as_table_mut()
        .unwrap()
        .insert("name".into(), Value::from("second"));
    stage.diagnosers().push(second);
    stage
}

#[test]
fn list_and_describe_tell_what_is_configured_designed_and_counted() {
    let stage = two_diagnosers();
    let daemon = Daemon::start(&stage);
    wait_until("20 steps", || stage.schedule_counters().steps >= 20);
    let control = control(&stage);
    let listing = control.list().unwrap();
    assert_eq!(listing.instance, stage.instance.name.to_string());
    assert_eq!((listing.pid, listing.total, listing.first), (daemon.pid(), 2, 0));
    assert_eq!(listing.epoch, stage.table().directory().epoch);
    assert_eq!(listing.log, "info");
    let names: Vec<_> = listing
        .diagnosers
        .iter()
        .map(|entry| entry.name.as_str())
        .collect();
    assert_eq!(names, [DIAGNOSER, "second"]);
    assert!(
        listing.diagnosers.iter().all(|entry| entry.steps >= 19),
        "{listing:?}"
    );

    let described = control.describe("second").unwrap();
    let table = stage.table();
    let spec = &table.directory().spec;
    assert_eq!(
        (described.slot, described.method.as_str()),
        (1, "unknown_input_filter")
    );
    assert_eq!(
        (described.period_ns, described.margin_ns),
        (PERIOD_NS, spec.slots[1].margin_ns)
    );
    assert_eq!(described.faults, spec.slots[1].faults);
    let channels = described.channels.iter().map(|channel| &channel.name);
    assert!(channels.eq(spec.slots[1].channels.iter().map(|channel| &channel.name)));
    assert_eq!(described.measurements.len(), 4);
    assert!(
        described.measurements[0].starts_with(&format!("{}.", INPUTS[0])),
        "{described:?}"
    );
    assert_eq!(described.gains, "found at the start");
    let certified = |name| described.certificate.iter().any(|(key, _)| key == name);
    assert!(
        certified("conditions") && certified("false alarms"),
        "{:?}",
        described.certificate
    );
    let counter = |name| {
        described
            .counters
            .iter()
            .find(|counter| counter.name == name)
            .unwrap()
    };
    assert!(counter("steps").value >= 19 && counter("input_missing").value >= 19);

    let refused = control.describe("third").unwrap_err().to_string();
    assert!(
        refused.contains("`third`") && refused.contains(&format!("`{DIAGNOSER}`, `second`")),
        "{refused}"
    );
    let expected = ControlCounters {
        answered: 4,
        ..ControlCounters::default()
    };
    let counted = control.list().unwrap().requests;
    // List, describe, describe: each answered before the next was asked.
    assert_eq!(counted.answered + 1, expected.answered, "{counted:?}");
    // A client that is still there keeps iceoryx2's files.
    drop(control);
    assert_eq!(daemon.stop().control, expected);
    stage.assert_only_table_and_lock_are_left();
}

#[test]
fn a_reset_shows_in_the_next_record_of_its_diagnoser_alone_and_its_time_begins_anew() {
    let stage = two_diagnosers();
    let daemon = Daemon::start(&stage);
    let publisher = Helper::start(&stage, "publisher_process");
    let mut records = StepRecords::open(&stage.instance).unwrap();
    record(&mut records, "a nominal record", |record| {
        record.verdict() == Verdict::Nominal
    });
    let control = control(&stage);
    control.reset("second").unwrap();
    let answered_at = stage.table().read_schedule_counters(1).unwrap().steps;
    let mut seen = Vec::new();
    wait_until("a record with the flag RESET and a nominal one after it", || {
        records.receive(|header, record| {
            if record.flags & flags::RESET != 0 || !seen.is_empty() {
                seen.push((
                    header.slot,
                    record.step,
                    record.flags & flags::RESET != 0,
                    record.verdict(),
                ));
            }
        });
        seen.iter()
            .any(|(slot, _, reset, verdict)| *slot == 1 && !reset && *verdict == Verdict::Nominal)
    });
    let resets: Vec<_> = seen.iter().filter(|(.., reset, _)| *reset).collect();
    assert_eq!(resets.len(), 1, "{seen:?}");
    assert_eq!(resets[0].0, 1, "the slot of `second`");
    assert!(
        resets[0].1 <= answered_at + 1,
        "step {}, answered at {answered_at}",
        resets[0].1
    );

    assert_eq!(control.reset_all().unwrap(), 2);
    let mut slots = Vec::new();
    wait_until("both resets", || {
        records.receive(|header, record| {
            if record.flags & flags::RESET != 0 {
                slots.push(header.slot);
            }
        });
        slots.len() >= 2
    });
    slots.sort_unstable();
    assert_eq!(slots, [0, 1]);
    publisher.finish();
    let summary = daemon.stop();
    assert_eq!(summary.schedule_total("skipped"), 0);
}

#[test]
fn the_log_shows_what_the_new_filter_lets_through_and_a_wrong_filter_changes_nothing() {
    let mut stage = Stage::new();
    stage.set("daemon", "log", "error");
    let daemon = Daemon::start(&stage);
    let control = control(&stage);
    control.reset(DIAGNOSER).unwrap();
    assert!(!daemon.messages().contains("INFO"), "{}", daemon.messages());
    let level = control.set_log_level("info").unwrap();
    assert_eq!((level.before.as_str(), level.now.as_str()), ("error", "info"));
    control.reset(DIAGNOSER).unwrap();
    wait_until("a line of the log", || {
        daemon.messages().contains("Reset { diagnosers: 1 }")
    });

    for wrong in ["residuald=loud", "", " ", "a[b{c", "info,residuald=debug=trace"] {
        let error = control.set_log_level(wrong).unwrap_err();
        let refused = matches!(error, RequestError::Refused(ControlError::LogFilter { .. }));
        assert!(
            refused && error.to_string().contains("; write for example"),
            "{wrong}: {error}"
        );
        assert_eq!(control.list().unwrap().log, "info", "{wrong}");
    }
    control.set_log_level("warn").unwrap();
    control.reset(DIAGNOSER).unwrap();
    control.set_log_level("info").unwrap();
    // The log is written in order: with this line there, one of the reset before it would be there, too.
    wait_until("the last change of the filter", || {
        daemon.messages().contains(r#"before: "warn""#)
    });
    let resets = daemon.messages().matches("Reset { diagnosers: 1 }").count();
    assert_eq!(resets, 1, "{}", daemon.messages());
    daemon.stop();
}

/// A thread that publishes the aircraft at rest at 100 Hz. Its first actuator is stuck while it is told so.
struct Vehicle {
    stuck: Arc<AtomicBool>,
    end: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Vehicle {
    fn start(instance: &Instance) -> Self {
        let (stuck, end) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicBool::new(false)));
        let (is_stuck, told, instance) = (Arc::clone(&stuck), Arc::clone(&end), instance.clone());
        let thread = std::thread::spawn(move || {
            let mut drivers = Drivers::open(&instance);
            let start_ns = monotonic_ns();
            for k in 0.. {
                if told.load(Ordering::Relaxed) {
                    break;
                }
                let stamp_ns = start_ns + k * PERIOD_NS;
                sleep_until_monotonic(stamp_ns);
                // An actuator that is stuck leaves it at rest whatever is commanded.
                let command = if is_stuck.load(Ordering::Relaxed) {
                    -2.0
                } else {
                    0.0
                };
                drivers.sensors.send(stamp_ns, &at_rest(k)).unwrap();
                drivers.commands.send(stamp_ns, &[command, 0.0]).unwrap();
            }
        });
        Self {
            stuck,
            end,
            thread: Some(thread),
        }
    }

    fn stick(&self, stuck: bool) {
        self.stuck.store(stuck, Ordering::Relaxed);
    }
}

impl Drop for Vehicle {
    fn drop(&mut self) {
        self.end.store(true, Ordering::Relaxed);
        if let Some(Err(_)) = self.thread.take().map(JoinHandle::join) {
            eprintln!("the publisher ended abnormally");
        }
    }
}

#[test]
fn an_acknowledgement_by_name_or_number_ends_a_latch_once_and_never_that_of_a_later_alarm() {
    let mut stage = Stage::new();
    stage.set_diagnoser("lifecycle", Value::Table("latch = true".parse().unwrap()));
    let daemon = Daemon::start(&stage);
    let control = control(&stage);
    let lifecycle = control.describe(DIAGNOSER).unwrap().lifecycle;
    assert!(
        lifecycle
            .iter()
            .any(|(_, value)| value.contains("once it is acknowledged")),
        "{lifecycle:?}"
    );

    assert!(!control.acknowledge(DIAGNOSER).unwrap(), "there is no alarm yet");
    let vehicle = Vehicle::start(&stage.instance);
    wait_until("samples", || stage.input_counters(0).accepted > 50);
    let state = || stage.table().read_alarm_status(0).unwrap();
    let fault = || {
        vehicle.stick(true);
        wait_until("an isolated fault", || {
            state().state == AlarmState::Isolated as u64
        });
        vehicle.stick(false);
        let mut records = StepRecords::open(&stage.instance).unwrap();
        record(&mut records, "a nominal record", |record| {
            record.verdict() == Verdict::Nominal
        });
        assert_eq!(state().state, AlarmState::Isolated as u64, "it is latched");
        AlarmNumber {
            epoch: stage.table().directory().epoch,
            number: state().number,
        }
    };
    let first = fault();
    assert!(control.acknowledge_number(first).unwrap());
    wait_until("the end of the alarm", || {
        state().state == AlarmState::Cleared as u64
    });
    assert!(
        !control.acknowledge_number(first).unwrap(),
        "it is acknowledged already"
    );

    let second = fault();
    let superseded = control.acknowledge_number(first).unwrap_err();
    assert!(
        matches!(
            superseded,
            RequestError::Refused(ControlError::AlarmSuperseded { .. })
        ),
        "{superseded}"
    );
    assert_eq!(state().state, AlarmState::Isolated as u64);
    assert!(control.acknowledge(DIAGNOSER).unwrap());
    wait_until("the end of the alarm", || {
        state().state == AlarmState::Cleared as u64
    });

    assert!(second.number > first.number);
    fault();
    assert_eq!(control.acknowledge_all().unwrap(), 1);
    wait_until("the end of the alarm", || {
        state().state == AlarmState::Cleared as u64
    });

    let unknown = control.acknowledge("nobody").unwrap_err();
    assert!(
        matches!(
            unknown,
            RequestError::Refused(ControlError::NoSuchDiagnoser { .. })
        ),
        "{unknown}"
    );
    let unknown = control
        .acknowledge_number(AlarmNumber { epoch: 1, number: 1 })
        .unwrap_err();
    assert!(
        unknown.to_string().contains("no alarm 1.1 in the ring"),
        "{unknown}"
    );
    drop(vehicle);
    daemon.stop();
}

#[test]
fn a_reload_of_the_same_configuration_changes_nothing_and_a_checkpoint_without_a_file_is_refused() {
    let stage = Stage::new();
    let daemon = Daemon::start(&stage);
    let control = control(&stage);
    let outcome = control.reload().unwrap();
    assert_eq!(
        (outcome.diagnosers.unchanged, outcome.inputs.unchanged),
        (1, 2),
        "{outcome:?}"
    );
    let error = control.checkpoint().unwrap_err();
    assert!(error.to_string().contains("`checkpoint_file`"), "{error}");
    daemon.stop();
}

#[test]
fn a_control_goes_on_with_the_next_life_of_the_daemon() {
    let stage = Stage::new();
    let daemon = Daemon::start(&stage);
    let control = control(&stage);
    let first = control.list().unwrap();
    daemon.kill();
    let ended = control.list().unwrap_err();
    assert!(matches!(ended, RequestError::DaemonEnded), "{ended}");
    let error = residual_client::Control::connect(&stage.instance).unwrap_err();
    assert!(matches!(error, RequestError::NoDaemon { .. }), "{error}");
    let daemon = Daemon::start(&stage);
    let second = control.list().unwrap();
    assert!(
        second.epoch > first.epoch && second.pid == daemon.pid(),
        "{second:?}"
    );
    daemon.stop();
    assert!(control.list().is_err());
}

#[test]
fn an_instance_without_a_daemon_is_said_to_have_none() {
    let stage = Stage::new();
    let name = "nobody-here".parse().unwrap();
    let instance = Instance::new(name, stage.directory.path());
    let error = residual_client::Control::connect(&instance).unwrap_err();
    assert!(
        error.to_string().contains("no daemon of instance `nobody-here`"),
        "{error}"
    );
    assert_eq!(
        stage.runtime_files(),
        Vec::<String>::new(),
        "asking leaves nothing behind"
    );
}
