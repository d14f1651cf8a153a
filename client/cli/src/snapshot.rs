//! All that an instance shows at one moment.

use std::collections::BTreeMap;

use residual_client::{
    AlarmState, Channel, ChannelSpec, DaemonState, Freshness, InputCounters, Monitor, Reading,
    ScheduleCounters, SlotSpec, StepRecord, TableReader, Verdict, alarm_flags, flags, monotonic_ns,
};
use serde::{Serialize, Serializer};

use crate::error::Error;
use crate::number::Number;

/// All that an instance shows at one moment.
#[derive(Debug, Serialize)]
pub struct Snapshot {
    pub instance: String,
    /// `running`, `hung`, `closed`, or `unreachable`: its newest table cannot be opened.
    pub daemon: &'static str,
    pub pid: u32,
    pub epoch: u64,
    /// The moment, nanoseconds of the daemon's time.
    pub now_ns: u64,
    pub diagnosers: Vec<DiagnoserView>,
    pub inputs: Vec<InputView>,
}

/// One diagnoser.
#[derive(Debug, Serialize)]
pub struct DiagnoserView {
    pub name: String,
    pub method: String,
    pub period_ns: u64,
    pub freshness: &'static str,
    /// Number of the record in this life of the daemon; 0: there is none, and what follows is empty.
    pub record: u64,
    pub verdict: &'static str,
    pub certainly_faulty: Vec<String>,
    pub possibly_faulty: Vec<String>,
    pub fault_estimate: Number,
    pub fault_estimate_half_width: Number,
    pub step: u64,
    pub instant_ns: u64,
    pub flags: Vec<&'static str>,
    pub worst_channel: Option<ChannelView>,
    pub channels: Vec<ChannelView>,
    pub counters: BTreeMap<&'static str, u64>,
    pub alarm: AlarmView,
    #[serde(skip)]
    pub condition: Condition,
}

/// Where the alarm of a diagnoser stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct AlarmView {
    #[serde(serialize_with = "name_of_state")]
    pub state: AlarmState,
    /// How often it has been raised.
    pub occurrences: u64,
    /// It stays until it is acknowledged.
    pub is_latched: bool,
}

impl AlarmView {
    /// `isolated, latched, occurred 2 times`; what does not hold is left out.
    pub fn text(&self) -> String {
        let mut text = self.state.name().to_owned();
        if self.is_latched {
            text += ", latched";
        }
        match self.occurrences {
            0 => text,
            1 => text + ", occurred once",
            more => text + &format!(", occurred {more} times"),
        }
    }

    /// Whether it reports a fault, be it that of an earlier record.
    pub fn is_fault(&self) -> bool {
        self.state.is_active() || self.is_latched
    }
}

fn name_of_state<S: Serializer>(state: &AlarmState, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(state.name())
}

/// What a diagnoser means for the whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Condition {
    /// Its newest record reports a fault.
    Faulty,
    /// It has judged its latest instant: no fault.
    Sound,
    /// It does not judge.
    Unknown,
}

/// One channel.
#[derive(Clone, Debug, Serialize)]
pub struct ChannelView {
    pub name: String,
    pub unit: String,
    pub lower: Number,
    pub residual: Number,
    pub upper: Number,
    /// NaN: not evaluated.
    pub ratio: Number,
}

/// One input.
#[derive(Debug, Serialize)]
pub struct InputView {
    pub name: String,
    pub signals: Vec<String>,
    pub counters: BTreeMap<&'static str, u64>,
}

