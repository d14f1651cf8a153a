//! Against a model: random bursts, ends, kills, lost files and a slow reader.
//!
//! The model knows of each life which numbers its ring holds, so that it knows every event before it comes.

use std::collections::VecDeque;
use std::fs;
use std::sync::Barrier;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use proptest::prelude::*;
use residual_client::{AlarmEvent, AlarmListener, AlarmStart, Instance, RETRY_PERIOD_NS};
use residual_shared::bounds_table::TableWriter;

use super::support::{daemon, instance, spec, transition};

#[derive(Clone, Debug)]
enum Action {
    /// The daemon writes so many transitions.
    Burst(u64),
    /// The reader takes up to so many events.
    Read(u32),
    /// A new life, with a ring of 16 · 2^n; the old one ends in good order or is killed.
    Restart { ring: u32, killed: bool },
    /// A new life whose table finds none to go on from.
    BeginAnew,
}

fn action() -> impl Strategy<Value = Action> {
    prop_oneof![
        4 => (1_u64..100).prop_map(Action::Burst),
        4 => (1_u32..60).prop_map(Action::Read),
        2 => (0_u32..3, any::<bool>()).prop_map(|(ring, killed)| Action::Restart { ring, killed }),
        1 => Just(Action::BeginAnew),
    ]
}

/// What the ring of one life holds.
#[derive(Clone, Copy)]
struct Life {
    origin: u64,
    capacity: u64,
    /// Numbers `oldest..=newest`.
    oldest: u64,
    newest: u64,
}

impl Life {
    /// The life with the table of `writer`; `before` is the one whose numbers it goes on with.
    fn new(writer: &TableWriter, ring: u32, before: Option<Self>) -> Self {
        let epoch = writer.epoch();
        let start = before.unwrap_or(Self {
            origin: epoch,
            capacity: 0,
            oldest: 1,
            newest: 0,
        });
        Self {
            capacity: 16 << ring,
            ..start
        }
        .cut()
    }

    fn cut(self) -> Self {
        let oldest = self.oldest.max((self.newest + 1).saturating_sub(self.capacity));
        Self { oldest, ..self }
    }
}

/// An event as the model knows it.
#[derive(Debug, PartialEq)]
enum Expected {
    Transition(u64),
    Gap(u64, u64),
    NewNumbering(u64, u64),
}

impl Expected {
    fn of(event: &AlarmEvent) -> Self {
        match event {
            AlarmEvent::Transition(alarm) => {
                assert_eq!(alarm.transition.step, alarm.transition.number.number);
                Self::Transition(alarm.transition.step)
            }
            AlarmEvent::Gap { first, last } => Self::Gap(*first, *last),
            AlarmEvent::NewNumbering { previous, origin } => Self::NewNumbering(previous.number, *origin),
        }
    }
}

/// The reader: which life it reads, how far it is, and what it has found but not handed out.
struct Reader {
    life: usize,
    position: u64,
    pending: VecDeque<Expected>,
}

impl Reader {
    fn next(&mut self, lives: &[Life]) -> Option<Expected> {
        if let Some(event) = self.pending.pop_front() {
            return Some(event);
        }
        let life = lives[self.life];
        let first = self.position + 1;
        if first < life.oldest {
            self.position = life.oldest;
            self.pending.push_back(Expected::Transition(life.oldest));
            return Some(Expected::Gap(first, life.oldest - 1));
        }
        if first <= life.newest {
            self.position = first;
            return Some(Expected::Transition(first));
        }
        if self.life + 1 == lives.len() {
            return None;
        }
        self.life = lives.len() - 1;
        let origin = lives[self.life].origin;
        if origin == life.origin {
            return self.next(lives);
        }
        Some(Expected::NewNumbering(std::mem::take(&mut self.position), origin))
    }
}

