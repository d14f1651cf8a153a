//! Hearing every alarm transition once, over all lives of a daemon.

use std::hint;
use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};

use residual_shared::alarm::{AlarmNumber, AlarmTransition};
use residual_shared::bounds_table::{AlarmRead, OpenError, SlotSpec, TableReader};
use residual_shared::clock::monotonic_ns;
use residual_shared::names::Instance;

use crate::alarm_event::{Alarm, AlarmEvent};
use crate::latest_table::{DaemonState, LatestTable, RETRY_PERIOD_NS};

/// Longest sleep before the listener looks whether the daemon still lives: a daemon that was killed wakes nobody.
const LONGEST_SLEEP: Duration = Duration::from_millis(100);

/// Where an [`AlarmListener`] begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AlarmStart {
    /// With the next transition that the daemon writes.
    Now,
    /// With the oldest transition that the ring still holds.
    Oldest,
    /// Behind a transition that was seen before, perhaps by an earlier run of the client.
    After(AlarmNumber),
}

/// Hears every alarm transition of one instance once, over all lives of its daemon.
///
/// # Order
/// Transitions come in the order of their numbers, which is the order in which the daemon wrote them, over all
/// diagnosers. Between two transitions with the numbers m < n there are gaps that cover m + 1 … n − 1 exactly, if
/// n ≠ m + 1. Any number of listeners hear the same; none disturbs the daemon or another listener.
///
/// # Latency
/// [`wait`](Self::wait) sleeps in the kernel and is woken by the daemon's write: the delay is that of the kernel's
/// wake-up, some 50 µs on an idle machine and more where other processes hold the processor.
/// [`wait_spin_then_sleep`](Self::wait_spin_then_sleep) sees a transition within a microsecond while it spins. A
/// sleeping listener finds the table of a new life of the daemon within 100 ms after it has appeared, and loses
/// nothing by that.
///
/// # Loss
/// The ring holds the newest transitions (`alarm_capacity`); a listener that falls further behind gets an
/// [`AlarmEvent::Gap`]. Before it goes over to the table of a new life it reads the old one to its end.
#[derive(Debug)]
pub struct AlarmListener {
    latest: LatestTable,
    /// The diagnosers of the latest table.
    diagnosers: Vec<Arc<SlotSpec>>,
    /// The table of a later life, entered when the latest one has been read to its end.
    later: Option<TableReader>,
    start: AlarmStart,
    /// The last transition that was handed out or reported missing; none before the first table was found.
    position: Option<AlarmNumber>,
    /// Handed out before anything else: a new numbering, or the transition behind a gap, read when the gap was
    /// measured.
    pending: Option<AlarmEvent>,
}

impl AlarmListener {
    /// Listens to an instance that has a table.
    ///
    /// # Errors
    /// See [`OpenError`]: above all when no daemon has run yet, or this user may not read its table.
    pub fn open(instance: &Instance, start: AlarmStart) -> Result<Self, OpenError> {
        let table = TableReader::open(&instance.bounds_path())?;
        let mut listener = Self::unknown(instance, start);
        listener.later = Some(table);
        listener.enter_later();
        Ok(listener)
    }

    /// Listens to an instance whose daemon need not have been started.
    ///
    /// If it has not, [`AlarmStart::Now`] begins with its first transition.
    pub fn connect(instance: &Instance, start: AlarmStart) -> Self {
        match Self::open(instance, start) {
            Ok(listener) => listener,
            Err(OpenError::NotFound { .. }) if start == AlarmStart::Now => {
                Self::unknown(instance, AlarmStart::Oldest)
            }
            Err(_) => Self::unknown(instance, start),
        }
    }

    fn unknown(instance: &Instance, start: AlarmStart) -> Self {
        Self {
            latest: LatestTable::unknown(instance),
            diagnosers: Vec::new(),
            later: None,
            start,
            position: None,
            pending: None,
        }
    }

    /// The last transition that was handed out or reported missing: what [`AlarmStart::After`] takes to go on from
    /// here. None until a table has been found, unless it began behind a known transition.
    pub fn position(&self) -> Option<AlarmNumber> {
        match (&self.pending, self.position, self.start) {
            (Some(AlarmEvent::NewNumbering { previous, .. }), _, _) => Some(*previous),
            (_, None, AlarmStart::After(number)) => Some(number),
            (_, position, _) => position,
        }
    }

    /// The table that is read now: the latest known one, or the one before while it is read to its end.
    pub fn table(&self) -> Option<&TableReader> {
        self.latest.table.as_ref()
    }

