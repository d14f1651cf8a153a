//! Inboxes, schedule and diagnosers together: the part that a live daemon and a replay share to the last bit.
//!
//! The engine has no clock and no thread. Its owner hands it samples ([`Engine::accept`]) and the time
//! ([`Engine::step_due`]); it steps what is due and hands every record to a [`RecordSink`]. After construction
//! nothing here allocates.

use hdrhistogram::Histogram;
use residual_diagnosis::diagnoser::{Diagnoser, flags};
use residual_shared::counters::{InputCounters, ScheduleCounters};
use residual_shared::record::StepRecord;
use residual_shared::sample::SampleHeader;

use super::assembler::Assembler;
use super::inbox::Inbox;
use super::schedule::{Agenda, Timing};
use crate::configuration::SignalReference;

/// Longest step that the step-time histogram tells apart: one second.
const LONGEST_STEP_NS: u64 = 1_000_000_000;

/// Takes the records as they come into being.
pub trait RecordSink {
    /// Takes the record of the diagnoser in `slot`; false when a recorder's copy had to be dropped.
    fn publish(&mut self, slot: usize, record: &StepRecord) -> bool;
}

/// A diagnoser with its timing and its signals.
pub struct DiagnoserUnit {
    /// The method, ready to step.
    pub diagnoser: Box<dyn Diagnoser>,
    /// When it is stepped.
    pub timing: Timing,
    /// The rows of y, in order.
    pub measurements: Vec<SignalReference>,
    /// The elements of u, in order.
    pub commands: Vec<SignalReference>,
    /// How many instants after its reception a command acts.
    pub command_delay_steps: usize,
}

impl DiagnoserUnit {
    /// Lets the inboxes of a diagnoser that goes back to late packets take them.
    fn open_roll_back_window(&self, inboxes: &mut [Inbox]) {
        let Some(rules) = &self.diagnoser.description().packets else {
            return;
        };
        let window_ns = (rules.rollback_steps as u64).saturating_mul(self.timing.period_ns);
        for signal in self.measurements.iter().chain(&self.commands) {
            inboxes[signal.input].accept_backward(window_ns);
        }
    }
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

struct Unit {
    diagnoser: Box<dyn Diagnoser>,
    timing: Timing,
    assembler: Assembler,
    /// Whether a sample of any input has come: only then the diagnoser's own time begins, wherever its model
    /// starts from. So a replay and a daemon that waited for its sensors say the same.
    begun: bool,
    /// Whether the diagnoser was reset from outside since its last record.
    reset: bool,
    next_step: u64,
    record: StepRecord,
    counters: ScheduleCounters,
}

/// Inboxes, schedule and diagnosers.
pub struct Engine {
    epoch_ns: u64,
    catch_up_limit: u64,
    inboxes: Vec<Inbox>,
    units: Vec<Unit>,
    agenda: Agenda,
    step_times_ns: Histogram<u64>,
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
            step_times_ns: step_time_histogram(),
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
            unit.skip_what_cannot_be_caught_up(self.epoch_ns, self.catch_up_limit, now_ns);
            let begin_ns = clock_ns();
            let waited_ns = begin_ns.saturating_sub(turn_begin_ns);
            unit.step(&mut self.inboxes, self.epoch_ns, now_ns + waited_ns);
            let taken_ns = clock_ns().saturating_sub(begin_ns);
            self.step_times_ns.saturating_record(taken_ns);
            unit.counters.max_step_ns = unit.counters.max_step_ns.max(taken_ns);
            if !sink.publish(slot, &unit.record) {
                unit.counters.records_dropped += 1;
            }
            self.agenda
                .reschedule(unit.timing.due_ns(self.epoch_ns, unit.next_step));
        }
    }

    /// Returns the diagnoser in `slot` to the state right after its construction; its next record has the flag
    /// RESET, and its time begins anew with the next sample. False: there is no such slot.
    pub fn reset(&mut self, slot: usize) -> bool {
        self.units.get_mut(slot).map(Unit::reset).is_some()
    }

    /// Acknowledges the alarm of the diagnoser in `slot`; whether there was one. `None`: there is no such slot.
    pub fn acknowledge(&mut self, slot: usize) -> Option<bool> {
        // No alarm outlasts its violation, so none ever waits for an acknowledgement.
        self.units.get(slot).map(|_| false)
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
}

