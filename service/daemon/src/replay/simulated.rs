//! Replay in this process with a simulated clock, as fast as possible.

use residual_shared::alarm::AlarmTransition;
use residual_shared::record::StepRecord;
use residual_shared::sample::SampleHeader;

use super::mapping::TimedSample;
use super::records::{ReplayRecord, Replayed};
use crate::assembly::assemble;
use crate::configuration::Configuration;
use crate::runtime::engine::{Engine, RecordSink};
use residual_diagnosis::method::Designed;

/// The simulated epoch. Any number does as long as no window begins before zero.
const EPOCH_NS: u64 = 1_000_000_000_000;

/// The publisher that samples of a simulated replay come from.
const PUBLISHER: u128 = 1;

/// Collects records and alarms with step and time counted from the start of the recording.
struct Collector<F> {
    epoch_ns: u64,
    end_ns: u64,
    take: F,
}

impl<F: FnMut(Replayed)> RecordSink for Collector<F> {
    fn publish(&mut self, slot: usize, record: &StepRecord) -> bool {
        let since_start_ns = record.instant_ns - self.epoch_ns;
        if since_start_ns <= self.end_ns {
            let record = StepRecord {
                instant_ns: since_start_ns,
                ..*record
            };
            (self.take)(Replayed::Record(ReplayRecord { slot, record }));
        }
        true
    }

    fn alarm(&mut self, transition: &AlarmTransition) {
        let instant_ns = transition.instant_ns - self.epoch_ns;
        if instant_ns <= self.end_ns {
            (self.take)(Replayed::Alarm(AlarmTransition {
                instant_ns,
                ..*transition
            }));
        }
    }
}

/// Replays the samples of one run (in time order) and hands every record and alarm to `take`; returns the engine with its
/// counters.
///
/// Records are given for the sampling instants from the start of the run to its last sample.
pub fn replay(
    configuration: &Configuration,
    diagnosers: Vec<Designed>,
    samples: &[TimedSample],
    take: impl FnMut(Replayed),
) -> Engine {
    let mut engine = assemble(configuration, diagnosers, EPOCH_NS, 1.0);
    let end_ns = samples.last().map_or(0, |sample| sample.time_ns);
    let mut collector = Collector {
        epoch_ns: EPOCH_NS,
        end_ns,
        take,
    };
    for sample in samples {
        let now_ns = EPOCH_NS + sample.time_ns;
        step_before(&mut engine, now_ns, &mut collector);
        let header = SampleHeader {
            sequence: sample.sequence,
            timestamp_ns: now_ns,
        };
        engine.accept(sample.input, PUBLISHER, header, &sample.elements, now_ns);
    }
    let longest_margin = configuration
        .diagnosers
        .iter()
        .map(|d| d.margin_ns)
        .max()
        .unwrap_or(0);
    step_before(
        &mut engine,
        EPOCH_NS + end_ns + longest_margin + 1,
        &mut collector,
    );
    engine
}

/// Does every step that is due before `now_ns`, each at its own time.
pub(super) fn step_before(engine: &mut Engine, now_ns: u64, sink: &mut impl RecordSink) {
    while let Some(due_ns) = engine.next_due_ns().filter(|&due| due < now_ns) {
        engine.step_due(due_ns, || 0, sink);
    }
}
