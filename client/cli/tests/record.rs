//! `residual record` against a daemon that the test plays: table, stream of records, and inputs.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod live;

use std::path::Path;
use std::process::{Child, Output, Stdio};
use std::time::{Duration, Instant};

use live::Live;
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use residual_recording::totals::End;
use residual_recording::{Event, Reader, Totals};

/// Everything in a recording.
fn read(path: &Path) -> (usize, usize, Option<Totals>) {
    let mut reader = Reader::open(path).unwrap();
    let (mut records, mut samples) = (0, 0);
    while let Some(event) = reader.next_event().unwrap() {
        match event {
            Event::Record(message) => {
                assert_eq!(message.record.channels()[0].residual, 0.5);
                records += 1;
            }
            Event::Sample(sample) => {
                assert_eq!(sample.elements, [0.25]);
                samples += 1;
            }
            Event::Alarm(transition) => panic!("{transition:?}"),
        }
    }
    (records, samples, reader.totals().cloned())
}

/// A running `residual record` that has opened its file.
fn start(live: &Live, path: &Path, arguments: &[&str]) -> Child {
    let mut command = live.command(&["record", "--output", path.to_str().unwrap()]);
    let child = command
        .args(arguments)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let begin = Instant::now();
    while Reader::open(path).is_err() {
        assert!(begin.elapsed() < Duration::from_secs(20), "no recording appears");
        std::thread::sleep(Duration::from_millis(2));
    }
    child
}

fn signal(child: &Child, signal: Signal) {
    kill(Pid::from_raw(child.id().cast_signed()), signal).unwrap();
}

fn said(output: &Output) -> String {
    let text = [&output.stdout[..], &output.stderr[..]].concat();
    String::from_utf8(text).unwrap()
}

#[test]
fn a_recording_ends_whole_on_each_signal_and_holds_all_that_came_before() {
    let mut live = Live::start();
    let configuration = live.file("some.toml");
    std::fs::write(&configuration, "").unwrap();
    let configuration = configuration.to_str().unwrap();
    for (number, end) in [Signal::SIGINT, Signal::SIGTERM, Signal::SIGHUP]
        .into_iter()
        .enumerate()
    {
        let path = live.file(&format!("{number}.mcap"));
        let child = start(&live, &path, &["--samples", "--configuration", configuration]);
        for _ in 0..20 {
            live.send_sample();
            live.send_record(0);
            live.send_record(1);
        }
        std::thread::sleep(Duration::from_millis(100));
        signal(&child, end);
        let output = child.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{}", said(&output));
        assert!(
            said(&output).contains("/records/front: 20 messages\n"),
            "{}",
            said(&output)
        );
        assert!(said(&output).contains("nothing was lost"), "{}", said(&output));
        let (records, samples, totals) = read(&path);
        assert_eq!((records, samples), (40, 20));
        assert_eq!(totals.unwrap().end, Some(End::Asked));
        let header = Reader::open(&path).unwrap().header().clone();
        assert!(header.configuration.unwrap().ends_with("some.toml"));
        assert_eq!(header.diagnosers[0].channels[0].unit, "N");
    }
}

/// By diagnoser, the steps in a recording; and its totals.
fn steps(path: &Path) -> ([Vec<u64>; 2], Totals) {
    let mut reader = Reader::open(path).unwrap();
    let names: Vec<String> = reader
        .header()
        .diagnosers
        .iter()
        .map(|diagnoser| diagnoser.name.clone())
        .collect();
    let mut steps = [vec![], vec![]];
    while let Some(event) = reader.next_event().unwrap() {
        if let Event::Record(message) = event {
            let of = usize::from(names[message.slot] == "rear");
            steps[of].push(message.record.step);
        }
    }
    (steps, reader.totals().unwrap().clone())
}

