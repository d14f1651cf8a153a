//! The loop of the step thread allocates nothing once its publishers are connected, whatever they send.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod counting_allocator;
mod support;

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use counting_allocator::allocations;
use residual_shared::alarm::{AlarmState, AlarmTransition};
use residual_shared::bounds_table::AlarmRead;
use residual_shared::clock::{DaemonTime, sleep_until_monotonic};
use residual_shared::record::{StepRecord, flags};
use residual_shared::sample::SampleHeader;
use residual_shared::transport::{self, RecordAudience, RecordPublisher, RecordSubscriber};
use residuald::assembly::assemble;
use residuald::commands::run::step_loop;
use residuald::configuration::Configuration;
use residuald::demo::composition::compose;
use residuald::demo::plants::Merged;
use residuald::demo::plants::aircraft::{Aircraft, Disturbance};
use residuald::demo::scenario::{self, Variation};
use residuald::runtime::command::{self, Command, Reply};
use residuald::runtime::companion::Message;
use residuald::runtime::engine::RecordSink;
use residuald::runtime::life::Life;
use residuald::runtime::running::Running;
use residuald::runtime::snapshot::{Progress, Snapshot};
use support::publisher::Drivers;
use support::{PERIOD_NS, Stage};
use toml::Table;

/// Turns of the loop.
const TURNS: u64 = 2_400;
/// Turns until every connection stands and every first time is over.
const WARM_UP: u64 = 20;
/// Measurements after which the aircraft begins anew, healthy: a jump, an episode of alarms, its end.
const COURSE: u64 = 240;
/// Turns of every second course at which the alarm is acknowledged and the diagnoser is reset: during its fault.
const ACKNOWLEDGED: u64 = 180;
const RESET: u64 = 200;
/// Turns from one snapshot of all states to the next.
const SAVE_EVERY: u64 = 50;
/// So that the test takes seconds, the daemon's time runs faster.
const SPEED: f64 = 8.0;

/// The simulated epoch.
const EPOCH_NS: u64 = 1_000_000_000_000;

/// What the records of the whole test said.
#[derive(Debug, Default)]
struct Seen {
    records: u64,
    alarms: u64,
    resets: u64,
    missing: u64,
    late: u64,
    isolated: u64,
    obeyed: u64,
    saved: u64,
    acknowledged: u64,
    refused: u64,
}

impl Seen {
    fn take(&mut self, record: &StepRecord) {
        let has = |flag| u64::from(record.flags & flag != 0);
        self.records += 1;
        self.alarms += has(flags::ALARM_NOW);
        self.resets += has(flags::RESET);
        self.missing += has(flags::INPUT_MISSING);
        self.late += has(flags::LATE_SAMPLE);
        self.isolated += u64::from(record.certainly_faulty != 0);
    }
}

/// Sends the samples of turn `k`, good ones and every kind of bad and missing one.
fn send(drivers: &mut Drivers, aircraft: &mut Aircraft, k: u64, stamp_ns: u64) {
    let measurement = aircraft.measure();
    let command = aircraft.command();
    aircraft.advance();
    let sequence = |number| SampleHeader {
        sequence: number,
        timestamp_ns: stamp_ns,
    };
    match k % 60 {
        10 => drivers.sensors.send(stamp_ns, &measurement).unwrap(), // no command
        11 => drivers.commands.send(stamp_ns, &command).unwrap(),    // no measurement
        12 | 13 => {
            drivers.sensors.skip();
            drivers.commands.skip();
        }
        20 => drivers.sensors.send(stamp_ns, &[f64::NAN; 4]).unwrap(),
        21 => drivers.sensors.send(stamp_ns, &measurement[..3]).unwrap(),
        22 => drivers
            .sensors
            .send(stamp_ns + 60_000_000_000, &measurement)
            .unwrap(),
        23 => drivers
            .sensors
            .send(stamp_ns - 20 * PERIOD_NS, &measurement)
            .unwrap(),
        30 => {
            // The sample of the instant before comes now: late.
            drivers.sensors.send(stamp_ns - PERIOD_NS, &measurement).unwrap();
        }
        29 => {}
        40 => {
            drivers.sensors.send(stamp_ns, &measurement).unwrap();
            drivers
                .sensors
                .send_with_header(sequence(0), &measurement)
                .unwrap(); // duplicate
            drivers.commands.send(stamp_ns, &command).unwrap();
        }
        _ => {
            drivers.sensors.send(stamp_ns, &measurement).unwrap();
            drivers.commands.send(stamp_ns, &command).unwrap();
        }
    }
}

