//! One diagnoser at its sampling instants: gathers its samples, steps it, counts.

use residual_diagnosis::diagnoser::{Diagnoser, flags};
use residual_shared::counters::ScheduleCounters;
use residual_shared::record::StepRecord;

use super::assembler::Assembler;
use super::inbox::Inbox;
use super::schedule::Timing;
use crate::configuration::SignalReference;
use crate::lifecycle::{Changes, Enabling, Lifecycle, Rules};

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
    /// When its alarm is raised and cleared.
    pub rules: Rules,
    /// Which of its channels count.
    pub enabling: Enabling,
}

impl DiagnoserUnit {
    /// Lets the inboxes of a diagnoser that goes back to late packets take them.
    pub(super) fn open_roll_back_window(&self, inboxes: &mut [Inbox]) {
        let Some(rules) = &self.diagnoser.description().packets else {
            return;
        };
        let window_ns = (rules.rollback_steps as u64).saturating_mul(self.timing.period_ns);
        for signal in self.measurements.iter().chain(&self.commands) {
            inboxes[signal.input].accept_backward(window_ns);
        }
    }
}

/// A diagnoser at work.
pub(super) struct Unit {
    pub(super) diagnoser: Box<dyn Diagnoser>,
    pub(super) timing: Timing,
    /// The inputs that it reads, each once.
    pub(super) inputs: Box<[usize]>,
    pub(super) assembler: Assembler,
    /// Whether a sample of any input has come: only then the diagnoser's own time begins, wherever its model
    /// starts from. So a replay and a daemon that waited for its sensors say the same.
    pub(super) begun: bool,
    /// Whether the diagnoser was reset from outside since its last record.
    pub(super) was_reset: bool,
    pub(super) next_step: u64,
    pub(super) record: StepRecord,
    /// Whether `record` is of a step, and not the blank one of a start or a reset.
    pub(super) has_record: bool,
    pub(super) lifecycle: Lifecycle,
    pub(super) enabling: Enabling,
    pub(super) counters: ScheduleCounters,
    /// Instants passed over since the last step.
    skipped: u64,
}

impl Unit {
    pub(super) fn new(unit: DiagnoserUnit, inboxes: &[Inbox]) -> Self {
        let description = unit.diagnoser.description();
        let channel_count = description.channels.len();
        let (measurements, commands) = (&unit.measurements, &unit.commands);
        let assembler = Assembler::new(measurements, commands, unit.command_delay_steps);
        let signals = measurements.iter().chain(commands).copied();
        let mut inputs: Vec<usize> = signals
            .chain(unit.enabling.signals())
            .map(|signal| signal.input)
            .collect();
        inputs.sort_unstable();
        inputs.dedup();
        Self {
            inputs: inputs.into(),
            assembler: match &description.packets {
                Some(rules) => assembler.with_packets(rules, measurements, commands, inboxes),
                None => assembler,
            },
            diagnoser: unit.diagnoser,
            timing: unit.timing,
            begun: false,
            was_reset: false,
            lifecycle: Lifecycle::new(unit.rules),
            enabling: unit.enabling,
            next_step: 0,
            record: StepRecord::new(channel_count),
            has_record: false,
            counters: ScheduleCounters::default(),
            skipped: 0,
        }
    }

    /// Returns to the state right after construction, but for the instants; the next record says so.
    pub(super) fn reset(&mut self) {
        self.diagnoser.reset();
        self.record = StepRecord::new(self.diagnoser.description().channels.len());
        self.has_record = false;
        self.begun = false;
        self.was_reset = true;
    }

    /// Gives up the oldest instants of a backlog that is longer than the limit, and counts them.
    pub(super) fn skip_what_cannot_be_caught_up(&mut self, epoch_ns: u64, limit: u64, now_ns: u64) {
        let behind_ns = now_ns.saturating_sub(self.timing.due_ns(epoch_ns, self.next_step));
        self.skip((behind_ns / self.timing.period_ns).saturating_sub(limit));
    }

    /// Lets `count` instants pass without a step: the diagnoser is told, and the next record says so.
    pub(super) fn skip(&mut self, count: u64) {
        for _ in 0..count {
            self.assembler.skip();
            if self.begun {
                self.diagnoser.skip(&mut self.record);
            }
        }
        self.next_step += count;
        self.counters.skipped += count;
        self.skipped += count;
    }

    /// Does the step of the next instant; gives its lateness, nanoseconds, and the changes of the alarm.
    pub(super) fn step(&mut self, inboxes: &mut [Inbox], epoch_ns: u64, now_ns: u64) -> (u64, Changes) {
        let instant_ns = self.timing.instant_ns(epoch_ns, self.next_step);
        let lateness_ns = now_ns.saturating_sub(instant_ns + self.timing.margin_ns);
        let after_ns = instant_ns.saturating_sub(self.timing.period_ns);
        let gathered = self.assembler.gather(inboxes, after_ns, instant_ns);
        let overrun = lateness_ns > self.timing.period_ns;

        let record = &mut self.record;
        record.step = self.next_step;
        record.instant_ns = instant_ns;
        record.inputs_valid = gathered.inputs_valid;
        record.skipped_instants = u32::try_from(std::mem::take(&mut self.skipped)).unwrap_or(u32::MAX);
        record.flags = [
            (record.skipped_instants > 0, flags::INSTANTS_SKIPPED),
            (overrun, flags::OVERRUN),
            (gathered.missing, flags::INPUT_MISSING),
            (gathered.late, flags::LATE_SAMPLE),
            (std::mem::take(&mut self.was_reset), flags::RESET),
        ]
        .iter()
        .filter_map(|&(set, flag)| set.then_some(flag))
        .fold(0, |flags, flag| flags | flag);
        self.begun |= gathered.inputs_valid != 0;
        if self.begun {
            self.diagnoser.step(&self.assembler.step_input(), record);
        }
        let enabled = self.enabling.enabled(|signal| {
            let sample = inboxes.get_mut(signal.input)?.newest(instant_ns)?;
            sample.get(signal.element).copied()
        });
        let changes = self.lifecycle.advance(record, enabled);

        self.has_record = true;
        self.next_step += 1;
        self.counters.steps += 1;
        self.counters.overruns += u64::from(overrun);
        self.counters.input_missing += u64::from(gathered.missing);
        self.counters.max_lateness_ns = self.counters.max_lateness_ns.max(lateness_ns);
        (lateness_ns, changes)
    }
}
