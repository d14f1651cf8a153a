//! Inboxes, schedule and diagnosers together: the part that a live daemon and a replay share to the last bit.
//!
//! The engine has no clock and no thread. Its owner hands it samples ([`Engine::accept`], or [`RecordSink::fill`] when
//! they are about to be read, so that a turn costs what is due in it) and the time
//! ([`Engine::step_due`]); it steps what is due and hands every record and every transition of an alarm to a
//! [`RecordSink`]. After construction
//! nothing here allocates.

use hdrhistogram::Histogram;
use residual_shared::alarm::AlarmTransition;
use residual_shared::counters::{InputCounters, ScheduleCounters};
use residual_shared::record::StepRecord;
use residual_shared::sample::SampleHeader;

use super::inbox::Inbox;
use super::schedule::{Agenda, Timing};
use super::unit::{DiagnoserUnit, Unit};
use crate::lifecycle::{LifecycleState, transition};

/// Longest time that the histograms tell apart: one second.
const LONGEST_TIME_NS: u64 = 1_000_000_000;

/// Takes records and alarm transitions as they come into being.
pub trait RecordSink {
    /// Takes the record of the diagnoser in `slot`; false when a recorder's copy had to be dropped.
    fn publish(&mut self, slot: usize, record: &StepRecord) -> bool;

    /// Takes a transition of the alarm of the diagnoser in `transition.slot`, after the record that caused it.
    fn alarm(&mut self, transition: &AlarmTransition);

    /// Takes the counters of the diagnoser in `slot`, after everything else of its step; `troubled` if
    /// [`ScheduleCounters::troubles`] has risen.
    fn counted(&mut self, _slot: usize, _counters: &ScheduleCounters, _troubled: bool) {}

    /// Lets samples that wait for the input with this number come into its inbox, before a step that reads it.
    /// Whoever hands over samples with [`Engine::accept`] has none waiting.
    fn fill(&mut self, _input: usize, _inbox: &mut Inbox) {}
}

/// One input's inbox dimensions.
#[derive(Clone, Copy, Debug)]
pub struct InboxOptions {
    /// Elements of a sample.
    pub signal_count: usize,
    /// Samples kept until their sampling instant is due.
    pub buffer_samples: usize,
    /// A stamp further in the future is refused, nanoseconds.
    pub max_ahead_ns: u64,
}

/// Inboxes, schedule and diagnosers.
pub struct Engine {
    pub(super) epoch_ns: u64,
    catch_up_limit: u64,
    pub(super) inboxes: Vec<Inbox>,
    pub(super) units: Vec<Unit>,
    agenda: Agenda,
    pub(super) step_times_ns: Histogram<u64>,
    pub(super) lateness_ns: Histogram<u64>,
    /// How many engines one after the other have taken over from each other.
    pub(super) generation: u64,
}

impl Engine {
    /// An engine whose sampling instants are counted from `epoch_ns` (daemon's time).
    ///
    /// A diagnoser that is more than `catch_up_limit` instants behind skips the surplus.
    pub fn new(
        epoch_ns: u64,
        catch_up_limit: u32,
        inputs: &[InboxOptions],
        diagnosers: Vec<DiagnoserUnit>,
    ) -> Self {
        let timings: Vec<Timing> = diagnosers.iter().map(|unit| unit.timing).collect();
        let inbox =
            |input: &InboxOptions| Inbox::new(input.signal_count, input.buffer_samples, input.max_ahead_ns);
        let mut inboxes: Vec<Inbox> = inputs.iter().map(inbox).collect();
        for unit in &diagnosers {
            unit.open_roll_back_window(&mut inboxes);
        }
        Self {
            epoch_ns,
            catch_up_limit: u64::from(catch_up_limit),
            agenda: Agenda::new(epoch_ns, &timings),
            units: diagnosers
                .into_iter()
                .map(|unit| Unit::new(unit, &inboxes))
                .collect(),
            inboxes,
            step_times_ns: time_histogram(),
            lateness_ns: time_histogram(),
            generation: 0,
        }
    }

    /// Takes one sample of `input` that arrived at `now_ns`.
    pub fn accept(
        &mut self,
        input: usize,
        publisher: u128,
        header: SampleHeader,
        elements: &[f64],
        now_ns: u64,
    ) {
        self.inboxes[input].accept(publisher, header, elements, now_ns);
    }

    /// When the next step is due, nanoseconds of the daemon's time.
    pub fn next_due_ns(&self) -> Option<u64> {
        self.agenda.next_due_ns()
    }

