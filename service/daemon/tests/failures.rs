//! What goes wrong around a daemon: other daemons, missing and dying publishers, bad samples, signals.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod support;

use std::time::Duration;

use nix::sys::signal::Signal;
use residual_client::{DaemonState, Freshness, Monitor, StepRecord, Verdict, flags};
use residual_shared::clock::monotonic_ns;
use residual_shared::counters::InputCounters;
use residual_shared::sample::SampleHeader;
use support::daemon::{Daemon, finish, program};
use support::helper::Helper;
use support::publisher::{Drivers, at_rest, publish_until_told_to_end};
use support::{DIAGNOSER, Stage, wait_until};

#[test]
#[ignore = "the body of a helper process"]
fn publisher_process() {
    publish_until_told_to_end();
}

/// A monitor that reads one diagnoser.
struct View {
    monitor: Monitor,
    record: StepRecord,
}

impl View {
    fn of(stage: &Stage) -> Self {
        Self {
            monitor: Monitor::connect(&stage.instance),
            record: StepRecord::new(0),
        }
    }

    fn freshness(&mut self) -> Freshness {
        self.monitor.read(DIAGNOSER, &mut self.record).unwrap().freshness
    }

    /// Waits for a fresh record that says that all is well.
    fn wait_for_nominal(&mut self) {
        wait_until("a nominal record", || {
            self.freshness() == Freshness::Fresh && self.record.verdict() == Verdict::Nominal
        });
    }
}

#[test]
fn a_second_daemon_on_an_instance_is_refused_and_told_the_first_ones_process() {
    let stage = Stage::new();
    let mut first = Daemon::start(&stage);
    let second = finish(program().arg("run").arg(stage.configuration_file()));
    assert_eq!(second.code, Some(1));
    let named = format!("already run by process {}", first.pid());
    assert!(second.messages.contains(&named), "{}", second.messages);
    assert!(first.is_alive());
    assert!(matches!(View::of(&stage).monitor.state(), DaemonState::Running));
    first.stop();
    stage.assert_only_table_and_lock_are_left();
}

#[test]
fn without_a_publisher_the_daemon_lives_and_its_diagnoser_is_starting() {
    let stage = Stage::new();
    let daemon = Daemon::start(&stage);
    let mut view = View::of(&stage);
    wait_until("20 steps", || stage.schedule_counters().steps >= 20);
    assert_eq!(view.freshness(), Freshness::Starting);
    assert!(matches!(view.monitor.state(), DaemonState::Running));
    for input in 0..2 {
        assert_eq!(stage.input_counters(input), InputCounters::default());
    }
    let counters = stage.schedule_counters();
    assert!(counters.input_missing >= 20, "{counters:?}");
    daemon.stop();
}

#[test]
fn a_publisher_that_dies_shows_and_its_successor_is_counted() {
    let stage = Stage::new();
    let daemon = Daemon::start(&stage);
    let mut view = View::of(&stage);
    let first = Helper::start(&stage, "publisher_process");
    view.wait_for_nominal();
    first.kill();
    // Without any command the sets grow beyond all bounds after a while: there is no guarantee any more.
    wait_until("a record without inputs", || {
        view.freshness();
        let blind = [Verdict::NotEvaluated, Verdict::GuaranteeLost].contains(&view.record.verdict());
        blind && view.record.inputs_valid == 0 && view.record.flags & flags::INPUT_MISSING != 0
    });
    assert!(matches!(view.monitor.state(), DaemonState::Running));
    assert_eq!(stage.input_counters(0).publisher_changes, 0);

    let second = Helper::start(&stage, "publisher_process");
    view.wait_for_nominal();
    for input in 0..2 {
        assert_eq!(stage.input_counters(input).publisher_changes, 1, "input {input}");
    }
    second.kill();
    daemon.stop();
    // Two publishers were killed; what they left is cleared away.
    stage.assert_only_table_and_lock_are_left();
}

#[test]
fn publishers_come_and_go_without_end() {
    let stage = Stage::new();
    let daemon = Daemon::start(&stage);
    // More than may be connected at once, so that every place must be given back.
    for life in 0..6 {
        let drivers = Helper::start(&stage, "publisher_process");
        // The first one is no change.
        wait_until("samples of this publisher", || {
            let counters = stage.input_counters(0);
            counters.publisher_changes >= life && counters.accepted > 0
        });
        if life % 2 == 0 {
            drivers.kill();
        } else {
            drivers.finish();
        }
    }
    daemon.stop();
    stage.assert_only_table_and_lock_are_left();
}

#[test]
fn each_kind_of_bad_sample_has_its_own_counter_and_harms_nothing() {
    let stage = Stage::new();
    let daemon = Daemon::start(&stage);
    let mut drivers = Drivers::open(&stage.instance);
    let mut sequence = 0;
    let mut send = |advance: u64, stamp_ns: u64, elements: &[f64]| {
        sequence += advance;
        let header = SampleHeader {
            sequence,
            timestamp_ns: stamp_ns,
        };
        drivers.sensors.send_with_header(header, elements).unwrap();
    };
    let good = at_rest(0);
    let start_ns = monotonic_ns();
    let later = |milliseconds: u64| start_ns + milliseconds * 1_000_000;
    send(1, later(1), &good);
    send(0, later(2), &good); // duplicate
    send(1, later(3), &[0.0, f64::NAN, 0.0, 0.0]);
    send(1, later(3), &[0.0, f64::INFINITY, 0.0, 0.0]);
    send(1, later(4), &good[..3]);
    send(1, later(4), &[0.0; 5]);
    send(1, later(4), &[]);
    send(1, later(1), &good); // backward
    send(1, 0, &good); // backward
    send(1, later(60_000), &good);
    send(1, u64::MAX, &good);
    send(4, later(5), &good); // three lost
    wait_until("the last sample", || stage.input_counters(0).accepted == 2);
    // Of an instant that has been stepped by then.
    wait_until("ten more steps", || monotonic_ns() > later(150));
    send(1, later(6), &good);
    let expected = InputCounters {
        accepted: 3,
        duplicate: 1,
        non_finite: 2,
        wrong_length: 3,
        backward: 2,
        too_far_ahead: 2,
        gaps: 1,
        lost: 3,
        late: 1,
        ..Default::default()
    };
    wait_until("the late sample", || stage.input_counters(0).accepted == 3);
    let counted = stage.input_counters(0);
    // On a busy machine the first samples, too, come after their instants.
    let counted = InputCounters {
        late: counted.late.min(1),
        ..counted
    };
    assert_eq!(counted, expected);
    drop(drivers);
    let summary = daemon.stop();
    let printed: u64 = summary.inputs[0].counters.iter().map(|(_, value)| value).sum();
    assert!(printed >= expected.to_words().iter().sum(), "{summary}");
}

