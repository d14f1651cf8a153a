//! One step of the diagnoser: packets, the intervals that they concern, the record (method sheet 4.1, 4.2).

use super::{
    AsyncImm,
    channels::{self, Instant},
    estimator::{IntervalReport, Sample},
    reception::Reception,
};
use crate::diagnoser::{Packets, StepRecord, flags};

impl AsyncImm {
    /// Receives packets at `instant_ns` and, if time has passed, fuses them.
    pub(super) fn fuse(&mut self, instant_ns: i64, packets: Packets<'_>, record: &mut StepRecord) {
        let memory = &mut self.memory;
        if !memory.started {
            memory.started = true;
            memory.ring[0].instant_ns = instant_ns.saturating_sub(self.settings.period_ns);
        }
        let step = memory.step + 1;
        let oldest = step.saturating_sub(self.settings.rollback_steps as u64).max(1);
        let window_begin = memory.posterior(oldest - 1).instant_ns;
        memory.samples.remove_until(window_begin);
        memory.commands.forget_until(window_begin);
        let reception = Reception {
            step,
            instant_ns,
            oldest,
        };
        for packet in packets.iter() {
            reception.receive(&packet, &self.sensor_rows, &self.settings, memory);
        }
        let previous_ns = memory.posterior(memory.step).instant_ns;
        let mut instant = Instant {
            starting: memory.posterior(memory.step).startup_left > 0,
            ..Instant::default()
        };
        if instant_ns > previous_ns {
            let first = memory.rerun_from.clamp(oldest, step);
            memory.rerun_from = u64::MAX;
            for number in first..=step {
                let end_ns = match number {
                    _ if number == step => instant_ns,
                    _ => self.memory.posterior(number).instant_ns,
                };
                instant = self.filter_interval(number, end_ns);
            }
            self.memory.step = step;
            self.recomputed_from = first;
        }
        self.note_inputs(previous_ns, instant_ns, record);
        let posterior = self.memory.posterior(self.memory.step);
        channels::write(posterior, instant, &self.settings, &mut self.fusion, record);
    }

    /// Filters interval `number` up to `end_ns`: the posterior before it becomes the one after it.
    fn filter_interval(&mut self, number: u64, end_ns: i64) -> Instant {
        let memory = &mut self.memory;
        let begin_ns = memory.posterior(number - 1).instant_ns;
        let mut report = self.attempt(number, end_ns, Some(begin_ns));
        let mut reinitialised = false;
        if !self.memory.posterior(number).is_sound() {
            self.memory.counters.interval_rejected += 1;
            self.attempt(number, end_ns, None);
            report.used = 0;
            reinitialised = !self.memory.posterior(number).is_sound();
        }
        let startup_steps = self.settings.startup_steps;
        let (_, posterior) = self.memory.pair(number);
        if reinitialised {
            posterior.copy_from(&self.estimator.prior);
            posterior.instant_ns = end_ns;
            posterior.startup_left = startup_steps;
        }
        let starting = reinitialised || posterior.startup_left > 0;
        posterior.startup_left = posterior.startup_left.saturating_sub(1);
        let probability = self.fusion.read_probability(posterior);
        self.settings
            .decision
            .update(&mut posterior.decision, probability);
        let counters = &mut self.memory.counters;
        counters.update_rejected = counters
            .update_rejected
            .saturating_add(u64::from(report.update_rejected));
        counters.likelihood_lost = counters
            .likelihood_lost
            .saturating_add(u64::from(report.likelihood_lost));
        Instant {
            evaluated: report.used > 0 && !report.likelihood_lost && !reinitialised,
            starting,
            reinitialised,
        }
    }

    /// One pass over an interval, with the samples after `samples_from` or without any.
    fn attempt(&mut self, number: u64, end_ns: i64, samples_from: Option<i64>) -> IntervalReport {
        let (before, after) = self.memory.pair(number);
        after.copy_from(before);
        let place = self.memory.place(number);
        let kept = match samples_from {
            Some(begin_ns) => self.memory.samples.between(begin_ns, end_ns),
            None => &[],
        };
        let samples = kept.iter().map(|packet| Sample {
            time_ns: packet.time_ns,
            sensor: packet.source,
            values: packet.values(),
            held_before: None,
        });
        let posterior = &mut self.memory.ring[place];
        self.estimator
            .advance(posterior, end_ns, samples, &self.memory.commands)
    }

    /// Which sensors and commands were heard in (begin, end].
    fn note_inputs(&self, begin_ns: i64, end_ns: i64, record: &mut StepRecord) {
        let samples = self.memory.samples.between(begin_ns, end_ns);
        let mut bit = 0;
        record.inputs_valid = 0;
        let mut note = |rows: usize, heard: bool| {
            for row in (bit..bit + rows).take_while(|row| heard && *row < 64) {
                record.inputs_valid |= 1 << row;
            }
            bit += rows;
        };
        let mut missing = false;
        for (sensor, &rows) in self.sensor_rows.iter().enumerate() {
            let heard = samples.iter().any(|packet| packet.source == sensor);
            note(rows, heard);
            missing |= !heard;
        }
        let commands = self.memory.commands.changes().between(begin_ns, end_ns);
        note(self.settings.initial_command.len(), !commands.is_empty());
        if missing {
            record.flags |= flags::INPUT_MISSING;
        }
    }
}