    /// Does every step that is due at `now_ns` and hands its record to `sink`.
    ///
    /// `clock_ns` is read before and after each step: for the step times, and so that a step that waits behind
    /// others counts its wait as lateness. It decides nothing but that.
    pub fn step_due(&mut self, now_ns: u64, clock_ns: impl Fn() -> u64, sink: &mut impl RecordSink) {
        let turn_begin_ns = clock_ns();
        while let Some(slot) = self.agenda.peek(now_ns) {
            let unit = &mut self.units[slot];
            let troubles = unit.counters.troubles();
            for &input in &*unit.inputs {
                sink.fill(input, &mut self.inboxes[input]);
            }
            unit.skip_what_cannot_be_caught_up(self.epoch_ns, self.catch_up_limit, now_ns);
            let begin_ns = clock_ns();
            let waited_ns = begin_ns.saturating_sub(turn_begin_ns);
            let (lateness_ns, changes) = unit.step(&mut self.inboxes, self.epoch_ns, now_ns + waited_ns);
            let taken_ns = clock_ns().saturating_sub(begin_ns);
            // Before anything that nobody waits for.
            if !sink.publish(slot, &unit.record) {
                unit.counters.records_dropped += 1;
            }
            self.lateness_ns.saturating_record(lateness_ns);
            self.step_times_ns.saturating_record(taken_ns);
            unit.counters.max_step_ns = unit.counters.max_step_ns.max(taken_ns);
            for change in changes {
                sink.alarm(&transition(slot, &unit.record, &change));
            }
            sink.counted(slot, &unit.counters, unit.counters.troubles() > troubles);
            self.agenda
                .reschedule(unit.timing.due_ns(self.epoch_ns, unit.next_step));
        }
    }

    /// Lets samples that wait for an input come into its inbox, whether or not a step that reads it is due.
    pub fn receive(&mut self, input: usize, sink: &mut impl RecordSink) {
        if let Some(inbox) = self.inboxes.get_mut(input) {
            sink.fill(input, inbox);
        }
    }

    /// Puts every unit's next step in its place, after steps were passed over.
    pub(super) fn refill_agenda(&mut self) {
        let steps = self.units.iter().map(|unit| (unit.timing, unit.next_step));
        self.agenda.refill(self.epoch_ns, steps);
    }

    /// How often the alarm of the diagnoser in `slot` has been raised.
    pub fn occurrences(&self, slot: usize) -> Option<u64> {
        self.units.get(slot).map(|unit| unit.lifecycle.occurrences())
    }

    /// Marks the alarm of the diagnoser in `slot` as seen by somebody, which ends a latch: see
    /// [`Lifecycle::acknowledge`](crate::lifecycle::Lifecycle::acknowledge). False if there was nothing to
    /// acknowledge; `None`: there is no such slot.
    pub fn acknowledge(&mut self, slot: usize, sink: &mut impl RecordSink) -> Option<bool> {
        let unit = self.units.get_mut(slot)?;
        let change = unit.lifecycle.acknowledge();
        let transition = change.map(|change| transition(slot, &unit.record, &change));
        Some(transition.inspect(|transition| sink.alarm(transition)).is_some())
    }

    /// Returns the diagnoser in `slot` and its alarm to the state right after its construction; its next record has
    /// the flag RESET, and its time begins anew with the next sample. False: there is no such slot.
    pub fn reset(&mut self, slot: usize, sink: &mut impl RecordSink) -> bool {
        let Some(unit) = self.units.get_mut(slot) else {
            return false;
        };
        if let Some(change) = unit.lifecycle.reset() {
            sink.alarm(&transition(slot, &unit.record, &change));
        }
        unit.reset();
        true
    }

    /// Withdraws the alarms of all diagnosers, each with its slot and the transition that says so.
    pub fn withdraw_alarms(&mut self, mut take: impl FnMut(usize, AlarmTransition)) {
        for (slot, unit) in self.units.iter_mut().enumerate() {
            if let Some(change) = unit.lifecycle.withdraw() {
                take(slot, transition(slot, &unit.record, &change));
            }
        }
    }

    /// Where the alarm of the diagnoser in `slot` stands.
    pub fn alarm(&self, slot: usize) -> Option<LifecycleState> {
        self.units.get(slot).map(|unit| unit.lifecycle.save())
    }

    /// Lets the alarm of the diagnoser in `slot` go on from `state`.
    pub fn restore_alarm(&mut self, slot: usize, state: &LifecycleState) {
        if let Some(unit) = self.units.get_mut(slot) {
            unit.lifecycle.restore(state);
        }
    }

    /// The latest record of each diagnoser that has done a step since its start or its last reset, with its slot.
    pub fn latest_records(&self) -> impl Iterator<Item = (usize, &StepRecord)> {
        let units = self.units.iter().enumerate();
        units
            .filter(|(_, unit)| unit.has_record)
            .map(|(slot, unit)| (slot, &unit.record))
    }

    /// The door counters of each input.
    pub fn input_counters(&self) -> impl Iterator<Item = &InputCounters> {
        self.inboxes.iter().map(Inbox::counters)
    }

    /// The schedule counters of each diagnoser.
    pub fn schedule_counters(&self) -> impl Iterator<Item = &ScheduleCounters> {
        self.units.iter().map(|unit| &unit.counters)
    }

    /// Distribution of the step times of all diagnosers, nanoseconds.
    pub fn step_times_ns(&self) -> &Histogram<u64> {
        &self.step_times_ns
    }

    /// Distribution of the delays of all steps behind their due times (instant + margin), nanoseconds of the daemon's
    /// time.
    pub fn lateness_ns(&self) -> &Histogram<u64> {
        &self.lateness_ns
    }
}

/// A histogram of three digits with a fixed range, so that recording never allocates.
fn time_histogram() -> Histogram<u64> {
    match Histogram::new_with_bounds(1, LONGEST_TIME_NS, 3) {
        Ok(histogram) => histogram,
        Err(error) => unreachable!("the bounds are constants within hdrhistogram's limits: {error}"),
    }
}
