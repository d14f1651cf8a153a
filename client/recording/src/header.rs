//! What a recording says about itself: the metadata record at its beginning.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::{SystemTime, UNIX_EPOCH};

use residual_shared::bounds_table::{ChannelSpec, Directory, InputSpec, SlotSpec};
use residual_shared::clock::{DaemonTime, monotonic_ns};
use serde::{Deserialize, Serialize};

/// Name of the metadata record.
pub(crate) const NAME: &str = "residual.recording";

/// Version of the messages and of this header.
const FORMAT: u32 = 1;

/// The daemon that is recorded, its diagnosers and inputs, and how its time relates to the wall clock.
#[derive(Clone, Debug, PartialEq)]
pub struct Header {
    /// Name of the instance.
    pub instance: String,
    /// Number of the daemon's life.
    pub epoch: u64,
    /// Its process id.
    pub pid: u32,
    /// The daemon's time.
    pub time: DaemonTime,
    /// Wall clock (since 1970) minus CLOCK_MONOTONIC at the beginning of the recording, nanoseconds.
    pub wall_clock_offset_ns: i64,
    /// Origin of the grid of sampling instants, nanoseconds of the daemon's time.
    pub schedule_epoch_ns: u64,
    /// The daemon's configuration file, if known.
    pub configuration: Option<PathBuf>,
    /// Samples that the daemon had received before the recording began: 0 if the recording holds all of them.
    pub earlier_samples: u64,
    /// The diagnosers, by slot.
    pub diagnosers: Vec<Diagnoser>,
    /// The inputs in the daemon's order.
    pub inputs: Vec<Input>,
}

/// One diagnoser.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Diagnoser {
    /// Its name.
    pub name: String,
    /// Its method.
    pub method: String,
    /// Its period, nanoseconds.
    pub period_ns: u64,
    /// Sampling instants lie at schedule epoch + phase + k · period, nanoseconds.
    pub phase_ns: u64,
    /// Its transport allowance, nanoseconds.
    pub margin_ns: u64,
    /// The channels of its records.
    pub channels: Vec<ChannelOf>,
    /// Names of its faults; bit j of a fault set is fault j.
    pub faults: Vec<String>,
}

/// One channel of a diagnoser.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ChannelOf {
    /// Its name.
    pub name: String,
    /// Its unit; empty for none.
    pub unit: String,
}

/// One input.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Input {
    /// Its name.
    pub name: String,
    /// Names of the elements of its samples.
    pub signals: Vec<String>,
}

impl Header {
    /// The header of a recording that begins now, of the daemon that `directory` describes.
    pub fn of(directory: &Directory) -> Self {
        let spec = &directory.spec;
        Self {
            instance: spec.instance.clone(),
            epoch: directory.epoch,
            pid: directory.pid,
            time: spec.time,
            wall_clock_offset_ns: wall_clock_offset_ns(),
            schedule_epoch_ns: spec.schedule_epoch_ns,
            configuration: None,
            earlier_samples: 0,
            diagnosers: spec.slots.iter().map(Diagnoser::of).collect(),
            inputs: spec.inputs.iter().map(Input::of).collect(),
        }
    }

    /// The wall clock at a moment of the daemon's time, nanoseconds since 1970.
    pub fn wall_clock_ns(&self, daemon_ns: u64) -> u64 {
        self.time
            .to_monotonic(daemon_ns)
            .saturating_add_signed(self.wall_clock_offset_ns)
    }

    /// As the texts of a metadata record.
    pub(crate) fn to_metadata(&self) -> BTreeMap<String, String> {
        let json = |list: serde_json::Result<String>| list.unwrap_or_default();
        let configuration = self.configuration.as_ref();
        let texts = [
            ("format", FORMAT.to_string()),
            (
                "library",
                concat!("residual-recording ", env!("CARGO_PKG_VERSION")).into(),
            ),
            ("instance", self.instance.clone()),
            ("epoch", self.epoch.to_string()),
            ("pid", self.pid.to_string()),
            ("time_origin_ns", self.time.origin_ns.to_string()),
            ("time_speed", self.time.speed.to_string()),
            ("wall_clock_offset_ns", self.wall_clock_offset_ns.to_string()),
            ("schedule_epoch_ns", self.schedule_epoch_ns.to_string()),
            ("earlier_samples", self.earlier_samples.to_string()),
            ("diagnosers", json(serde_json::to_string(&self.diagnosers))),
            ("inputs", json(serde_json::to_string(&self.inputs))),
        ];
        let configuration = configuration.map(|path| ("configuration", path.display().to_string()));
        let texts = texts.into_iter().chain(configuration);
        texts.map(|(key, text)| (key.to_owned(), text)).collect()
    }

