//! Replay through iceoryx2 to a running daemon at the recorded pace.
//!
//! The recording starts at a moment at which every diagnoser of the daemon has a sampling instant, as it does in
//! a simulated replay; so both see each sample in the same window.

use std::collections::HashMap;

use residual_shared::alarm::AlarmTransition;
use residual_shared::bounds_table::{AlarmRead, Directory, OpenError, TableReader};
use residual_shared::clock::{DaemonTime, sleep_until_monotonic};
use residual_shared::names::Instance;
use residual_shared::record::StepRecord;
use residual_shared::sample::SampleHeader;
use residual_shared::transport::{self, RecordSubscriber, SamplePublisher, SendError, TransportError};

use super::mapping::TimedSample;
use super::records::{ReplayRecord, Replayed};
use crate::configuration::Configuration;

/// From the decision to start until the first sample: enough to connect all ports.
const HEAD_START_NS: u64 = 300_000_000;

/// Longest common period of all diagnosers for which a common start is waited for.
const LONGEST_COMMON_PERIOD_NS: u64 = 60_000_000_000;

/// How long to wait for the last records after their sampling instant, beyond the longest margin.
const LAST_RECORDS_NS: u64 = 200_000_000;

/// Why a recording could not be replayed through the daemon.
#[derive(Debug, thiserror::Error)]
pub enum ThroughDaemonError {
    /// There is no daemon, or its table cannot be read.
    #[error(transparent)]
    Table(#[from] OpenError),
    /// iceoryx2 refused.
    #[error(transparent)]
    Transport(#[from] TransportError),
    /// A sample could not be sent.
    #[error(transparent)]
    Send(#[from] SendError),
    /// The running daemon has another configuration.
    #[error(
        "the daemon of instance `{instance}` runs other diagnosers than this configuration ({what}); restart it with this file"
    )]
    OtherConfiguration {
        /// The instance.
        instance: String,
        /// The first difference.
        what: String,
    },
    /// The running daemon's time has another speed.
    #[error(
        "the daemon's time runs at speed {daemon}, not {asked}; start it with `residuald run --speed {asked}`"
    )]
    OtherSpeed {
        /// The daemon's.
        daemon: f64,
        /// What was asked for.
        asked: f64,
    },
    /// The diagnosers' instants never meet within a minute.
    #[error(
        "the periods of the diagnosers have no common multiple within 60 s, so the recording has no common start; choose commensurable periods"
    )]
    NoCommonPeriod,
}

/// Sends the samples of one run to the daemon of `instance` and hands the records and alarms it makes of them to `take`;
/// `progress` is told the number of samples sent.
///
/// Returns the number of records that the recorder's buffer lost, and of alarms that the ring did.
pub fn replay(
    configuration: &Configuration,
    instance: &Instance,
    speed: f64,
    samples: &[TimedSample],
    mut take: impl FnMut(Replayed),
    mut progress: impl FnMut(u64),
) -> Result<u64, ThroughDaemonError> {
    let table = TableReader::open(&instance.bounds_path())?;
    let directory = table.directory();
    check(configuration, directory, speed)?;
    let time = directory.spec.time;

    let node = transport::open_node(instance)?;
    let recorder = RecordSubscriber::open(&node, instance)?;
    let mut publishers = HashMap::new();
    for sample in samples {
        if let std::collections::hash_map::Entry::Vacant(entry) = publishers.entry(sample.input) {
            let name = &configuration.inputs[sample.input].name;
            entry.insert(SamplePublisher::open(&node, instance, name)?);
        }
    }

    let start_ns = common_start_ns(configuration, directory, time)?;
    let end_ns = samples.last().map_or(0, |sample| sample.time_ns);
    let mut window = RecordWindow::new(&table, start_ns, end_ns);
    for (sent, sample) in samples.iter().enumerate() {
        let stamp_ns = start_ns + sample.time_ns;
        sleep_until_monotonic(time.to_monotonic(stamp_ns));
        if let Some(publisher) = publishers.get_mut(&sample.input) {
            let header = SampleHeader {
                sequence: sample.sequence,
                timestamp_ns: stamp_ns,
            };
            publisher.send_with_header(header, &sample.elements)?;
        }
        window.receive(&recorder, &table, &mut take);
        progress(sent as u64 + 1);
    }
    let margin_ns = configuration
        .diagnosers
        .iter()
        .map(|d| d.margin_ns)
        .max()
        .unwrap_or(0);
    sleep_until_monotonic(time.to_monotonic(start_ns + end_ns) + margin_ns + LAST_RECORDS_NS);
    window.receive(&recorder, &table, &mut take);
    Ok(window.lost)
}

/// Picks the records and alarms of the replay out of the daemon's and counts lost ones.
struct RecordWindow {
    /// The life of the table that the replay began with: records of another one have other slots.
    epoch: u64,
    start_ns: u64,
    end_ns: u64,
    /// Number of each diagnoser's sampling instant at the start.
    first_steps: Vec<u64>,
    next_sequence: Option<u64>,
    next_alarm: u64,
    lost: u64,
}