/// Records while the daemon does `change`, which exchanges its two diagnosers: each record must stand under the name
/// of the diagnoser that made it, none may be lost, and the change is told. `front` has slot 0 and the even steps of
/// the test, `rear` has slot 1 and the odd ones, until they change places.
fn assert_no_record_under_a_wrong_name(change: impl Fn(&mut Live)) {
    let mut live = Live::start();
    let path = live.file("drive.mcap");
    let child = start(&live, &path, &["--samples"]);
    for step in 0..50 {
        live.send_record_of(0, 2 * step);
        live.send_record_of(1, 2 * step + 1);
        live.send_sample();
        std::thread::sleep(Duration::from_millis(1));
    }
    change(&mut live);
    for step in 50..150 {
        live.send_record_of(1, 2 * step);
        live.send_record_of(0, 2 * step + 1);
        live.send_sample();
        std::thread::sleep(Duration::from_millis(1));
    }
    std::thread::sleep(Duration::from_millis(100));
    signal(&child, Signal::SIGTERM);
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    assert!(
        said(&output).contains("the recording goes on in the next file"),
        "{}",
        said(&output)
    );
    let parts = [
        (path, 0..50, End::TableReplaced),
        (live.file("drive.2.mcap"), 50..150, End::Asked),
    ];
    for (path, range, end) in parts {
        let (steps, totals) = steps(&path);
        assert_eq!(
            steps[0],
            range.clone().map(|step| 2 * step).collect::<Vec<_>>(),
            "front"
        );
        assert_eq!(
            steps[1],
            range.map(|step| 2 * step + 1).collect::<Vec<_>>(),
            "rear"
        );
        assert_eq!(totals.end, Some(end));
        assert!(totals.is_complete(), "{totals:?}");
    }
    let samples = ["drive.mcap", "drive.2.mcap"].map(|name| read(&live.file(name)).1);
    assert_eq!(samples[0] + samples[1], 150);
}

#[test]
fn after_a_reload_that_exchanges_slots_every_record_stands_under_its_own_name() {
    assert_no_record_under_a_wrong_name(|live| live.reload(["rear", "front"]));
}

#[test]
fn after_a_restart_at_once_every_record_stands_under_its_own_name() {
    assert_no_record_under_a_wrong_name(|live| live.restart(["rear", "front"]));
}

#[test]
fn records_of_a_table_that_was_replaced_before_it_could_be_read_are_counted_as_lost() {
    let mut live = Live::start();
    let path = live.file("drive.mcap");
    let child = start(&live, &path, &[]);
    live.send_record(0);
    std::thread::sleep(Duration::from_millis(100));
    signal(&child, Signal::SIGSTOP);
    live.reload(["rear", "front"]);
    (0..3).for_each(|_| live.send_record(0));
    live.reload(["front", "rear"]);
    (0..4).for_each(|_| live.send_record(0));
    signal(&child, Signal::SIGCONT);
    std::thread::sleep(Duration::from_millis(200));
    signal(&child, Signal::SIGTERM);
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(7), "{}", said(&output));
    assert_eq!(read(&path).0, 1);
    let (records, _, totals) = read(&live.file("drive.2.mcap"));
    assert_eq!((records, totals.unwrap().lost_records), (4, 3));
}

#[test]
fn a_diagnoser_that_is_gone_after_a_reload_is_told_and_the_others_go_on() {
    let mut live = Live::start();
    let path = live.file("drive.mcap");
    let child = start(&live, &path, &["--diagnoser", "front", "--diagnoser", "rear"]);
    live.send_record(0);
    live.reload(["side", "rear"]);
    (0..2).for_each(|slot| live.send_record(slot));
    std::thread::sleep(Duration::from_millis(200));
    signal(&child, Signal::SIGTERM);
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    assert!(
        said(&output).contains("the daemon has no diagnoser `front`"),
        "{}",
        said(&output)
    );
    assert_eq!(read(&live.file("drive.2.mcap")).0, 1);
}

#[test]
fn samples_that_still_come_do_not_keep_a_recording_going_when_the_daemon_has_ended() {
    let mut live = Live::start();
    let path = live.file("end.mcap");
    let mut child = start(&live, &path, &["--samples"]);
    live.close_table();
    let begin = Instant::now();
    while child.try_wait().unwrap().is_none() {
        assert!(begin.elapsed() < Duration::from_secs(10), "it goes on");
        live.send_sample();
        std::thread::sleep(Duration::from_millis(10));
    }
}

