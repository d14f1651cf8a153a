//! Which packets are kept (method sheet 4.1).

use super::{memory::Memory, settings::Settings};
use crate::{
    diagnoser::{Packet, PacketSource},
    matrix::all_finite,
};

/// The fusion instant at which packets are received.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reception {
    /// k, the instant that the packets are for.
    pub step: u64,
    /// t_k.
    pub instant_ns: i64,
    /// Number of the oldest instant whose interval is still revised, k - W (at least 1).
    pub oldest: u64,
}

impl Reception {
    /// Keeps, drops or rejects one packet.
    pub fn receive(
        self,
        packet: &Packet<'_>,
        sensor_rows: &[usize],
        settings: &Settings,
        memory: &mut Memory,
    ) {
        let rows = match packet.source {
            PacketSource::Sensor(sensor) => sensor_rows.get(sensor).copied(),
            PacketSource::Commands => Some(settings.initial_command.len()).filter(|count| *count > 0),
        };
        if rows != Some(packet.values.len()) || !all_finite(packet.values) {
            memory.counters.non_finite = memory.counters.non_finite.saturating_add(1);
            return;
        }
        let time_ns = i64::try_from(packet.time_ns).unwrap_or(i64::MAX);
        if time_ns <= memory.posterior(self.oldest - 1).instant_ns {
            self.receive_old(time_ns, packet, memory);
            return;
        }
        let interval = self.interval_of(time_ns, memory);
        let (begin, end) = self.limits(interval, memory);
        let (source, store) = match packet.source {
            PacketSource::Sensor(sensor) => (sensor, &memory.samples),
            PacketSource::Commands => (0, memory.commands.changes()),
        };
        let own = || {
            store
                .between(begin, end)
                .iter()
                .filter(|kept| kept.source == source)
        };
        let (present, known) = (own().count(), own().any(|kept| kept.sequence == packet.sequence));
        if known {
            memory.counters.duplicate = memory.counters.duplicate.saturating_add(1);
            return;
        }
        if time_ns > self.instant_ns.saturating_add(settings.max_ahead_ns) {
            memory.counters.ahead = memory.counters.ahead.saturating_add(1);
            return;
        }
        let intervals = if interval.is_some() {
            1
        } else {
            settings.periods_ahead()
        };
        let room = present < settings.max_packets_per_step.saturating_mul(intervals);
        let kept = room
            && match packet.source {
                PacketSource::Sensor(_) => {
                    memory
                        .samples
                        .insert(time_ns, source, packet.sequence, packet.values)
                }
                PacketSource::Commands => memory.commands.insert(time_ns, packet.sequence, packet.values),
            };
        if !kept {
            memory.counters.overflow = memory.counters.overflow.saturating_add(1);
            return;
        }
        if let Some(interval) = interval
            && interval < self.step
        {
            memory.counters.late_used = memory.counters.late_used.saturating_add(1);
            memory.rerun_from = memory.rerun_from.min(interval);
        }
    }

    /// A packet from before the window. A sample is of no use any more; a command newer than the one in force
    /// there acts from the window's begin on.
    fn receive_old(self, time_ns: i64, packet: &Packet<'_>, memory: &mut Memory) {
        let command = packet.source == PacketSource::Commands;
        if command
            && memory
                .commands
                .insert_below(time_ns, packet.sequence, packet.values)
        {
            memory.rerun_from = memory.rerun_from.min(self.oldest);
        } else {
            memory.counters.too_old = memory.counters.too_old.saturating_add(1);
        }
    }

    /// The number of the interval that holds `time_ns`; `None` for the future.
    fn interval_of(self, time_ns: i64, memory: &Memory) -> Option<u64> {
        if time_ns > self.instant_ns.max(memory.posterior(self.step - 1).instant_ns) {
            return None;
        }
        let past = (self.oldest..self.step).find(|&number| time_ns <= memory.posterior(number).instant_ns);
        Some(past.unwrap_or(self.step))
    }

    /// (begin, end] of an interval; of everything after t_k for the future.
    fn limits(self, interval: Option<u64>, memory: &Memory) -> (i64, i64) {
        let end_of = |number: u64| {
            if number >= self.step {
                self.instant_ns
            } else {
                memory.posterior(number).instant_ns
            }
        };
        match interval {
            Some(number) => (end_of(number - 1), end_of(number)),
            None => (self.instant_ns, i64::MAX),
        }
    }
}