impl Snapshot {
    /// Takes a snapshot of one life of the daemon; `None` if there has been none yet.
    pub fn take(monitor: &mut Monitor) -> Result<Option<Self>, Error> {
        let daemon = match monitor.state() {
            DaemonState::Running => "running",
            DaemonState::Hung(_) => "hung",
            DaemonState::Closed | DaemonState::Unknown => "closed",
            DaemonState::Unreachable(_) => "unreachable",
        };
        let Some(table) = monitor.table() else {
            return Ok(None);
        };
        let directory = table.directory();
        let diagnosers = (0..directory.spec.slots.len()).map(|slot| DiagnoserView::take(table, slot));
        let inputs = (0..directory.spec.inputs.len()).map(|input| InputView::take(table, input));
        Ok(Some(Self {
            instance: directory.spec.instance.clone(),
            daemon,
            pid: directory.pid,
            epoch: directory.epoch,
            now_ns: directory.spec.time.from_monotonic(monotonic_ns()),
            diagnosers: diagnosers.collect::<Result<_, _>>()?,
            inputs: inputs.collect::<Result<_, _>>()?,
        }))
    }
}

impl DiagnoserView {
    fn take(table: &TableReader, slot: usize) -> Result<Self, Error> {
        let mut record = StepRecord::new(0);
        let reading = Reading::take(table, slot, &mut record, monotonic_ns())?;
        let counters = table.read_schedule_counters(slot)?;
        let alarm = table.read_alarm_status(slot)?;
        let spec = &table.directory().spec.slots[slot];
        let channels: Vec<_> = spec
            .channels
            .iter()
            .zip(record.channels())
            .map(|(spec, channel)| view(spec, channel))
            .collect();
        let worst = record
            .worst_channel()
            .and_then(|(index, _)| channels.get(index).cloned());
        let has_fault = matches!(record.verdict(), Verdict::Fault | Verdict::Isolated);
        let faults = |set: u64| {
            if has_fault {
                fault_names(spec, set)
            } else {
                Vec::new()
            }
        };
        Ok(Self {
            name: spec.name.clone(),
            method: spec.method.clone(),
            period_ns: spec.period_ns,
            freshness: reading.freshness.name(),
            record: reading.number,
            verdict: record.verdict().name(),
            certainly_faulty: faults(record.certainly_faulty),
            possibly_faulty: faults(record.possibly_faulty),
            fault_estimate: Number(record.fault_estimate),
            fault_estimate_half_width: Number(record.fault_estimate_half_width),
            step: record.step,
            instant_ns: record.instant_ns,
            flags: flags::names(record.flags).collect(),
            worst_channel: worst,
            channels,
            counters: ScheduleCounters::NAMES
                .iter()
                .copied()
                .zip(counters.to_words())
                .collect(),
            alarm: AlarmView {
                state: u32::try_from(alarm.state)
                    .ok()
                    .and_then(AlarmState::from_number)
                    .unwrap_or_default(),
                occurrences: alarm.occurrences,
                is_latched: alarm.flags & u64::from(alarm_flags::LATCHED) != 0,
            },
            condition: match (has_fault, reading.freshness, record.verdict()) {
                (true, ..) => Condition::Faulty,
                (false, Freshness::Fresh, Verdict::Nominal) => Condition::Sound,
                _ => Condition::Unknown,
            },
        })
    }
}

impl InputView {
    fn take(table: &TableReader, input: usize) -> Result<Self, Error> {
        let counters = table.read_input_counters(input)?;
        let spec = &table.directory().spec.inputs[input];
        Ok(Self {
            name: spec.name.clone(),
            signals: spec.signals.clone(),
            counters: InputCounters::NAMES
                .iter()
                .copied()
                .zip(counters.to_words())
                .collect(),
        })
    }
}

fn view(spec: &ChannelSpec, channel: &Channel) -> ChannelView {
    ChannelView {
        name: spec.name.clone(),
        unit: spec.unit.clone(),
        lower: Number(channel.lower),
        residual: Number(channel.residual),
        upper: Number(channel.upper),
        ratio: Number(channel.ratio),
    }
}

fn fault_names(spec: &SlotSpec, set: u64) -> Vec<String> {
    let is_in = |index: usize| index < 64 && set >> index & 1 == 1;
    spec.faults
        .iter()
        .enumerate()
        .filter(|(index, _)| is_in(*index))
        .map(|(_, name)| name.clone())
        .collect()
}
