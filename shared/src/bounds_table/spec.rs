//! What a table describes: the instance, its diagnosers (slots) and its inputs.

use std::collections::HashSet;

use super::layout::{FNV_START, fnv, fnv_text};
use crate::clock::DaemonTime;
use crate::record::{MAX_CHANNELS, MAX_FAULTS};

/// Longest name, method or unit, bytes.
pub const MAX_TEXT_BYTES: usize = 256;

/// Smallest alarm ring.
pub const MIN_ALARM_CAPACITY: u32 = 16;

/// Largest alarm ring: 128 MiB.
pub const MAX_ALARM_CAPACITY: u32 = 1 << 20;

/// What the daemon knows when it creates a table.
#[derive(Clone, Debug, PartialEq)]
pub struct TableSpec {
    /// Name of the instance.
    pub instance: String,
    /// One slot a diagnoser; names are unique.
    pub slots: Vec<SlotSpec>,
    /// One entry an input; names are unique.
    pub inputs: Vec<InputSpec>,
    /// The time in which samples, sampling instants and records are stamped.
    pub time: DaemonTime,
    /// Origin of the grid of sampling instants, nanoseconds of the daemon's time.
    pub schedule_epoch_ns: u64,
    /// A record older than this many periods of its diagnoser (and the margin) is stale; at least 1.
    pub stale_after_periods: u32,
    /// How many alarm transitions the ring holds before it overwrites the oldest: a power of two from
    /// [`MIN_ALARM_CAPACITY`] to [`MAX_ALARM_CAPACITY`].
    pub alarm_capacity: u32,
}

/// One diagnoser.
#[derive(Clone, Debug, PartialEq)]
pub struct SlotSpec {
    /// Name of the diagnoser.
    pub name: String,
    /// Its method.
    pub method: String,
    /// Period, nanoseconds, above 0.
    pub period_ns: u64,
    /// Phase, nanoseconds: sampling instants lie at epoch + phase + k · period.
    pub phase_ns: u64,
    /// The step for an instant is due this much later (transport allowance), nanoseconds.
    pub margin_ns: u64,
    /// Channels of its records, at most [`MAX_CHANNELS`].
    pub channels: Vec<ChannelSpec>,
    /// Names of its faults, at most [`MAX_FAULTS`]; bit j of a fault set is fault j.
    pub faults: Vec<String>,
}

impl SlotSpec {
    /// Tells diagnosers of several lives of the daemon apart: a hash of the name, the channels and the faults.
    /// Fault sets and channel numbers of two diagnosers with the same identity mean the same.
    pub fn identity(&self) -> u64 {
        let channels = self.channels.iter().map(|channel| channel.name.as_str());
        let faults = self.faults.iter().map(String::as_str);
        let counts = [self.channels.len() as u64, self.faults.len() as u64];
        let hash = fnv_text(fnv(FNV_START, &counts), &self.name);
        channels.chain(faults).fold(hash, fnv_text)
    }
}

/// One channel of a diagnoser.
#[derive(Clone, Debug, PartialEq)]
pub struct ChannelSpec {
    /// Name of the channel.
    pub name: String,
    /// Unit of its residual and bounds; empty for a number without unit.
    pub unit: String,
}

/// One input.
#[derive(Clone, Debug, PartialEq)]
pub struct InputSpec {
    /// Name of the input.
    pub name: String,
    /// Names of the elements of its samples.
    pub signals: Vec<String>,
}

/// All that a table says about itself: what its daemon was configured to, and which life of it wrote it.
#[derive(Clone, Debug, PartialEq)]
pub struct Directory {
    /// What the daemon was configured to.
    pub spec: TableSpec,
    /// Number of this life of the daemon, larger than that of every earlier one.
    pub epoch: u64,
    /// Id of the machine's boot; 0 when the system does not tell.
    pub boot_id: u128,
    /// Process id of the daemon.
    pub pid: u32,
    /// Number of the life of the daemon that wrote the first alarm transition of the present numbering.
    pub alarm_origin: u64,
}

impl Directory {
    /// Index of the slot of the diagnoser `name`.
    pub fn slot_of(&self, name: &str) -> Option<usize> {
        self.spec.slots.iter().position(|slot| slot.name == name)
    }
}

