//! The event service of the alarms through real iceoryx2 memory.
#![cfg(feature = "transport")]
#![allow(clippy::unwrap_used, clippy::panic)]

mod common;

use std::io::{BufRead as _, BufReader};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use common::place::Place;
use residual_shared::alarm::AlarmState;
use residual_shared::names::Instance;
use residual_shared::transport::{self, AlarmEvents, AlarmNotifier, TransportError};

const STATES: [AlarmState; 4] = [
    AlarmState::Cleared,
    AlarmState::Pending,
    AlarmState::Raised,
    AlarmState::Isolated,
];

const NAME: &str = "RESIDUAL_TEST_INSTANCE";
const DIRECTORY: &str = "RESIDUAL_TEST_DIRECTORY";

/// All waiting events.
fn taken(events: &AlarmEvents) -> Vec<(AlarmState, u64)> {
    let mut taken = Vec::new();
    events
        .wait(Duration::ZERO, |state, count| taken.push((state, count)))
        .unwrap();
    taken
}

#[test]
fn events_come_with_state_and_count_and_a_listener_that_takes_none_holds_up_nobody() {
    let place = Place::new("e");
    let node = transport::open_node(&place.instance).unwrap();
    assert!(matches!(
        AlarmEvents::open(&node, &place.instance),
        Err(TransportError::NoService { .. })
    ));
    let notifier = AlarmNotifier::create(&node, &place.instance).unwrap();
    assert_eq!(notifier.notify(AlarmState::Raised).unwrap(), 0);
    let attentive = AlarmEvents::open(&node, &place.instance).unwrap();
    let idle = AlarmEvents::open(&node, &place.instance).unwrap();
    assert_eq!(taken(&attentive), []);
    for state in STATES {
        assert_eq!(notifier.notify(state).unwrap(), 2);
        assert_eq!(taken(&attentive), [(state, 1)]);
    }
    for _ in 0..100_000 {
        notifier.notify(AlarmState::Isolated).unwrap();
    }
    assert_eq!(taken(&attentive), [(AlarmState::Isolated, 100_000)]);
    assert_eq!(
        taken(&idle),
        STATES.map(|state| (state, if state == AlarmState::Isolated { 100_001 } else { 1 }))
    );
}

#[test]
#[ignore = "the body of a helper process"]
fn listener_process() {
    let (Ok(name), Ok(directory)) = (std::env::var(NAME), std::env::var(DIRECTORY)) else {
        return;
    };
    let instance = Instance::new(name.parse().unwrap(), directory);
    let node = transport::open_node(&instance).unwrap();
    let _events = AlarmEvents::open(&node, &instance).unwrap();
    println!("listening");
    std::thread::sleep(Duration::from_secs(60));
}

#[test]
fn more_killed_listeners_than_there_is_room_for_hold_up_neither_the_daemon_nor_the_next_listener() {
    let place = Place::new("k");
    let node = transport::open_node(&place.instance).unwrap();
    let notifier = AlarmNotifier::create(&node, &place.instance).unwrap();
    let survivor = AlarmEvents::open(&node, &place.instance).unwrap();
    for round in 0..18 {
        let mut helper = Command::new(std::env::current_exe().unwrap())
            .args(["--ignored", "--exact", "--nocapture", "listener_process"])
            .env(NAME, place.instance.name.to_string())
            .env(DIRECTORY, &place.instance.runtime_directory)
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let lines = BufReader::new(helper.stdout.take().unwrap()).lines();
        let listens = lines.map_while(Result::ok).any(|line| line.contains("listening"));
        helper.kill().unwrap();
        helper.wait().unwrap();
        assert!(listens, "round {round}");
        let begin = Instant::now();
        for _ in 0..100 {
            let _ = notifier.notify(AlarmState::Pending);
        }
        assert!(begin.elapsed() < Duration::from_secs(2), "round {round}");
        assert_eq!(taken(&survivor), [(AlarmState::Pending, 100)], "round {round}");
        // The daemon does it every few seconds.
        node.try_cleanup_dead_nodes();
    }
}

#[test]
fn a_place_without_room_for_sockets_is_told_to_the_listener() {
    let place = Place::new("much_too_long_nam");
    assert!(!place.instance.has_room_for_sockets());
    let node = transport::open_node(&place.instance).unwrap();
    let _notifier = AlarmNotifier::create(&node, &place.instance).unwrap();
    let refused = AlarmEvents::open(&node, &place.instance)
        .err()
        .unwrap()
        .to_string();
    assert!(refused.contains("shorter instance name"), "{refused}");
}