    /// From the texts of a metadata record; the error is the key that is missing or has no meaning.
    pub(crate) fn from_metadata(texts: &BTreeMap<String, String>) -> Result<Self, &'static str> {
        if number::<u32>(texts, "format")? != FORMAT {
            return Err("format");
        }
        Ok(Self {
            instance: text(texts, "instance")?.to_owned(),
            epoch: number(texts, "epoch")?,
            pid: number(texts, "pid")?,
            time: DaemonTime {
                origin_ns: number(texts, "time_origin_ns")?,
                speed: number(texts, "time_speed")?,
            },
            wall_clock_offset_ns: number(texts, "wall_clock_offset_ns")?,
            schedule_epoch_ns: number(texts, "schedule_epoch_ns")?,
            configuration: texts.get("configuration").map(PathBuf::from),
            earlier_samples: number(texts, "earlier_samples")?,
            diagnosers: serde_json::from_str(text(texts, "diagnosers")?).map_err(|_| "diagnosers")?,
            inputs: serde_json::from_str(text(texts, "inputs")?).map_err(|_| "inputs")?,
        })
    }
}

impl Diagnoser {
    fn of(slot: &SlotSpec) -> Self {
        let channel = |channel: &ChannelSpec| ChannelOf {
            name: channel.name.clone(),
            unit: channel.unit.clone(),
        };
        Self {
            name: slot.name.clone(),
            method: slot.method.clone(),
            period_ns: slot.period_ns,
            phase_ns: slot.phase_ns,
            margin_ns: slot.margin_ns,
            channels: slot.channels.iter().map(channel).collect(),
            faults: slot.faults.clone(),
        }
    }

    /// The names of the channels as keys of a JSON object.
    pub fn channel_keys(&self) -> Vec<String> {
        unique_keys(self.channels.iter().map(|channel| channel.name.as_str()))
    }
}

impl Input {
    fn of(input: &InputSpec) -> Self {
        Self {
            name: input.name.clone(),
            signals: input.signals.clone(),
        }
    }

    /// The names of the signals as keys of a JSON object.
    pub fn signal_keys(&self) -> Vec<String> {
        unique_keys(self.signals.iter().map(String::as_str))
    }
}

/// The names in order, each made unique by its number when it has been there before.
fn unique_keys<'a>(names: impl Iterator<Item = &'a str>) -> Vec<String> {
    let mut keys: Vec<String> = Vec::new();
    for name in names {
        let numbered = (2..).map(|number| format!("{name} {number}"));
        let mut candidates = std::iter::once(name.to_owned()).chain(numbered);
        keys.extend(candidates.find(|key| !keys.contains(key)));
    }
    keys
}

fn text<'a>(texts: &'a BTreeMap<String, String>, key: &'static str) -> Result<&'a str, &'static str> {
    texts.get(key).map(String::as_str).ok_or(key)
}

fn number<N: std::str::FromStr>(
    texts: &BTreeMap<String, String>,
    key: &'static str,
) -> Result<N, &'static str> {
    text(texts, key)?.parse().map_err(|_| key)
}

fn wall_clock_offset_ns() -> i64 {
    let since_1970 = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    let wall_clock_ns = i64::try_from(since_1970.as_nanos()).unwrap_or(i64::MAX);
    wall_clock_ns.saturating_sub_unsigned(monotonic_ns())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn repeated_names_get_keys_of_their_own() {
        let keys = unique_keys(["a", "b", "a", "a 2", "a"].into_iter());
        assert_eq!(keys, ["a", "b", "a 2", "a 2 2", "a 3"]);
    }
}
