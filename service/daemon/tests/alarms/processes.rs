//! From a fault to the transitions of its alarm, through real processes: iceoryx2 samples in, alarm ring out.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use crate::support::daemon::Daemon;
use crate::support::publisher::{Drivers, at_rest};
use crate::support::{DIAGNOSER, PATIENCE, PERIOD_NS, Stage, wait_for, wait_until};
use iceoryx2::prelude::{CallbackProgression, SignalHandlingMode, WaitSetBuilder, ipc};
use residual_shared::alarm::{AlarmState, AlarmTransition, alarm_flags};
use residual_shared::bounds_table::{AlarmRead, TableReader};
use residual_shared::clock::{monotonic_ns, sleep_until_monotonic};
use residual_shared::control::{Alarms, Request, Response};
use residual_shared::names::Instance;
use residual_shared::record::{StepRecord, Verdict};
use residual_shared::transport::{self, AlarmEvents, ControlClient, SamplePublisher};
use toml::{Table, Value};

/// No actuator, the first, the second: what is commanded while it is stuck at zero.
const STUCK: [[f64; 2]; 3] = [[0.0, 0.0], [-2.0, 0.0], [0.0, -1.0]];

/// A thread that publishes the aircraft at rest at 100 Hz. An actuator that is stuck leaves it at rest whatever is
/// commanded.
struct Vehicle {
    stuck: Arc<AtomicUsize>,
    altitude: Arc<AtomicU64>,
    end: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Vehicle {
    fn start(instance: &Instance, stuck: usize, has_altitude: bool) -> Self {
        let mut vehicle = Self {
            stuck: Arc::new(AtomicUsize::new(stuck)),
            altitude: Arc::default(),
            end: Arc::default(),
            thread: None,
        };
        let (stuck, altitude) = (Arc::clone(&vehicle.stuck), Arc::clone(&vehicle.altitude));
        let (end, instance) = (Arc::clone(&vehicle.end), instance.clone());
        let publish = move || {
            let mut drivers = Drivers::open(&instance);
            let node = transport::open_node(&instance).unwrap();
            let mut barometer =
                has_altitude.then(|| SamplePublisher::open(&node, &instance, "barometer").unwrap());
            let start_ns = monotonic_ns();
            for k in 0.. {
                if end.load(Ordering::Relaxed) {
                    break;
                }
                let stamp_ns = start_ns + k * PERIOD_NS;
                sleep_until_monotonic(stamp_ns);
                let command = STUCK[stuck.load(Ordering::Relaxed)];
                drivers.sensors.send(stamp_ns, &at_rest(k)).unwrap();
                drivers.commands.send(stamp_ns, &command).unwrap();
                if let Some(barometer) = &mut barometer {
                    let altitude = altitude.load(Ordering::Relaxed) as f64;
                    barometer.send(stamp_ns, &[altitude]).unwrap();
                }
            }
        };
        vehicle.thread = Some(std::thread::spawn(publish));
        vehicle
    }

    fn stick(&self, actuator: usize) {
        self.stuck.store(actuator, Ordering::Relaxed);
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

fn lifecycle(keys: &str) -> Value {
    Value::Table(keys.parse().unwrap())
}

/// All transitions from number `from` on.
fn transitions(table: &TableReader, from: u64) -> Vec<AlarmTransition> {
    let read = |number| match table.read_alarm(number) {
        AlarmRead::Transition(transition) => transition,
        other => panic!("transition {number}: {other:?}"),
    };
    (from..=table.newest_alarm()).map(read).collect()
}

/// Waits until the alarm of the diagnoser in `slot` has this state.
fn wait_for_state(stage: &Stage, slot: usize, state: AlarmState) {
    wait_until(state.name(), || {
        stage.table().read_alarm_status(slot).unwrap().state == state as u64
    });
}

/// The states of these transitions; several isolations in a row, of a set that changed, once.
fn states(transitions: &[AlarmTransition]) -> Vec<AlarmState> {
    let mut states: Vec<_> = transitions.iter().map(|transition| transition.state).collect();
    states.dedup();
    states
}

/// The states of the events that wake a `WaitSet`, until both faults are over.
fn wait_set_consumer(instance: &Instance) -> JoinHandle<Vec<AlarmState>> {
    let (instance, opened) = (instance.clone(), Arc::new(AtomicBool::new(false)));
    let ready = Arc::clone(&opened);
    let consumer = std::thread::spawn(move || {
        let node = transport::open_node(&instance).unwrap();
        let events = AlarmEvents::open(&node, &instance).unwrap();
        let wait_set = WaitSetBuilder::new()
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<ipc::Service>()
            .unwrap();
        let _guard = wait_set.attach_notification(events.listener()).unwrap();
        ready.store(true, Ordering::Release);
        let mut seen = Vec::new();
        while seen.iter().filter(|state| **state == AlarmState::Cleared).count() < 2 {
            let on_event = |_| {
                let take = |state, count| seen.extend(std::iter::repeat_n(state, count as usize));
                events.wait(Duration::ZERO, take).unwrap();
                CallbackProgression::Continue
            };
            let patience = Duration::from_secs(20);
            wait_set
                .wait_and_process_once_with_timeout(on_event, patience)
                .unwrap();
        }
        seen
    });
    wait_until("the listener", || opened.load(Ordering::Acquire));
    consumer
}

#[test]
fn a_fault_is_pending_raised_isolated_and_cleared_in_order_and_the_second_one_is_number_two() {
    use AlarmState::{Cleared, Isolated, Pending, Raised};
    let mut stage = Stage::new();
    stage.set_diagnoser(
        "lifecycle",
        lifecycle("raise_steps = 3\nraise_window = 5\nclear_steps = 10"),
    );
    let daemon = Daemon::start(&stage);
    let consumer = wait_set_consumer(&stage.instance);
    let vehicle = Vehicle::start(&stage.instance, 0, false);
    wait_until("half a second", || stage.input_counters(0).accepted > 50);
    for actuator in [1, 2] {
        vehicle.stick(actuator);
        wait_for_state(&stage, 0, Isolated);
        vehicle.stick(0);
        wait_for_state(&stage, 0, Cleared);
    }
    let table = stage.table();
    let all = transitions(&table, 1);
    let episode = [Pending, Raised, Isolated, Cleared];
    assert_eq!(states(&all), [episode, episode].concat(), "{all:#?}");
    for (number, transition) in (1..).zip(&all) {
        assert_eq!(transition.number.number, number);
        assert_eq!(transition.number.epoch, table.directory().epoch);
        assert_eq!(transition.slot, 0);
        assert!(transition.written_ns >= transition.instant_ns);
    }
    let raised: Vec<_> = all
        .iter()
        .filter(|transition| transition.state == Raised)
        .collect();
    assert_eq!([raised[0].occurrence, raised[1].occurrence], [1, 2]);
    let isolated = |occurrence| {
        let of = |t: &&AlarmTransition| t.state == Isolated && t.occurrence == occurrence;
        all.iter().rfind(of).unwrap()
    };
    assert_eq!(
        [isolated(1).certainly_faulty, isolated(2).certainly_faulty],
        [0b01, 0b10]
    );
    // The third violation raised it: two steps after the first one, or up to four if they were not in a row.
    let pending = all.iter().find(|transition| transition.state == Pending).unwrap();
    assert!((2..=4).contains(&(raised[0].step - pending.step)));
    let status = table.read_alarm_status(0).unwrap();
    assert_eq!((status.occurrences, status.number), (2, all.len() as u64));

    let mut events = consumer.join().unwrap();
    events.sort_by_key(|state| *state as u32);
    let mut expected: Vec<_> = all.iter().map(|transition| transition.state).collect();
    expected.sort_by_key(|state| *state as u32);
    assert_eq!(events, expected);
    drop(vehicle);
    let messages = wait_for("the log", || {
        let messages = daemon.messages();
        (messages.matches("alarm=\"cleared\"").count() == 2).then_some(messages)
    });
    assert!(
        messages.contains("alarm=\"isolated\"") && messages.contains("occurrence=2"),
        "{messages}"
    );
    daemon.stop();
}

#[test]
fn a_killed_daemon_goes_on_numbering_and_neither_raises_again_nor_forgets_a_latch() {
    let mut stage = Stage::new();
    stage.set_diagnoser("lifecycle", lifecycle("latch = true"));
    let daemon = Daemon::start(&stage);
    let vehicle = Vehicle::start(&stage.instance, 0, false);
    wait_until("a sample", || stage.input_counters(0).accepted > 50);
    vehicle.stick(1);
    wait_for_state(&stage, 0, AlarmState::Isolated);
    let before = transitions(&stage.table(), 1);
    daemon.kill();

    let verdict = |wanted: Verdict| {
        let mut record = StepRecord::new(0);
        wait_until(wanted.name(), || {
            stage.table().read(0, &mut record).unwrap();
            record.verdict() == wanted && record.step > 0
        });
        record.step
    };
    let mut daemon = Daemon::spawn(&stage, &[]);
    let table = daemon.wait_ready();
    let status = table.read_alarm_status(0).unwrap();
    assert_eq!(
        (status.state, status.occurrences),
        (AlarmState::Isolated as u64, 1)
    );
    assert_eq!(status.flags, u64::from(alarm_flags::LATCHED));
    // The new life finds the same fault: nothing new. Then the fault ends, but nobody has acknowledged it.
    verdict(Verdict::Isolated);
    assert_eq!(transitions(&table, 1), before);
    vehicle.stick(0);
    let nominal = verdict(Verdict::Nominal);
    wait_until("quiet steps", || {
        table.read_schedule_counters(0).unwrap().steps > nominal + 20
    });
    assert_eq!(transitions(&table, 1), before);
    daemon.kill();

    // The third life still waits for somebody to see it, and clears it under the next number.
    let mut daemon = Daemon::spawn(&stage, &[]);
    let table = daemon.wait_ready();
    let nominal = verdict(Verdict::Nominal);
    wait_until("quiet steps", || {
        table.read_schedule_counters(0).unwrap().steps > nominal + 20
    });
    assert_eq!(transitions(&table, 1), before);
    let acknowledge = || {
        let request = Request::Acknowledge { alarms: Alarms::All };
        let client = ControlClient::connect(&stage.instance).unwrap();
        client.request(&request, PATIENCE).unwrap()
    };
    assert!(matches!(acknowledge(), Response::Acknowledged { alarms: 1 }));
    assert!(matches!(acknowledge(), Response::Acknowledged { alarms: 0 }));
    let after = transitions(&table, 1);
    assert_eq!(after[..before.len()], before);
    assert_eq!(after.len(), before.len() + 1, "{after:?}");
    let cleared = after.last().unwrap();
    assert_eq!((cleared.state, cleared.occurrence), (AlarmState::Cleared, 1));
    assert_eq!(cleared.flags, alarm_flags::ACKNOWLEDGED);
    assert_eq!(cleared.number.epoch, table.directory().epoch);
    drop(vehicle);
    daemon.stop();
}

#[test]
fn violations_during_start_up_and_on_disabled_channels_raise_nothing() {
    const SUPPRESSION_NS: u64 = 1_500_000_000;
    let mut stage = Stage::new();
    let barometer = "name = 'barometer'\nsignals = ['altitude']"
        .parse::<Table>()
        .unwrap();
    stage.configuration["input"]
        .as_array_mut()
        .unwrap()
        .push(barometer.into());
    let plain = stage.diagnosers()[0].clone();
    for (name, keys) in [
        ("suppressed", "startup_suppression_s = 1.5"),
        (
            "enabled",
            "enable = [{signal = 'barometer.altitude', range = [100, 10000]}]",
        ),
    ] {
        let mut diagnoser = plain.clone();
        let table = diagnoser.as_table_mut().unwrap();
        table.insert("name".into(), name.into());
        table.insert("lifecycle".into(), lifecycle(keys));
        stage.diagnosers().push(diagnoser);
    }
    let daemon = Daemon::start(&stage);
    let vehicle = Vehicle::start(&stage.instance, 1, true);
    wait_for_state(&stage, 1, AlarmState::Isolated);
    let table = stage.table();
    let slots = &table.directory().spec.slots;
    assert_eq!(
        [&*slots[0].name, &*slots[1].name, &*slots[2].name],
        [DIAGNOSER, "suppressed", "enabled"]
    );
    let first = |slot| {
        let all = transitions(&table, 1);
        all.into_iter().find(|transition| transition.slot == slot)
    };
    let (plain, suppressed) = (first(0).unwrap(), first(1).unwrap());
    assert!(
        plain.instant_ns + SUPPRESSION_NS / 2 < suppressed.instant_ns,
        "{plain:?} {suppressed:?}"
    );
    // The plain alarm came at the first evaluated instant at the earliest.
    assert!(suppressed.instant_ns <= plain.instant_ns + SUPPRESSION_NS + 10 * PERIOD_NS);
    assert_eq!(first(2), None);

    vehicle.altitude.store(500, Ordering::Relaxed);
    wait_for_state(&stage, 2, AlarmState::Isolated);
    assert_eq!(first(2).unwrap().state, AlarmState::Raised);
    drop(vehicle);
    daemon.stop();
}