fn check(actions: &[Action]) {
    let (_directory, instance) = instance();
    let mut writer = daemon(&instance, &spec(&["a"], 16));
    let mut listener = AlarmListener::open(&instance, AlarmStart::Oldest).unwrap();
    let mut lives = vec![Life::new(&writer, 0, None)];
    let mut reader = Reader {
        life: 0,
        position: 0,
        pending: VecDeque::new(),
    };
    for action in actions.iter().chain([&Action::Read(u32::MAX)]) {
        let life = *lives.last().unwrap();
        match *action {
            Action::Burst(count) => {
                let newest = life.newest + count;
                (life.newest + 1..=newest).for_each(|step| _ = writer.raise(&transition(0, step)));
                *lives.last_mut().unwrap() = Life { newest, ..life }.cut();
            }
            Action::Restart { ring, killed } => {
                if killed {
                    std::mem::forget(writer);
                } else {
                    drop(writer);
                }
                writer = daemon(&instance, &spec(&["a"], 16 << ring));
                lives.push(Life::new(&writer, ring, Some(life)));
            }
            Action::BeginAnew => {
                drop(writer);
                fs::remove_file(instance.bounds_path()).unwrap();
                writer = daemon(&instance, &spec(&["a"], 16));
                lives.push(Life::new(&writer, 0, None));
            }
            Action::Read(count) => {
                for _ in 0..count {
                    let Some(expected) = reader.next(&lives) else {
                        // Long enough to enter a later life, as the model has done.
                        let retry = Duration::from_nanos(RETRY_PERIOD_NS);
                        assert_eq!(listener.wait(retry + Duration::from_millis(5)), None);
                        break;
                    };
                    // Looking for a new life may wait for the retry period.
                    let event = listener.wait(Duration::from_secs(20)).unwrap();
                    assert_eq!(Expected::of(&event), expected);
                }
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 40, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn every_event_is_the_one_that_the_model_expects(actions in proptest::collection::vec(action(), 1..25)) {
        check(&actions);
    }
}

/// Reads until `finished` and nothing is left; all numbers from 1 on, each once, transitions and gaps.
fn read_all(instance: &Instance, finished: &AtomicBool, begun: &Barrier, pause: Duration) -> (u64, u64) {
    let mut listener = AlarmListener::connect(instance, AlarmStart::Oldest);
    assert_eq!(listener.wait(Duration::ZERO), None);
    begun.wait();
    let (mut next, mut missing) = (1, 0);
    loop {
        let was_finished = finished.load(Ordering::SeqCst);
        match listener.wait(Duration::from_millis(150)) {
            Some(AlarmEvent::Transition(alarm)) => {
                assert_eq!(
                    (alarm.transition.number.number, alarm.transition.step),
                    (next, next)
                );
                next += 1;
            }
            Some(AlarmEvent::Gap { first, last }) => {
                assert!(first == next && last >= first);
                missing += last - first + 1;
                next = last + 1;
            }
            Some(other) => panic!("{other:?}"),
            None if was_finished => return (next - 1, missing),
            None => {}
        }
        if next % 16 == 0 {
            thread::sleep(pause);
        }
    }
}

#[test]
fn fast_and_slow_readers_account_for_every_number_while_the_daemon_writes_and_restarts() {
    let (_directory, instance) = instance();
    let finished = AtomicBool::new(false);
    let pauses = [0, 1, 20].map(Duration::from_millis);
    // A reader that begins later would rightly begin with the oldest number that is left.
    let begun = Barrier::new(pauses.len() + 1);
    let (total, read) = thread::scope(|scope| {
        let mut writer = daemon(&instance, &spec(&["a"], 64));
        let readers = pauses.map(|pause| {
            scope.spawn({
                let (instance, finished, begun) = (&instance, &finished, &begun);
                move || read_all(instance, finished, begun, pause)
            })
        });
        begun.wait();
        let mut total = 0;
        for life in 0..8 {
            for burst in [3, 200, 1, 40, 1000] {
                for _ in 0..burst {
                    total += 1;
                    writer.raise(&transition(0, total));
                }
                thread::sleep(Duration::from_millis(3));
            }
            if life % 2 == 0 {
                std::mem::forget(writer);
            } else {
                drop(writer);
            }
            writer = daemon(&instance, &spec(&["a"], 64));
        }
        finished.store(true, Ordering::SeqCst);
        (total, readers.map(|reader| reader.join().unwrap()))
    });
    for (read_total, missing) in read {
        assert_eq!(read_total, total);
        assert!(missing < total);
    }
    let [_, _, (_, missing_of_slowest)] = read;
    assert!(
        missing_of_slowest > 0,
        "the slow reader was not slow enough to lose anything"
    );
}