impl RecordWindow {
    fn new(table: &TableReader, start_ns: u64, end_ns: u64) -> Self {
        let directory = table.directory();
        let epoch_ns = directory.spec.schedule_epoch_ns;
        let first_step = |period_ns: u64| (start_ns - epoch_ns) / period_ns;
        Self {
            epoch: directory.epoch,
            start_ns,
            end_ns,
            first_steps: directory
                .spec
                .slots
                .iter()
                .map(|slot| first_step(slot.period_ns))
                .collect(),
            next_sequence: None,
            next_alarm: table.newest_alarm() + 1,
            lost: 0,
        }
    }

    /// Takes all that has come: records first, so that an alarm follows the record that caused it.
    fn receive(&mut self, recorder: &RecordSubscriber, table: &TableReader, take: &mut impl FnMut(Replayed)) {
        recorder.receive(|header, record| self.take(header, record, take));
        loop {
            match table.read_alarm(self.next_alarm) {
                AlarmRead::Waiting => break,
                AlarmRead::Lost => self.lost += 1,
                AlarmRead::Transition(transition) => self.take_alarm(&transition, take),
            }
            self.next_alarm += 1;
        }
    }

    fn take_alarm(&self, transition: &AlarmTransition, take: &mut impl FnMut(Replayed)) {
        let since_start_ns = transition.instant_ns.checked_sub(self.start_ns);
        let first = self.first_steps.get(transition.slot as usize);
        if let (Some(instant_ns), Some(first)) = (since_start_ns, first)
            && instant_ns <= self.end_ns
        {
            take(Replayed::Alarm(AlarmTransition {
                instant_ns,
                step: transition.step - first,
                ..*transition
            }));
        }
    }

    fn take(
        &mut self,
        header: transport::RecordHeader,
        record: &StepRecord,
        take: &mut impl FnMut(Replayed),
    ) {
        let expected = self
            .next_sequence
            .replace(header.sequence + 1)
            .unwrap_or(header.sequence);
        self.lost += header.sequence.saturating_sub(expected);
        if header.epoch != self.epoch {
            self.lost += 1;
            return;
        }
        let slot = header.slot as usize;
        let since_start_ns = record.instant_ns.checked_sub(self.start_ns);
        if let (Some(instant_ns), Some(first)) = (since_start_ns, self.first_steps.get(slot))
            && instant_ns <= self.end_ns
        {
            let record = StepRecord {
                instant_ns,
                step: record.step - first,
                ..*record
            };
            take(Replayed::Record(ReplayRecord { slot, record }));
        }
    }
}

fn check(configuration: &Configuration, directory: &Directory, speed: f64) -> Result<(), ThroughDaemonError> {
    let other = |what: String| ThroughDaemonError::OtherConfiguration {
        instance: configuration.daemon.instance.to_string(),
        what,
    };
    if directory.spec.time.speed != speed {
        return Err(ThroughDaemonError::OtherSpeed {
            daemon: directory.spec.time.speed,
            asked: speed,
        });
    }
    if directory.spec.slots.len() != configuration.diagnosers.len() {
        return Err(other(format!(
            "{} diagnosers there, {} here",
            directory.spec.slots.len(),
            configuration.diagnosers.len()
        )));
    }
    for (slot, configured) in directory.spec.slots.iter().zip(&configuration.diagnosers) {
        if slot.name != configured.name {
            return Err(other(format!(
                "`{}` there, `{}` here",
                slot.name, configured.name
            )));
        }
        let there = describe_timing(slot.period_ns, slot.phase_ns);
        let here = describe_timing(configured.period_ns, configured.phase_ns);
        if there != here {
            return Err(other(format!("`{}` with {there} there, {here} here", slot.name)));
        }
    }
    Ok(())
}

fn describe_timing(period_ns: u64, phase_ns: u64) -> String {
    let milliseconds = |nanoseconds: u64| nanoseconds as f64 * 1e-6;
    format!(
        "period {} ms and phase {} ms",
        milliseconds(period_ns),
        milliseconds(phase_ns)
    )
}

/// The next moment that lies a whole number of every diagnoser's periods after the epoch.
fn common_start_ns(
    configuration: &Configuration,
    directory: &Directory,
    time: DaemonTime,
) -> Result<u64, ThroughDaemonError> {
    let common = configuration
        .diagnosers
        .iter()
        .try_fold(1, |common, diagnoser| {
            least_common_multiple(common, diagnoser.period_ns)
        })
        .filter(|&common| common <= LONGEST_COMMON_PERIOD_NS)
        .ok_or(ThroughDaemonError::NoCommonPeriod)?;
    let epoch_ns = directory.spec.schedule_epoch_ns;
    let earliest_ns = time.now_ns() + (HEAD_START_NS as f64 * time.speed) as u64;
    Ok(epoch_ns + (earliest_ns - epoch_ns).div_ceil(common) * common)
}

fn least_common_multiple(a: u64, b: u64) -> Option<u64> {
    let (mut divisor, mut rest) = (a, b);
    while rest != 0 {
        (divisor, rest) = (rest, divisor % rest);
    }
    (a / divisor).checked_mul(b)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_common_multiple_is_the_least_and_never_overflows() {
        assert_eq!(least_common_multiple(10_000_000, 25_000_000), Some(50_000_000));
        assert_eq!(least_common_multiple(1, 7), Some(7));
        assert_eq!(least_common_multiple(u64::MAX, u64::MAX - 1), None);
    }
}
