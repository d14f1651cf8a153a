//! A running daemon is recorded, and its recording replays to the same bits.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod layouts;
#[path = "../support/mod.rs"]
mod support;

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use residual_recording::recorder::{self, Stream};
use residual_recording::totals::End;
use residual_recording::{Event, Reader, Totals};
use residual_shared::clock::{monotonic_ns, sleep_until_monotonic};
use residual_shared::record::{StepRecord, Verdict};
use residual_shared::sample::SampleHeader;
use residual_shared::transport::{self, SamplePublisher};
use residuald::demo::plants::aircraft::{Aircraft, Disturbance};
use support::daemon::{Daemon, Finished, finish, program};
use support::helper::{Helper, instance};
use support::{INPUTS, Stage, wait_until};
use toml::Value;

/// Sampling instants with samples.
const INSTANTS: u64 = 120;

/// Period of the tests' diagnosers, nanoseconds: long enough for a busy machine.
const PERIOD_NS: u64 = 20_000_000;

/// Where a recorder process writes.
const OUTPUT: &str = "RESIDUALD_TEST_OUTPUT";

/// The aircraft's filter, and a chi-square test of the same plant with another period.
fn stage() -> Stage {
    let mut stage = Stage::new();
    stage.set_diagnoser("sample_time_s", PERIOD_NS as f64 * 1e-9);
    stage.set_diagnoser("margin_s", PERIOD_NS as f64 * 0.5e-9);
    stage.set("realtime", "fifo_priority", 50);
    let other: Value = CHI_SQUARE.parse::<toml::Table>().unwrap().into();
    stage.diagnosers().push(other);
    stage
}

/// A second method on the aircraft's signals, with another period and phase.
const CHI_SQUARE: &str = r#"
name = "consistency"
method = "chi_square"
sample_time_s = 0.04
phase_s = 0.01
margin_s = 0.015
measurements = ["aircraft_sensors.horizontal_speed", "aircraft_sensors.pitch_rate"]
commands = ["aircraft_commands.collective_pitch", "aircraft_commands.longitudinal_cyclic_pitch"]

[model]
transition = [[0.99, 0.001], [0.0, 0.98]]
input = [[0.01, 0.004], [-0.1, 0.09]]
process_noise_covariance = [[1e-3, 0.0], [0.0, 1e-3]]
measurement = [[1.0, 0.0], [0.0, 1.0]]
measurement_noise_covariance = [[1e-3, 0.0], [0.0, 1e-3]]
initial_covariance = [[1.0, 0.0], [0.0, 1.0]]

[statistics]
enabled = ["residual", "glr", "cusum"]
decision = ["glr", "cusum"]

[threshold]
glr = 20.0
cusum = 8.0
"#;

/// The body of a recorder process: records everything until the daemon ends or it is told to.
#[test]
#[ignore = "the body of a helper process"]
fn record_until_told_to_end() {
    let Some(instance) = instance() else { return };
    let stop = support::helper::told_to_end();
    let mut stream = Stream::open(&instance, true).unwrap();
    println!("recording");
    let slots = stream.slots(&[]).unwrap();
    let path = PathBuf::from(std::env::var_os(OUTPUT).unwrap());
    let totals = recorder::record(&mut stream, &path, &slots, None, &stop).unwrap();
    println!("{totals:?}");
}

/// A recorder process that is ready.
fn start_recorder(stage: &Stage, path: &Path) -> Helper {
    let body = "record_until_told_to_end";
    let mut command = Helper::command(stage, body);
    let recorder = Helper::start_command(stage, body, command.env(OUTPUT, path));
    wait_until("the recorder", || {
        recorder.lines().iter().any(|line| line == "recording")
    });
    recorder
}

/// Flies the aircraft, whose actuator 1 fails, with a few samples lost, doubled and sent late.
fn fly(stage: &Stage) {
    let node = transport::open_node(&stage.instance).unwrap();
    let open = |input| SamplePublisher::open(&node, &stage.instance, input).unwrap();
    let (mut sensors, mut commands) = (open(INPUTS[0]), open(INPUTS[1]));
    let mut aircraft = Aircraft::new(1, Disturbance::Sine, 5);
    let start_ns = monotonic_ns() + PERIOD_NS;
    for k in 0..INSTANTS {
        let stamp_ns = start_ns + k * PERIOD_NS;
        sleep_until_monotonic(stamp_ns);
        let header = SampleHeader {
            sequence: k,
            timestamp_ns: stamp_ns,
        };
        let (measured, commanded) = (aircraft.measure(), aircraft.command());
        aircraft.advance();
        if k % 17 != 5 {
            sensors.send_with_header(header, &measured).unwrap();
        }
        if k % 23 == 7 {
            sensors.send_with_header(header, &measured).unwrap();
        }
        commands.send_with_header(header, &commanded).unwrap();
        if k == 30 {
            commands
                .send_with_header(
                    SampleHeader {
                        sequence: k + 1,
                        ..header
                    },
                    &[f64::NAN, 1.0],
                )
                .unwrap();
        }
    }
    sleep_until_monotonic(monotonic_ns() + 5 * PERIOD_NS);
}

