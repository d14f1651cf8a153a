//! Where a listener begins, what names its events carry, and what it says about other lives.

use std::fs;
use std::os::unix::fs::FileExt;
use std::time::Duration;

use residual_client::{
    Alarm, AlarmEvent, AlarmListener, AlarmNumber, AlarmStart, ChannelSpec, DaemonState, OpenError,
};
use residual_shared::bounds_table::TableWriter;
use residual_shared::bounds_table::layout::{ALARM_WORDS, alarm_ring, header};

use super::support::{daemon, instance, spec, transition};

const LIMIT: Duration = Duration::from_secs(20);

/// The next event, which must be a transition.
fn alarm(listener: &mut AlarmListener) -> Alarm {
    match listener.wait(LIMIT) {
        Some(AlarmEvent::Transition(alarm)) => alarm,
        other => panic!("{other:?}"),
    }
}

fn raise(daemon: &mut TableWriter, steps: std::ops::RangeInclusive<u64>) {
    steps.for_each(|step| _ = daemon.raise(&transition(0, step)));
}

#[test]
fn an_alarm_carries_the_names_of_the_table_that_holds_it() {
    let (_directory, instance) = instance();
    let mut daemon = daemon(&instance, &spec(&["a", "b"], 16));
    let mut listener = AlarmListener::open(&instance, AlarmStart::Now).unwrap();
    let number = daemon.raise(&transition(1, 7));
    let alarm = alarm(&mut listener);
    assert_eq!(alarm.transition.number, number);
    assert_eq!(alarm.diagnoser_name(), Some("b"));
    let channel = ChannelSpec {
        name: "χ²".into(),
        unit: String::new(),
    };
    assert_eq!(alarm.channel(), Some(&channel));
    assert_eq!(alarm.certainly_faulty().collect::<Vec<_>>(), ["sensor 1"]);
    assert_eq!(
        alarm.possibly_faulty().collect::<Vec<_>>(),
        ["sensor 1", "sensor 2"]
    );
    assert_eq!(listener.position(), Some(number));
    assert_eq!(listener.try_next(), None);
}

#[test]
fn names_that_no_diagnoser_has_are_none() {
    let (_directory, instance) = instance();
    let mut daemon = daemon(&instance, &spec(&["a"], 16));
    let mut listener = AlarmListener::open(&instance, AlarmStart::Oldest).unwrap();
    let mut foreign = transition(0, 1);
    (foreign.channel, foreign.certainly_faulty) = (2, u64::MAX << 3);
    daemon.raise(&foreign);
    foreign.slot = 1;
    daemon.raise(&foreign);
    let known = alarm(&mut listener);
    assert_eq!((known.diagnoser_name(), known.channel()), (Some("a"), None));
    assert_eq!(known.certainly_faulty().count(), 0);
    let unknown = alarm(&mut listener);
    assert_eq!((unknown.diagnoser_name(), unknown.channel()), (None, None));
}

#[test]
fn now_oldest_and_after_begin_where_they_say() {
    let (_directory, instance) = instance();
    let mut daemon = daemon(&instance, &spec(&["a"], 16));
    raise(&mut daemon, 1..=20);
    let after = |number| {
        AlarmStart::After(AlarmNumber {
            epoch: daemon.epoch(),
            number,
        })
    };
    let starts = [
        AlarmStart::Now,
        AlarmStart::Oldest,
        after(18),
        after(20),
        after(0),
    ];
    let mut listeners = starts.map(|start| AlarmListener::open(&instance, start).unwrap());
    raise(&mut daemon, 21..=21);
    let [now, oldest, after_18, after_20, after_0] = &mut listeners;
    assert_eq!(alarm(now).transition.step, 21);
    // Number 5 was the oldest one when the listener began, and has been overwritten since then.
    assert_eq!(oldest.try_next(), Some(AlarmEvent::Gap { first: 5, last: 5 }));
    assert_eq!(alarm(oldest).transition.step, 6);
    assert_eq!(alarm(after_18).transition.step, 19);
    assert_eq!(alarm(after_20).transition.step, 21);
    assert_eq!(after_0.try_next(), Some(AlarmEvent::Gap { first: 1, last: 5 }));
}

#[test]
fn without_a_daemon_open_fails_and_connect_hears_the_first_transition() {
    let (_directory, instance) = instance();
    assert!(matches!(
        AlarmListener::open(&instance, AlarmStart::Now),
        Err(OpenError::NotFound { .. })
    ));
    let mut listener = AlarmListener::connect(&instance, AlarmStart::Now);
    assert_eq!((listener.position(), listener.try_next()), (None, None));
    assert!(matches!(listener.state(), DaemonState::Unreachable(_)));
    let mut daemon = daemon(&instance, &spec(&["a"], 16));
    raise(&mut daemon, 1..=1);
    assert_eq!(alarm(&mut listener).transition.step, 1);
    assert!(matches!(listener.state(), DaemonState::Running));
}