#[test]
fn a_diagnoser_survives_bad_samples_between_good_ones() {
    let stage = Stage::new();
    let daemon = Daemon::start(&stage);
    let good = Helper::start(&stage, "publisher_process");
    let mut view = View::of(&stage);
    view.wait_for_nominal();
    let mut bad = Drivers::open(&stage.instance);
    for _ in 0..20 {
        bad.sensors.send(monotonic_ns(), &[f64::NAN; 4]).unwrap();
        bad.sensors.send(u64::MAX, &[1.0; 4]).unwrap();
        std::thread::sleep(Duration::from_millis(5));
    }
    wait_until("all bad samples", || {
        let counters = stage.input_counters(0);
        (counters.non_finite, counters.too_far_ahead) == (20, 20)
    });
    drop(bad);
    view.wait_for_nominal();
    good.finish();
    daemon.stop();
}

#[test]
fn a_stopped_daemon_is_dead_to_clients_and_fresh_when_it_goes_on() {
    let stage = Stage::new();
    let daemon = Daemon::start(&stage);
    let publisher = Helper::start(&stage, "publisher_process");
    let mut view = View::of(&stage);
    view.wait_for_nominal();
    let before = stage.schedule_counters();
    daemon.signal(Signal::SIGSTOP);
    wait_until("a dead daemon", || view.freshness() == Freshness::Dead);
    assert!(matches!(view.monitor.state(), DaemonState::Hung(_)));
    let epoch = view.monitor.table().unwrap().directory().epoch;
    daemon.signal(Signal::SIGCONT);
    view.wait_for_nominal();
    assert!(matches!(view.monitor.state(), DaemonState::Running));
    assert_eq!(view.monitor.table().unwrap().directory().epoch, epoch);
    let after = stage.schedule_counters();
    // It hung for 500 ms at least: 50 instants, of which 10 may be caught up.
    assert!(after.skipped >= before.skipped + 35, "{before:?} {after:?}");
    assert!(after.overruns > before.overruns, "{before:?} {after:?}");
    publisher.finish();
    daemon.stop();
}

#[test]
fn each_of_two_signals_stops_the_daemon_in_good_order_with_a_summary() {
    for signal in [Signal::SIGTERM, Signal::SIGINT] {
        let stage = Stage::new();
        let mut daemon = Daemon::start(&stage);
        wait_until("a step", || stage.schedule_counters().steps > 0);
        let mut view = View::of(&stage);
        assert!(matches!(view.monitor.state(), DaemonState::Running));
        daemon.signal(signal);
        assert_eq!(daemon.wait().code(), Some(0), "{signal}");
        assert!(matches!(view.monitor.state(), DaemonState::Closed), "{signal}");
        assert_eq!(view.freshness(), Freshness::Dead);
        let summary: residuald::summary::Summary = serde_json::from_str(&daemon.output()).unwrap();
        assert_eq!(summary.diagnosers[0].name, DIAGNOSER);
        assert!(summary.schedule_total("steps") > 0);
        stage.assert_only_table_and_lock_are_left();
    }
}

#[test]
fn the_summary_for_people_names_diagnoser_and_inputs() {
    let stage = Stage::new();
    let mut command = program();
    command.arg("run").arg(stage.configuration_file());
    let mut daemon = Daemon::spawn_command(&stage, &mut command);
    daemon.wait_ready();
    wait_until("a step", || stage.schedule_counters().steps > 0);
    daemon.signal(Signal::SIGTERM);
    assert_eq!(daemon.wait().code(), Some(0));
    let output = daemon.output();
    for line in [
        "diagnoser aircraft_actuators: steps ",
        "input aircraft_sensors:",
        "step time: p50",
    ] {
        assert!(output.contains(line), "{output}");
    }
}

#[test]
fn a_second_sigterm_changes_nothing_and_a_second_ctrl_c_ends_the_daemon_at_once() {
    let twice = |signal| {
        let stage = Stage::new();
        let mut daemon = Daemon::start(&stage);
        daemon.signal(signal);
        std::thread::sleep(Duration::from_millis(1));
        daemon.signal(signal);
        let code = daemon.wait().code();
        assert!(matches!(code, Some(0 | 1)), "{code:?}");
        assert_eq!(daemon.output().is_empty(), code == Some(1));
        // The next daemon clears away what this one left.
        Daemon::start(&stage).stop();
        stage.assert_only_table_and_lock_are_left();
        code == Some(0)
    };
    assert!((0..3).all(|_| twice(Signal::SIGTERM)));
    // The second comes a millisecond after the first: most often before the daemon has ended.
    assert!((0..10).any(|_| !twice(Signal::SIGINT)));
}