#[test]
fn signals_that_come_at_once_after_the_first_leave_the_recording_whole() {
    let mut live = Live::start();
    let path = live.file("group.mcap");
    let child = start(&live, &path, &[]);
    live.send_record(0);
    std::thread::sleep(Duration::from_millis(50));
    for end in [Signal::SIGTERM, Signal::SIGTERM, Signal::SIGHUP] {
        signal(&child, end);
        std::thread::sleep(Duration::from_micros(200));
    }
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    assert_eq!(read(&path).2.unwrap().end, Some(End::Asked));
}

#[test]
fn only_the_named_diagnosers_are_recorded_for_the_given_time() {
    let mut live = Live::start();
    let path = live.file("rear.mcap");
    let begin = Instant::now();
    let child = start(&live, &path, &["--diagnoser", "rear", "--duration", "0.5"]);
    live.send_record(0);
    live.send_record(1);
    live.send_sample();
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    assert!(begin.elapsed() >= Duration::from_millis(500));
    let (records, samples, totals) = read(&path);
    assert_eq!((records, samples), (1, 0));
    let topics: Vec<String> = totals.unwrap().topics.into_keys().collect();
    let expected = ["alarms", "records/rear"].map(|topic| format!("/{}/{topic}", live.instance.name));
    assert_eq!(topics, expected);
}

#[test]
fn what_a_stopped_recorder_lost_is_counted_and_told() {
    let mut live = Live::start();
    let path = live.file("lossy.mcap");
    let child = start(&live, &path, &["--samples"]);
    live.send_record(0);
    live.send_sample();
    std::thread::sleep(Duration::from_millis(100));
    signal(&child, Signal::SIGSTOP);
    for _ in 0..3_000 {
        live.send_record(0);
    }
    for _ in 0..100 {
        live.send_sample();
    }
    signal(&child, Signal::SIGCONT);
    std::thread::sleep(Duration::from_millis(200));
    signal(&child, Signal::SIGTERM);
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(7), "{}", said(&output));
    let (records, samples, totals) = read(&path);
    let totals = totals.unwrap();
    assert_eq!(records as u64 + totals.lost_records, 3_001);
    assert!(totals.lost_records > 1_000, "{totals:?}");
    assert_eq!(
        totals.topics[&format!("/{}/records/front", live.instance.name)].missing,
        totals.lost_records
    );
    assert_eq!(samples as u64 + totals.lost_samples, 101);
    assert!(totals.lost_samples > 0, "{totals:?}");
    let told = format!("LOST on the way from the daemon: {} records", totals.lost_records);
    assert!(said(&output).contains(&told), "{}", said(&output));
}

#[test]
fn the_end_of_the_daemon_ends_the_recording_and_without_a_daemon_there_is_none() {
    let mut live = Live::start();
    let path = live.file("end.mcap");
    let child = start(&live, &path, &[]);
    live.send_record(0);
    live.close_table();
    live.send_record(0);
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    assert!(
        said(&output).contains("the daemon has ended"),
        "{}",
        said(&output)
    );
    // What the daemon still had to send after its table was closed is there.
    assert_eq!(read(&path).0, 2);

    let again = live.file("again.mcap");
    let output = live
        .command(&["record", "-o", again.to_str().unwrap()])
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(3), "{}", said(&output));
    assert!(!again.exists());
}

#[test]
fn mistakes_are_refused_before_anything_is_written() {
    let live = Live::start();
    let path = live.file("taken.mcap");
    std::fs::write(&path, "precious").unwrap();
    for (arguments, code, phrase) in [
        (vec!["--diagnoser", "side"], 2, "it has front, rear"),
        (vec!["--duration=-1"], 2, "above 0"),
        (vec!["--duration", "0"], 2, "above 0"),
        (vec!["--duration", "nan"], 2, "above 0"),
        (vec!["--configuration", "/nowhere.toml"], 2, "No such file"),
        (
            vec![],
            1,
            "taken.mcap`: File exists (os error 17); choose another file",
        ),
    ] {
        let output = live
            .command(&["record", "--output", path.to_str().unwrap()])
            .args(&arguments)
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(code), "{}", said(&output));
        assert!(said(&output).contains(phrase), "{}", said(&output));
        assert!(!said(&output).contains("recording to"), "{}", said(&output));
    }
    assert_eq!(std::fs::read(&path).unwrap(), b"precious");
}
