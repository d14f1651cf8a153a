//! All that a diagnoser remembers from one fusion instant to the next.

use super::{inputs::InputHistory, packet_store::PacketStore, settings::Settings, state::Posterior};
use serde::{Deserialize, Serialize};

/// What was noticed about packets and steps since the start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Counters {
    /// Packets with an entry that is not finite, of the wrong length or of an unknown source: rejected.
    pub non_finite: u64,
    /// Packets from before the roll-back window: dropped.
    pub too_old: u64,
    /// Packets that were there already: dropped.
    pub duplicate: u64,
    /// Packets stamped too far in the future: rejected.
    pub ahead: u64,
    /// Packets for which there was no room: dropped.
    pub overflow: u64,
    /// Packets of earlier intervals that were used by going back to them.
    pub late_used: u64,
    /// Samples left out because S had no factor (counted whenever an interval is filtered).
    pub update_rejected: u64,
    /// Intervals after which no mode had a finite likelihood.
    pub likelihood_lost: u64,
    /// Intervals whose samples were left out because the result was not finite.
    pub interval_rejected: u64,
}

/// The state of a diagnoser.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Memory {
    /// Whether there was a first instant.
    pub started: bool,
    /// k, the number of the latest fusion instant; t_0 is number 0.
    pub step: u64,
    /// Posteriors after the instants k - 1 - W … k, number j at j mod (W + 2).
    pub ring: Vec<Posterior>,
    /// Packets of the intervals k - W … k and of the future.
    pub samples: PacketStore,
    pub commands: InputHistory,
    /// The oldest interval that received a packet after it was filtered; `u64::MAX` if none.
    pub rerun_from: u64,
    pub counters: Counters,
}

impl Memory {
    pub fn new(prior: &Posterior, settings: &Settings, sensors: usize, widest: usize) -> Self {
        let per_source = settings.packets_per_source();
        let mut memory = Self {
            started: false,
            step: 0,
            ring: vec![prior.clone(); settings.rollback_steps + 2],
            samples: PacketStore::new(per_source * sensors, widest),
            commands: InputHistory::new(&settings.initial_command, per_source),
            rerun_from: u64::MAX,
            counters: Counters::default(),
        };
        memory.clear(prior, settings);
        memory
    }

    /// Back to the state right after construction.
    pub fn clear(&mut self, prior: &Posterior, settings: &Settings) {
        self.started = false;
        self.step = 0;
        for posterior in &mut self.ring {
            posterior.copy_from(prior);
            posterior.startup_left = settings.startup_steps;
        }
        self.samples.clear();
        self.commands.clear(&settings.initial_command);
        self.rerun_from = u64::MAX;
        self.counters = Counters::default();
    }

    /// Whether a saved memory has the lengths of another.
    pub fn fits(&self, other: &Self, sensor_rows: &[usize]) -> bool {
        self.ring.len() == other.ring.len()
            && self
                .ring
                .iter()
                .zip(&other.ring)
                .all(|(one, other)| one.fits(other))
            && self.samples.fits(&other.samples, sensor_rows)
            && self.commands.fits(&other.commands)
            && self.step < 1 << 62
    }

    /// The posterior after instant `number`, which must be among the last W + 2.
    pub fn posterior(&self, number: u64) -> &Posterior {
        &self.ring[self.place(number)]
    }

    /// The posterior after instant `number` - 1 to be read, the one after `number` to be written.
    pub fn pair(&mut self, number: u64) -> (&Posterior, &mut Posterior) {
        let (before, after) = (self.place(number - 1), self.place(number));
        if before < after {
            let (low, high) = self.ring.split_at_mut(after);
            (&low[before], &mut high[0])
        } else {
            let (low, high) = self.ring.split_at_mut(before);
            (&high[0], &mut low[after])
        }
    }

    /// Where the posterior after instant `number` lies.
    pub fn place(&self, number: u64) -> usize {
        (number % self.ring.len() as u64) as usize
    }
}