/// Everything in a recording.
fn read(path: &Path) -> (Vec<Event>, Option<Totals>) {
    let mut reader = Reader::open(path).unwrap();
    let mut events = Vec::new();
    while let Some(event) = reader.next_event().unwrap() {
        events.push(event);
    }
    (events, reader.totals().cloned())
}

fn replay(stage: &Stage, recording: &Path, arguments: &[&str]) -> Finished {
    let mut command = program();
    command
        .arg("replay")
        .arg(stage.configuration_file())
        .arg(recording);
    finish(command.args(arguments))
}

fn records_of(events: &[Event], slot: usize) -> Vec<StepRecord> {
    let records = events.iter().filter_map(|event| match event {
        Event::Record(message) if message.slot == slot => Some(message.record),
        _ => None,
    });
    records.collect()
}

#[test]
fn a_recorded_flight_replays_to_the_same_bits_with_two_methods() {
    let stage = stage();
    for attempt in 0..3 {
        let path = stage.files.path().join(format!("flight{attempt}.mcap"));
        let mut daemon = Daemon::spawn(&stage, &[]);
        daemon.wait_ready();
        let mut recorder = start_recorder(&stage, &path);
        fly(&stage);
        let summary = daemon.stop();
        wait_until("the end of the recording", || !recorder.is_alive());
        let said = recorder.finish().join("\n");
        assert!(said.contains("DaemonEnded"), "{said}");

        let (events, totals) = read(&path);
        let totals = totals.unwrap();
        assert_eq!(totals.end, Some(End::DaemonEnded));
        assert!(totals.is_complete(), "{totals:?}");
        let of = |topic: &str| totals.topics[&format!("/{}/{topic}", stage.instance.name)];
        for (slot, name) in [(0, "records/aircraft_actuators"), (1, "records/consistency")] {
            let records = records_of(&events, slot);
            assert_eq!(
                (of(name).messages, of(name).missing),
                (records.len() as u64, 0),
                "{name}"
            );
            assert!(
                records
                    .iter()
                    .any(|record| record.verdict() == Verdict::Isolated || slot == 1)
            );
            assert!(
                records
                    .iter()
                    .filter(|record| record.worst_channel().is_some())
                    .count()
                    > 50
            );
        }
        let lost = (0..INSTANTS).filter(|k| k % 17 == 5).count() as u64;
        assert_eq!(of("samples/aircraft_sensors").missing, lost);

        let again = stage.files.path().join("again.csv");
        let replayed = replay(&stage, &path, &["--verify", "--records", again.to_str().unwrap()]);
        if replayed.code == Some(0) && !replayed.messages.contains("but for the flag of an overrun") {
            assert_eq!(
                replayed.messages.matches("are the same to the last bit").count(),
                2,
                "{}",
                replayed.messages
            );
            let csv = fs::read_to_string(stage.files.path().join("again.aircraft_actuators.csv")).unwrap();
            assert_eq!(csv.lines().count(), records_of(&events, 0).len() + 1);
            return;
        }
        let late = summary.inputs.iter().flat_map(|input| &input.counters);
        let late: u64 = late
            .filter(|(name, _)| *name == "late")
            .map(|(_, value)| value)
            .sum();
        let busy = late + summary.schedule_total("overruns") + summary.schedule_total("skipped") > 0;
        assert!(busy, "differs although nothing was late: {}", replayed.messages);
        println!("the machine was too busy: {summary}");
    }
    panic!("three times samples were late or steps behind");
}

#[test]
fn a_killed_recorder_leaves_a_file_that_is_read_up_to_its_last_second() {
    let stage = stage();
    let path = stage.files.path().join("killed.mcap");
    let daemon = Daemon::start(&stage);
    let recorder = start_recorder(&stage, &path);
    fly(&stage);
    recorder.kill();
    let mut reader = Reader::open(&path).unwrap();
    let mut records = 0;
    while let Some(event) = reader.next_event().unwrap() {
        records += usize::from(matches!(event, Event::Record(_)));
    }
    assert!(reader.is_cut_off() && reader.totals().is_none());
    assert!(records > 60, "{records}");
    let replayed = replay(&stage, &path, &[]);
    assert_eq!(replayed.code, Some(0), "{}", replayed.messages);
    assert!(
        replayed.messages.contains("its recorder was killed"),
        "{}",
        replayed.messages
    );
    // Its place is free again for another one.
    let path = stage.files.path().join("second.mcap");
    start_recorder(&stage, &path).finish();
    assert_eq!(read(&path).1.unwrap().end, Some(End::Asked));
    daemon.stop();
}

