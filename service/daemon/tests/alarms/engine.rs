//! What the engine does with alarms, in simulated time: order, acknowledgement, reset, enabling signals.

use residual_diagnosis::diagnoser::{
    Channel, ChannelDescription, Description, Diagnoser, RestoreError, StepInput, StepRecord, Verdict, flags,
};
use residual_shared::alarm::{AlarmState, AlarmTransition, alarm_flags};
use residual_shared::sample::SampleHeader;
use residuald::configuration::SignalReference;
use residuald::lifecycle::{ALL_CHANNELS, EnableCondition, Enabling, Rules};
use residuald::runtime::engine::{Engine, InboxOptions, RecordSink};
use residuald::runtime::schedule::Timing;
use residuald::runtime::unit::DiagnoserUnit;

const EPOCH_NS: u64 = 1_000_000_000_000;
const PERIOD_NS: u64 = 10_000_000;

/// A fault is a measurement beyond ±1; without one nothing is evaluated.
#[derive(Clone)]
struct Limit(Description);

impl Diagnoser for Limit {
    fn description(&self) -> &Description {
        &self.0
    }

    fn step(&mut self, input: &StepInput<'_>, record: &mut StepRecord) {
        let channel = Channel::two_sided(input.measurements[0], 1.0);
        let verdict = match channel.ratio {
            ratio if ratio.is_nan() => Verdict::NotEvaluated,
            ratio if ratio > 1.0 => Verdict::Fault,
            _ => Verdict::Nominal,
        };
        record.channels_mut()[0] = channel;
        record.verdict = verdict as u32;
    }

    fn skip(&mut self, _record: &mut StepRecord) {}

    fn reset(&mut self) {}

    fn boxed_clone(&self) -> Box<dyn Diagnoser> {
        Box::new(self.clone())
    }

    fn save(&self, _state: &mut Vec<u8>) {}

    fn state_size(&self) -> usize {
        0
    }

    fn restore(&mut self, _state: &[u8]) -> Result<(), RestoreError> {
        Ok(())
    }
}

/// Records and transitions in the order in which they came.
#[derive(Default)]
struct Sink {
    records: Vec<StepRecord>,
    /// With the number of records before them.
    alarms: Vec<(usize, AlarmTransition)>,
}

impl RecordSink for Sink {
    fn publish(&mut self, _slot: usize, record: &StepRecord) -> bool {
        self.records.push(*record);
        true
    }

    fn alarm(&mut self, transition: &AlarmTransition) {
        self.alarms.push((self.records.len(), *transition));
    }
}

struct Bench {
    engine: Engine,
    sink: Sink,
    step: u64,
    sequence: u64,
}

impl Bench {
    /// Input 0 is measured, input 1 enables within [0, 1] if `enabling`.
    fn new(rules: Rules, enabling: bool) -> Self {
        let input = InboxOptions {
            signal_count: 1,
            buffer_samples: 8,
            max_ahead_ns: 0,
        };
        let condition = EnableCondition {
            channels: ALL_CHANNELS,
            signal: SignalReference { input: 1, element: 0 },
            range: [0.0, 1.0],
        };
        let unit = DiagnoserUnit {
            diagnoser: Box::new(Limit(Description {
                method: "limit",
                channels: vec![ChannelDescription {
                    name: "residual".into(),
                    unit: String::new(),
                }],
                faults: vec![],
                measurement_count: 1,
                command_count: 0,
                packets: None,
            })),
            timing: Timing {
                period_ns: PERIOD_NS,
                phase_ns: 0,
                margin_ns: 0,
                priority: 0,
            },
            measurements: vec![SignalReference { input: 0, element: 0 }],
            commands: vec![],
            command_delay_steps: 0,
            rules,
            enabling: Enabling::new(if enabling { vec![condition] } else { vec![] }),
        };
        Self {
            engine: Engine::new(EPOCH_NS, 10, &[input, input], vec![unit]),
            sink: Sink::default(),
            step: 0,
            sequence: 0,
        }
    }

    /// Sends a sample for the next instant.
    fn send(&mut self, input: usize, value: f64) {
        let now_ns = EPOCH_NS + self.step * PERIOD_NS;
        let header = SampleHeader {
            sequence: self.sequence,
            timestamp_ns: now_ns,
        };
        self.sequence += 1;
        self.engine.accept(input, 1, header, &[value], now_ns);
    }