/// Why a table cannot be made from a specification.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SpecError {
    /// A diagnoser or input has no name.
    #[error("{kind} {index} has no name")]
    Unnamed {
        /// `diagnoser` or `input`.
        kind: &'static str,
        /// Its index, from 0.
        index: usize,
    },
    /// Two diagnosers, or two inputs, have the same name.
    #[error("there are two {kind}s `{name}`; clients find them by their names, give each its own")]
    Duplicate {
        /// `diagnoser` or `input`.
        kind: &'static str,
        /// The name.
        name: String,
    },
    /// A name, method or unit is too long or holds a zero byte.
    #[error(
        "`{text:.60}` has {} bytes; a name, method or unit has at most {MAX_TEXT_BYTES} and no zero byte",
        text.len()
    )]
    Text {
        /// The text.
        text: String,
    },
    /// The period is 0.
    #[error("diagnoser `{diagnoser}` has the period 0")]
    Period {
        /// Name of the diagnoser.
        diagnoser: String,
    },
    /// More channels or faults than a record has room for.
    #[error("diagnoser `{diagnoser}` has {count} {what}; a record has room for {limit}")]
    TooMany {
        /// Name of the diagnoser.
        diagnoser: String,
        /// `channels` or `faults`.
        what: &'static str,
        /// How many it has.
        count: usize,
        /// How many there may be.
        limit: usize,
    },
    /// The speed of the daemon's time is not a positive finite number.
    #[error("the speed {0} of the daemon's time is not a positive number")]
    Speed(f64),
    /// Records would be stale at once.
    #[error("stale_after_periods is 0, which makes every record stale; use at least 1")]
    StaleAfter,
    /// The alarm ring has an impossible size.
    #[error(
        "an alarm ring of {0} transitions is not possible; use a power of two from {MIN_ALARM_CAPACITY} to \
             {MAX_ALARM_CAPACITY}"
    )]
    AlarmCapacity(u32),
    /// Offsets of texts have 32 bits.
    #[error("the names of all diagnosers and inputs need {0} bytes; a table has room for 4 GiB")]
    TooLarge(usize),
}

impl TableSpec {
    /// Checks all that [`SpecError`] names, but for the total size.
    pub(super) fn check(&self) -> Result<(), SpecError> {
        unique("diagnoser", self.slots.iter().map(|slot| slot.name.as_str()))?;
        unique("input", self.inputs.iter().map(|input| input.name.as_str()))?;
        self.slots.iter().try_for_each(SlotSpec::check)?;
        if !(self.time.speed.is_finite() && self.time.speed > 0.0) {
            return Err(SpecError::Speed(self.time.speed));
        }
        if self.stale_after_periods == 0 {
            return Err(SpecError::StaleAfter);
        }
        let capacities = MIN_ALARM_CAPACITY..=MAX_ALARM_CAPACITY;
        if !(self.alarm_capacity.is_power_of_two() && capacities.contains(&self.alarm_capacity)) {
            return Err(SpecError::AlarmCapacity(self.alarm_capacity));
        }
        Ok(())
    }
}

impl SlotSpec {
    fn check(&self) -> Result<(), SpecError> {
        if self.period_ns == 0 {
            return Err(SpecError::Period {
                diagnoser: self.name.clone(),
            });
        }
        let within = |what, count, limit| {
            if count <= limit {
                return Ok(());
            }
            Err(SpecError::TooMany {
                diagnoser: self.name.clone(),
                what,
                count,
                limit,
            })
        };
        within("channels", self.channels.len(), MAX_CHANNELS)?;
        within("faults", self.faults.len(), MAX_FAULTS)
    }
}

fn unique<'a>(kind: &'static str, names: impl Iterator<Item = &'a str>) -> Result<(), SpecError> {
    let mut seen = HashSet::new();
    for (index, name) in names.enumerate() {
        if name.is_empty() {
            return Err(SpecError::Unnamed { kind, index });
        }
        if !seen.insert(name) {
            return Err(SpecError::Duplicate {
                kind,
                name: name.into(),
            });
        }
    }
    Ok(())
}
