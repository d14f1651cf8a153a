//! How long a listener waits, and what it costs.

use std::thread;
use std::time::{Duration, Instant};

use residual_client::{AlarmEvent, AlarmListener, AlarmStart};

use super::support::{daemon, instance, spec, transition};

#[test]
fn a_wait_without_news_takes_its_timeout() {
    let (_directory, instance) = instance();
    let writer = daemon(&instance, &spec(&["a"], 16));
    let mut with_daemon = AlarmListener::open(&instance, AlarmStart::Now).unwrap();
    let (_other, nowhere) = super::support::instance();
    let mut without_daemon = AlarmListener::connect(&nowhere, AlarmStart::Now);
    let mut waits = |timeout_ms, spin_ms| {
        let (timeout, spin) = (Duration::from_millis(timeout_ms), Duration::from_millis(spin_ms));
        for listener in [&mut with_daemon, &mut without_daemon] {
            let begin = Instant::now();
            assert_eq!(listener.wait_spin_then_sleep(spin, timeout), None);
            let took = begin.elapsed();
            assert!(took >= timeout, "{took:?} of {timeout:?}");
            assert!(took < timeout + Duration::from_secs(2), "{took:?} of {timeout:?}");
        }
    };
    for timeout_ms in [0, 1, 30, 250] {
        waits(timeout_ms, 0);
    }
    waits(20, 5);
    waits(5, 20);
    drop(writer);
    waits(50, 0);
}

#[test]
fn a_sleeping_and_a_spinning_listener_hear_a_later_transition() {
    let (_directory, instance) = instance();
    let mut writer = daemon(&instance, &spec(&["a"], 16));
    let limit = Duration::from_secs(20);
    let listeners: Vec<_> = [Duration::ZERO, limit]
        .map(|spin| {
            let mut listener = AlarmListener::open(&instance, AlarmStart::Now).unwrap();
            thread::spawn(move || {
                let begin = Instant::now();
                (listener.wait_spin_then_sleep(spin, limit), begin.elapsed())
            })
        })
        .into();
    thread::sleep(Duration::from_millis(30));
    writer.raise(&transition(0, 9));
    for listener in listeners {
        let (event, took) = listener.join().unwrap();
        assert!(matches!(event, Some(AlarmEvent::Transition(alarm)) if alarm.transition.step == 9));
        assert!(took < limit / 2, "{took:?}");
    }
}

#[test]
fn a_sleeper_hears_the_next_life_of_a_daemon_that_was_killed() {
    let (_directory, instance) = instance();
    let killed = daemon(&instance, &spec(&["a"], 16));
    let mut listener = AlarmListener::open(&instance, AlarmStart::Now).unwrap();
    let sleeper = thread::spawn(move || listener.wait(Duration::from_secs(20)));
    thread::sleep(Duration::from_millis(30));
    std::mem::forget(killed);
    let mut next = daemon(&instance, &spec(&["a"], 16));
    let number = next.raise(&transition(0, 1));
    let heard = sleeper.join().unwrap();
    assert!(matches!(heard, Some(AlarmEvent::Transition(alarm)) if alarm.transition.number == number));
}