    /// Whether the daemon lives, as far as this listener has looked.
    pub fn state(&self) -> DaemonState<'_> {
        self.latest.state(monotonic_ns())
    }

    /// The next event if there is one; never waits.
    ///
    /// While the daemon lives and nothing is new it makes no system call but for the clock, which needs none on the
    /// usual processors, and allocates nothing. Without a living daemon it looks for one at most every
    /// [`RETRY_PERIOD_NS`].
    pub fn try_next(&mut self) -> Option<AlarmEvent> {
        loop {
            let event = self.pending.take().or_else(|| self.next_in_table());
            if let Some(event) = event {
                if let AlarmEvent::Transition(alarm) = &event {
                    self.position = Some(alarm.transition.number);
                }
                return Some(event);
            }
            if !self.enter_later() {
                // The daemon behind the latest table writes no more when there is a later one. What it wrote
                // between the look above and now is read before the later one is entered.
                self.later = Some(self.latest.find_later(monotonic_ns())?);
            }
        }
    }

    /// Waits for the next event, asleep, at most for `timeout`.
    pub fn wait(&mut self, timeout: Duration) -> Option<AlarmEvent> {
        self.wait_spin_then_sleep(Duration::ZERO, timeout)
    }

    /// Waits for the next event: looks without pause for `spin`, which takes a whole processor but sees it within a
    /// microsecond, then sleeps; at most for `timeout` altogether.
    pub fn wait_spin_then_sleep(&mut self, spin: Duration, timeout: Duration) -> Option<AlarmEvent> {
        let begin = Instant::now();
        loop {
            if let Some(event) = self.try_next() {
                return Some(event);
            }
            let elapsed = begin.elapsed();
            let left = timeout.checked_sub(elapsed).filter(|left| !left.is_zero())?;
            if elapsed < spin {
                hint::spin_loop();
            } else {
                self.sleep(left);
            }
        }
    }

    /// Sleeps until there may be something new, at most for `timeout`.
    fn sleep(&self, timeout: Duration) {
        let retry = Duration::from_nanos(RETRY_PERIOD_NS);
        match (self.table(), self.position) {
            (Some(table), Some(position)) if self.latest.is_running(monotonic_ns()) => {
                table.wait_for_alarm(position.number, timeout.min(LONGEST_SLEEP));
            }
            (Some(table), Some(position)) => table.wait_for_alarm(position.number, timeout.min(retry)),
            _ => thread::sleep(timeout.min(retry)),
        }
    }

    /// What comes next in the latest table.
    fn next_in_table(&mut self) -> Option<AlarmEvent> {
        let (Some(table), Some(position)) = (&self.latest.table, &mut self.position) else {
            return None;
        };
        let first = position.number.checked_add(1)?;
        let mut number = first;
        let behind = loop {
            match table.read_alarm(number) {
                AlarmRead::Waiting => break None,
                AlarmRead::Transition(transition) => break Some(transition),
                AlarmRead::Lost => number = number.checked_add(1)?.max(oldest_possible(table)),
            }
        };
        let behind = behind.map(|transition| AlarmEvent::Transition(named(transition, &self.diagnosers)));
        if number == first {
            return behind;
        }
        let last = number - 1;
        position.number = last;
        self.pending = behind;
        Some(AlarmEvent::Gap { first, last })
    }

    /// Goes over to the table of the later life, if there is one.
    fn enter_later(&mut self) -> bool {
        let Some(table) = self.later.take() else {
            return false;
        };
        let origin = table.directory().alarm_origin;
        let beginning = AlarmNumber {
            epoch: origin,
            number: 0,
        };
        self.position = Some(match (self.position(), self.start) {
            (Some(known), _) if continues(&table, known) => known,
            (Some(previous), _) => {
                self.pending = Some(AlarmEvent::NewNumbering { previous, origin });
                beginning
            }
            (None, AlarmStart::Now) => {
                let number = table.newest_alarm();
                // Overtaken in the moment it was read, the newest one was of this life.
                let epoch = table.directory().epoch;
                seen(&table, number).unwrap_or(AlarmNumber { epoch, number })
            }
            (None, AlarmStart::Oldest | AlarmStart::After(_)) => AlarmNumber {
                number: oldest(&table).saturating_sub(1),
                ..beginning
            },
        });
        let diagnosers = table.directory().spec.slots.iter();
        self.diagnosers = diagnosers.cloned().map(Arc::new).collect();
        self.latest.set(table);
        true
    }
}

/// The transition with the names of its diagnoser.
fn named(transition: AlarmTransition, diagnosers: &[Arc<SlotSpec>]) -> Alarm {
    let slot = usize::try_from(transition.slot).ok();
    Alarm {
        transition,
        diagnoser: slot.and_then(|slot| diagnosers.get(slot)).cloned(),
    }
}

/// The full number of a transition that the ring holds.
fn seen(table: &TableReader, number: u64) -> Option<AlarmNumber> {
    match table.read_alarm(number) {
        AlarmRead::Transition(transition) => Some(transition.number),
        AlarmRead::Waiting | AlarmRead::Lost => None,
    }
}

/// Whether the numbers of `table` go on from `position`: the life that wrote it lies between the one with which the
/// numbering began and the present one, the number has been given, and if the ring still holds the transition, that
/// life wrote it.
fn continues(table: &TableReader, position: AlarmNumber) -> bool {
    let directory = table.directory();
    (directory.alarm_origin..=directory.epoch).contains(&position.epoch)
        && position.number <= table.newest_alarm()
        && seen(table, position.number).is_none_or(|number| number.epoch == position.epoch)
}

/// Number of the oldest transition for which the ring has room.
fn oldest_possible(table: &TableReader) -> u64 {
    let capacity = u64::from(table.directory().spec.alarm_capacity);
    table.newest_alarm().saturating_sub(capacity).saturating_add(1)
}

/// Number of the oldest transition that the ring holds; of the next one if it holds none.
fn oldest(table: &TableReader) -> u64 {
    let mut number = oldest_possible(table);
    while number < u64::MAX && table.read_alarm(number) == AlarmRead::Lost {
        number = (number + 1).max(oldest_possible(table));
    }
    number
}