#[test]
fn two_thousand_turns_with_good_bad_and_missing_samples_alarms_resets_and_commands_allocate_nothing() {
    let mut stage = Stage::new();
    stage.set_diagnoser("margin_s", 0.0);
    let lifecycle: Table = "raise_steps = 2\nraise_window = 4\nlatch = true\nstartup_suppression_s = 0.1\n\
        enable = [{signal = 'aircraft_commands.collective_pitch', range = [-1, 1]}]"
        .parse()
        .unwrap();
    stage.set_diagnoser("lifecycle", lifecycle);
    let loaded = Configuration::from_text("test", &stage.configuration.to_string()).unwrap();
    let diagnosers = loaded.build_diagnosers().unwrap();
    let node = transport::open_node(&stage.instance).unwrap();
    let (sender, mut receiver) = rtrb::RingBuffer::new(loaded.configuration.daemon.record_queue);
    let stop = AtomicBool::new(false);
    let (mut commands, inbox) = command::channel();
    let ticket = commands.ticket();
    let running = Arc::new(Running::new(loaded.configuration.clone(), &diagnosers));
    let life = Life::begin(&loaded.configuration.daemon, SPEED);
    let mut steps = step_loop(running, diagnosers, &life, &node, sender, inbox, &stop).unwrap();
    // Every turn looks whether somebody records, and somebody does.
    let _stream = RecordPublisher::create(&node, &stage.instance).unwrap();
    let _recorder = RecordSubscriber::open(&node, &stage.instance).unwrap();
    let audience = RecordAudience::open(&node, &stage.instance).unwrap();
    steps.publication.record_for(audience);
    let mut drivers = Drivers::open(&stage.instance);
    let spec = stage.table().directory().spec.clone();
    let time: DaemonTime = spec.time;
    let identity = spec.slots[0].identity();

    let mut aircraft = Aircraft::new(1, Disturbance::Sine, 1);
    let mut seen = Seen::default();
    let mut snapshot = Some(Box::<Snapshot>::default());
    let mut counted = 0;
    for k in 0..TURNS {
        if k % COURSE == 0 {
            aircraft = Aircraft::new(1 + (k / COURSE % 2) as u8, Disturbance::Vertex, k);
        }
        let instant_ns = spec.schedule_epoch_ns + k * PERIOD_NS;
        sleep_until_monotonic(time.to_monotonic(instant_ns));
        send(&mut drivers, &mut aircraft, k, instant_ns);
        match k % (2 * COURSE) {
            ACKNOWLEDGED => commands.send(ticket, Command::Acknowledge(identity, None)),
            RESET => {
                commands.send(ticket, Command::Reset(identity));
                commands.send(ticket, Command::Reset(!identity));
            }
            _ => {}
        }
        if k % SAVE_EVERY == SAVE_EVERY - 1 {
            commands.send(ticket, Command::Save(snapshot.take().unwrap()));
        }
        let (of_this_turn, ()) = allocations(|| steps.turn());
        if k >= WARM_UP {
            counted += of_this_turn;
        }
        while let Some((_, reply)) = commands.reply() {
            seen.obeyed += u64::from(matches!(reply, Reply::Reset));
            seen.acknowledged += u64::from(matches!(reply, Reply::Acknowledged(true)));
            seen.refused += u64::from(matches!(reply, Reply::NoSuchDiagnoser));
            if let Reply::Saved(mut written, progress) = reply {
                match progress {
                    Progress::Whole => {
                        seen.saved += 1;
                        written.clear();
                    }
                    Progress::NoRoom => written.grow(),
                    Progress::Unfinished => {}
                }
                snapshot = Some(written);
            }
        }
        while let Ok(message) = receiver.pop() {
            if let Message::Record { record, .. } = message {
                seen.take(&record);
            }
        }
    }
    println!("{seen:?}");
    println!("{:?}", stage.input_counters(0));
    assert_eq!(counted, 0, "allocations in {} turns", TURNS - WARM_UP);

    assert!(
        seen.records >= TURNS / 2 && seen.alarms > 20 && seen.resets > 5,
        "{seen:?}"
    );
    assert!(
        seen.missing > 100 && seen.late > 10 && seen.isolated > 100,
        "{seen:?}"
    );
    let commanded = TURNS / (2 * COURSE);
    assert_eq!((seen.obeyed, seen.refused), (commanded, commanded), "{seen:?}");
    assert!(seen.saved >= TURNS / SAVE_EVERY / 3, "{seen:?}");
    let table = stage.table();
    let states: Vec<AlarmState> = (1..=table.newest_alarm())
        .filter_map(|number| match table.read_alarm(number) {
            AlarmRead::Transition(transition) => Some(transition.state),
            _ => None,
        })
        .collect();
    for state in [
        AlarmState::Cleared,
        AlarmState::Pending,
        AlarmState::Raised,
        AlarmState::Isolated,
    ] {
        let count = states.iter().filter(|seen| **seen == state).count();
        assert!(count >= 3, "{state:?}: {states:?}");
    }
    assert!(seen.acknowledged >= 2, "{seen:?}");
    let sensors = stage.input_counters(0);
    for (name, value) in [
        ("non_finite", sensors.non_finite),
        ("wrong_length", sensors.wrong_length),
        ("too_far_ahead", sensors.too_far_ahead),
        ("backward", sensors.backward),
        ("duplicate", sensors.duplicate),
        ("lost", sensors.lost),
    ] {
        assert!(value >= 30, "{name}: {sensors:?}");
    }
}