#[test]
fn a_new_life_is_heard_with_its_epoch_and_its_places_of_the_diagnosers() {
    let (_directory, instance) = instance();
    let mut first = daemon(&instance, &spec(&["a", "b"], 16));
    raise(&mut first, 1..=1);
    let mut listener = AlarmListener::open(&instance, AlarmStart::Oldest).unwrap();
    raise(&mut first, 2..=2);
    std::mem::forget(first); // killed
    let mut second = daemon(&instance, &spec(&["c", "b", "a"], 16));
    second.raise(&transition(1, 3));
    let heard = [(); 3].map(|()| alarm(&mut listener));
    let names: Vec<_> = heard.iter().map(Alarm::diagnoser_name).collect();
    assert_eq!(names, [Some("a"), Some("a"), Some("b")]);
    let epochs = heard.map(|alarm| alarm.transition.number.epoch);
    assert_eq!(epochs[0], epochs[1]);
    assert_eq!(epochs[2], second.epoch());
}

#[test]
fn transitions_of_a_diagnoser_that_is_gone_have_no_name_after_a_restart() {
    let (_directory, instance) = instance();
    let mut first = daemon(&instance, &spec(&["a"], 16));
    raise(&mut first, 1..=1);
    drop(first);
    let _second = daemon(&instance, &spec(&["b"], 16));
    let mut listener = AlarmListener::open(&instance, AlarmStart::Oldest).unwrap();
    assert_eq!(alarm(&mut listener).diagnoser_name(), None);
}

#[test]
fn numbers_that_began_anew_are_said_once_with_the_last_known_one() {
    let (_directory, instance) = instance();
    let mut first = daemon(&instance, &spec(&["a"], 16));
    raise(&mut first, 1..=3);
    let mut listener = AlarmListener::open(&instance, AlarmStart::Oldest).unwrap();
    let seen = [(); 3].map(|()| alarm(&mut listener));
    let previous = seen[2].transition.number;
    drop(first);
    fs::remove_file(instance.bounds_path()).unwrap();
    let mut second = daemon(&instance, &spec(&["a"], 16));
    raise(&mut second, 1..=18);
    let origin = second.epoch();
    let new_numbering = Some(AlarmEvent::NewNumbering { previous, origin });
    // The same for a client that was started again in between; its position stays the old one until it is told.
    let mut resumed = AlarmListener::open(&instance, AlarmStart::After(previous)).unwrap();
    assert_eq!(resumed.position(), Some(previous));
    for listener in [&mut listener, &mut resumed] {
        assert_eq!(listener.wait(LIMIT), new_numbering);
        assert_eq!(
            listener.position(),
            Some(AlarmNumber {
                epoch: origin,
                number: 0
            })
        );
        assert_eq!(listener.try_next(), Some(AlarmEvent::Gap { first: 1, last: 2 }));
        assert_eq!(alarm(listener).transition.number.number, 3);
    }
}

#[test]
fn positions_that_no_daemon_gave_are_of_another_numbering() {
    let (_directory, instance) = instance();
    let mut daemon = daemon(&instance, &spec(&["a"], 16));
    raise(&mut daemon, 1..=3);
    let epoch = daemon.epoch();
    for (epoch, number) in [
        (epoch, 4),
        (epoch - 1, 1),
        (epoch + 1, 1),
        (0, 0),
        (u64::MAX, u64::MAX),
    ] {
        let previous = AlarmNumber { epoch, number };
        let mut listener = AlarmListener::open(&instance, AlarmStart::After(previous)).unwrap();
        let event = listener.try_next();
        assert!(
            matches!(event, Some(AlarmEvent::NewNumbering { previous: p, .. }) if p == previous),
            "{event:?}"
        );
        assert_eq!(alarm(&mut listener).transition.step, 1);
    }
}

#[test]
fn now_begins_behind_a_newest_transition_that_cannot_be_read() {
    let (_directory, instance) = instance();
    let mut daemon = daemon(&instance, &spec(&["a"], 16));
    raise(&mut daemon, 1..=3);
    // As if the third one was being overwritten.
    let path = instance.bounds_path();
    let file = fs::OpenOptions::new().read(true).write(true).open(path).unwrap();
    let mut offset = [0; 8];
    file.read_exact_at(&mut offset, 8 * header::ALARM_RING as u64)
        .unwrap();
    let third = u64::from_ne_bytes(offset) + 8 * (alarm_ring::ENTRIES + 2 * ALARM_WORDS) as u64;
    file.write_all_at(&[0; 8], third).unwrap();
    let mut listener = AlarmListener::open(&instance, AlarmStart::Now).unwrap();
    assert_eq!(listener.try_next(), None);
    raise(&mut daemon, 4..=4);
    assert_eq!(alarm(&mut listener).transition.step, 4);
}