/// The records of a diagnoser lie at schedule epoch + step · period: those of another one do not.
#[test]
fn after_a_reload_that_exchanges_two_diagnosers_no_record_stands_under_a_wrong_name() {
    let mut stage = support::scalar::stage();
    stage.set_diagnoser("sample_time_s", 0.02);
    let daemon = Daemon::start(&stage);
    let mut stream = Stream::open(&stage.instance, false).unwrap();
    let paths = ["before.mcap", "behind.mcap"].map(|name| stage.files.path().join(name));
    let never = AtomicBool::new(false);
    stage.diagnosers().swap(0, 1);
    stage.configuration_file();
    std::thread::scope(|scope| {
        scope.spawn(|| {
            std::thread::sleep(Duration::from_millis(300));
            daemon.signal(nix::sys::signal::Signal::SIGHUP);
        });
        let limit = Some(Duration::from_secs(60));
        let totals = recorder::record(&mut stream, &paths[0], &[0, 1], limit, &never).unwrap();
        assert_eq!(totals.end, Some(End::TableReplaced));
    });
    let mut stream = stream.next().unwrap();
    let limit = Some(Duration::from_millis(300));
    recorder::record(&mut stream, &paths[1], &[0, 1], limit, &never).unwrap();
    daemon.stop();
    for (path, first) in paths.iter().zip(["stable_system", "unstable_system"]) {
        let header = Reader::open(path).unwrap().header().clone();
        assert_eq!(header.diagnosers[0].name, first);
        let (events, totals) = read(path);
        let totals = totals.unwrap();
        assert!(totals.is_complete(), "{totals:?}");
        for (slot, diagnoser) in header.diagnosers.iter().enumerate().take(2) {
            let records = records_of(&events, slot);
            assert!(records.len() > 5, "{}: {}", diagnoser.name, records.len());
            let begin_ns = header.schedule_epoch_ns + diagnoser.phase_ns;
            for record in records {
                let expected_ns = begin_ns + record.step * diagnoser.period_ns;
                assert_eq!(
                    record.instant_ns, expected_ns,
                    "{} {}",
                    diagnoser.name, record.step
                );
            }
        }
    }
}

#[test]
fn what_cannot_be_replayed_is_refused_with_the_reason() {
    let stage = stage();
    let path = stage.files.path().join("short.mcap");
    let daemon = Daemon::start(&stage);
    let mut stream = Stream::open(&stage.instance, false).unwrap();
    let never = AtomicBool::new(false);
    recorder::record(&mut stream, &path, &[0], Some(Duration::from_millis(100)), &never).unwrap();
    daemon.stop();
    let refused = |stage: &Stage, path: &Path, arguments: &[&str], phrase: &str| {
        let finished = replay(stage, path, arguments);
        assert_eq!(finished.code, Some(1), "{}", finished.messages);
        assert!(
            finished.messages.contains(phrase),
            "`{phrase}` in: {}",
            finished.messages
        );
    };
    refused(&stage, &path, &[], "record with `residual record --samples`");
    refused(
        &stage,
        &path,
        &["--through-daemon"],
        "--through-daemon works on CSV recordings only",
    );
    refused(
        &stage,
        &path,
        &["--loss", "all=0.1"],
        "--loss works on CSV recordings only",
    );
    let mut other = Stage::new();
    other.configuration = stage.configuration.clone();
    other.configuration["input"].as_array_mut().unwrap()[0]["name"] = "elsewhere".into();
    let text = other
        .configuration
        .to_string()
        .replace("aircraft_sensors.", "elsewhere.");
    other.configuration = text
        .replace("input = \"aircraft_sensors\"", "input = \"elsewhere\"")
        .parse()
        .unwrap();
    refused(&other, &path, &[], "has no input `elsewhere`");
    let foreign = stage.files.path().join("foreign.mcap");
    fs::write(&foreign, &fs::read(&path).unwrap()[..200]).unwrap();
    refused(&stage, &foreign, &[], "no recording of a residuald daemon");
    let csv = stage.files.path().join("some.csv");
    fs::write(&csv, "t\n1\n").unwrap();
    refused(
        &stage,
        &csv,
        &["--verify"],
        "--verify needs a recording with records",
    );
}