    /// Does a step with a measurement, or without; gives the states that it brought.
    fn step(&mut self, measurement: Option<f64>) -> Vec<AlarmState> {
        if let Some(value) = measurement {
            self.send(0, value);
        }
        let before = self.sink.alarms.len();
        self.engine
            .step_due(EPOCH_NS + self.step * PERIOD_NS, || 0, &mut self.sink);
        self.step += 1;
        let new = &self.sink.alarms[before..];
        new.iter().map(|(_, transition)| transition.state).collect()
    }
}

#[test]
fn an_alarm_follows_the_record_that_caused_it() {
    let mut bench = Bench::new(Rules::default(), false);
    assert_eq!(bench.step(Some(0.5)), []);
    assert_eq!(bench.step(None), []);
    assert_eq!(bench.step(Some(-3.0)), [AlarmState::Raised]);
    let (records, transition) = bench.sink.alarms[0];
    assert_eq!(records, 3);
    assert_eq!(
        (transition.step, transition.instant_ns),
        (2, EPOCH_NS + 2 * PERIOD_NS)
    );
    assert_eq!(
        (transition.slot, transition.channel, transition.ratio),
        (0, 0, 3.0)
    );
    assert_eq!(transition.verdict, Verdict::Fault as u32);
}

#[test]
fn a_latched_alarm_is_cleared_by_an_acknowledgement_and_nothing_else_is() {
    let mut bench = Bench::new(
        Rules {
            latch: true,
            clear_steps: 2,
            ..Rules::default()
        },
        false,
    );
    assert_eq!(bench.engine.acknowledge(0, &mut bench.sink), Some(false));
    bench.step(Some(2.0));
    for _ in 0..10 {
        assert_eq!(bench.step(Some(0.0)), []);
    }
    assert_eq!(bench.engine.acknowledge(1, &mut bench.sink), None);
    assert_eq!(bench.engine.acknowledge(0, &mut bench.sink), Some(true));
    assert_eq!(bench.engine.acknowledge(0, &mut bench.sink), Some(false));
    let (_, last) = bench.sink.alarms[1];
    assert_eq!(
        (last.state, last.flags),
        (AlarmState::Cleared, alarm_flags::ACKNOWLEDGED)
    );
    assert_eq!((last.step, bench.sink.alarms.len()), (10, 2));
}

#[test]
fn a_reset_clears_begins_suppression_anew_and_shows_in_the_next_record_only() {
    let mut bench = Bench::new(
        Rules {
            suppressed_instants: 3,
            ..Rules::default()
        },
        false,
    );
    let violations = |bench: &mut Bench| -> Vec<usize> {
        let raised = (0..5).filter(|_| bench.step(Some(2.0)) == [AlarmState::Raised]);
        raised.collect()
    };
    assert_eq!(violations(&mut bench), [3]);
    assert!(bench.engine.reset(0, &mut bench.sink) && !bench.engine.reset(1, &mut bench.sink));
    let (_, cleared) = *bench.sink.alarms.last().unwrap();
    assert_eq!(
        (cleared.state, cleared.flags),
        (AlarmState::Cleared, alarm_flags::RESET)
    );
    assert_eq!(violations(&mut bench), [3]);
    let resets = bench
        .sink
        .records
        .iter()
        .map(|record| record.flags & flags::RESET != 0);
    assert_eq!(
        resets
            .enumerate()
            .filter(|(_, reset)| *reset)
            .map(|(k, _)| k)
            .collect::<Vec<_>>(),
        [5]
    );
}

#[test]
fn a_violation_counts_while_the_newest_value_of_the_enabling_signal_allows_it() {
    let mut bench = Bench::new(Rules::default(), true);
    assert_eq!(bench.step(Some(2.0)), [], "no value yet");
    bench.send(1, 1.5);
    assert_eq!(bench.step(Some(2.0)), [], "outside its range");
    bench.send(1, 0.5);
    assert_eq!(bench.step(Some(2.0)), [AlarmState::Raised]);
    // An old value stays in force, and a channel that is disabled lets the alarm go.
    for _ in 0..20 {
        assert_eq!(bench.step(Some(2.0)), []);
    }
    bench.send(1, 7.0);
    let states: Vec<_> = (0..5).map(|_| bench.step(Some(2.0))).collect();
    assert_eq!(states.concat(), [AlarmState::Cleared]);
    assert_eq!(states[4], [AlarmState::Cleared]);
}