/// A histogram of three digits with a fixed range, so that recording never allocates.
fn step_time_histogram() -> Histogram<u64> {
    match Histogram::new_with_bounds(1, LONGEST_STEP_NS, 3) {
        Ok(histogram) => histogram,
        Err(error) => unreachable!("the bounds are constants within hdrhistogram's limits: {error}"),
    }
}

impl Unit {
    fn new(unit: DiagnoserUnit, inboxes: &[Inbox]) -> Self {
        let description = unit.diagnoser.description();
        let channel_count = description.channels.len();
        let (measurements, commands) = (&unit.measurements, &unit.commands);
        let assembler = Assembler::new(measurements, commands, unit.command_delay_steps);
        Self {
            assembler: match &description.packets {
                Some(rules) => assembler.with_packets(rules, measurements, commands, inboxes),
                None => assembler,
            },
            diagnoser: unit.diagnoser,
            timing: unit.timing,
            begun: false,
            reset: false,
            next_step: 0,
            record: StepRecord::new(channel_count),
            counters: ScheduleCounters::default(),
        }
    }

    fn reset(&mut self) {
        self.diagnoser.reset();
        self.record = StepRecord::new(self.diagnoser.description().channels.len());
        self.begun = false;
        self.reset = true;
    }

    /// Gives up the oldest instants of a backlog that is longer than the limit, and counts them.
    fn skip_what_cannot_be_caught_up(&mut self, epoch_ns: u64, limit: u64, now_ns: u64) {
        let behind_ns = now_ns.saturating_sub(self.timing.due_ns(epoch_ns, self.next_step));
        let surplus = (behind_ns / self.timing.period_ns).saturating_sub(limit);
        for _ in 0..surplus {
            self.assembler.skip();
            if self.begun {
                self.diagnoser.skip(&mut self.record);
            }
        }
        self.next_step += surplus;
        self.counters.skipped += surplus;
        self.record.skipped_instants = u32::try_from(surplus).unwrap_or(u32::MAX);
    }

    fn step(&mut self, inboxes: &mut [Inbox], epoch_ns: u64, now_ns: u64) {
        let instant_ns = self.timing.instant_ns(epoch_ns, self.next_step);
        let lateness_ns = now_ns.saturating_sub(instant_ns + self.timing.margin_ns);
        let after_ns = instant_ns.saturating_sub(self.timing.period_ns);
        let gathered = self.assembler.gather(inboxes, after_ns, instant_ns);
        let overrun = lateness_ns > self.timing.period_ns;

        let record = &mut self.record;
        record.step = self.next_step;
        record.instant_ns = instant_ns;
        record.inputs_valid = gathered.inputs_valid;
        record.flags = [
            (record.skipped_instants > 0, flags::INSTANTS_SKIPPED),
            (overrun, flags::OVERRUN),
            (gathered.missing, flags::INPUT_MISSING),
            (gathered.late, flags::LATE_SAMPLE),
            (std::mem::take(&mut self.reset), flags::RESET),
        ]
        .iter()
        .filter_map(|&(set, flag)| set.then_some(flag))
        .fold(0, |flags, flag| flags | flag);
        self.begun |= gathered.inputs_valid != 0;
        if self.begun {
            self.diagnoser.step(&self.assembler.step_input(), record);
        }

        self.next_step += 1;
        self.counters.steps += 1;
        self.counters.overruns += u64::from(overrun);
        self.counters.input_missing += u64::from(gathered.missing);
        self.counters.max_lateness_ns = self.counters.max_lateness_ns.max(lateness_ns);
    }
}