/// Counts alarms and their transitions by slot.
struct Alarms(Vec<u64>, Vec<u64>);

impl RecordSink for Alarms {
    fn publish(&mut self, slot: usize, record: &StepRecord) -> bool {
        self.0[slot] += u64::from(record.flags & flags::ALARM_NOW != 0);
        true
    }

    fn alarm(&mut self, transition: &AlarmTransition) {
        self.1[transition.slot as usize] += 1;
    }
}

#[test]
fn all_methods_together_step_through_losses_bad_samples_and_faults_without_allocating() {
    let scenarios = scenario::of_all_methods();
    let examples: Vec<_> = scenarios.iter().map(|scenario| scenario.example).collect();
    let gains_file = Path::new("all.gains.toml");
    let composed = compose(&examples, &"all".parse().unwrap(), gains_file).unwrap();
    let loaded = Configuration::from_text("all", &composed.configuration).unwrap();
    let diagnosers = loaded.on_gains("all.gains.toml", &composed.gains).unwrap();
    let configuration = &loaded.configuration;
    let variation = Variation {
        seed: 1,
        disturbance: Disturbance::Sine,
    };
    let plants = scenarios
        .iter()
        .flat_map(|scenario| (scenario.plants)(&variation));
    let emissions: Vec<_> = Merged::new(plants.collect()).collect();
    let mut engine = assemble(configuration, diagnosers, EPOCH_NS, 1.0);
    let count = configuration.diagnosers.len();
    let mut alarms = Alarms(vec![0; count], vec![0; count]);
    let mut sequences = vec![0; configuration.inputs.len()];
    let mut counted = 0;
    for (number, emission) in emissions.iter().enumerate() {
        let now_ns = EPOCH_NS + emission.time_ns;
        let input = configuration
            .inputs
            .iter()
            .position(|input| input.name == emission.input)
            .unwrap();
        let header = SampleHeader {
            sequence: sequences[input],
            // Some samples claim to be older than they are.
            timestamp_ns: if number % 43 == 42 {
                now_ns - 3_000_000_000
            } else {
                now_ns
            },
        };
        sequences[input] += 1;
        let mut elements = emission.elements.clone();
        if let Some(first) = elements.as_mut().and_then(|elements| elements.first_mut())
            && number % 37 == 36
        {
            *first = f64::NAN;
        }
        counted += allocations(|| {
            while let Some(due_ns) = engine.next_due_ns().filter(|&due_ns| due_ns < now_ns) {
                engine.step_due(due_ns, || 0, &mut alarms);
            }
            if let Some(elements) = &elements {
                engine.accept(input, 1, header, elements, now_ns);
            }
        })
        .0;
    }
    println!("{} samples, alarms {:?}", emissions.len(), alarms.0);
    assert_eq!(counted, 0);
    assert!(alarms.0.iter().all(|alarms| *alarms > 5), "{:?}", alarms.0);
    assert!(
        alarms.1.iter().all(|transitions| *transitions > 0),
        "{:?}",
        alarms.1
    );
    let rejected: u64 = engine
        .input_counters()
        .map(|counters| counters.non_finite + counters.backward)
        .sum();
    assert!(rejected > 100, "{rejected}");
}
