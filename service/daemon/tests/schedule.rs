//! What the engine promises about sampling instants, in simulated time.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::sync::{Arc, Mutex};

use proptest::prelude::*;
use residual_diagnosis::diagnoser::{
    Description, Diagnoser, RestoreError, StepInput, StepRecord, Verdict, flags,
};
use residual_shared::alarm::AlarmTransition;
use residual_shared::sample::SampleHeader;
use residuald::configuration::SignalReference;
use residuald::lifecycle::{Enabling, Rules};
use residuald::runtime::engine::{Engine, InboxOptions, RecordSink};
use residuald::runtime::schedule::Timing;
use residuald::runtime::unit::DiagnoserUnit;

const EPOCH_NS: u64 = 1_000_000_000_000;
const MILLISECOND: u64 = 1_000_000;

/// What a diagnoser was told, in order.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Told {
    /// A step with this measurement.
    Step(f64),
    Skip,
}

/// A diagnoser that remembers what it was told.
#[derive(Clone)]
struct Listener {
    description: Description,
    told: Arc<Mutex<Vec<Told>>>,
}

impl Diagnoser for Listener {
    fn description(&self) -> &Description {
        &self.description
    }

    fn step(&mut self, input: &StepInput<'_>, record: &mut StepRecord) {
        let measurement = input.measurements.first().copied().unwrap_or(f64::NAN);
        self.told.lock().unwrap().push(Told::Step(measurement));
        record.verdict = Verdict::Nominal as u32;
    }

    fn skip(&mut self, _record: &mut StepRecord) {
        self.told.lock().unwrap().push(Told::Skip);
    }

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

/// Every record with its slot and the time at which it came.
struct Records {
    now_ns: u64,
    list: Vec<(u64, usize, StepRecord)>,
}

impl RecordSink for Records {
    fn publish(&mut self, slot: usize, record: &StepRecord) -> bool {
        self.list.push((self.now_ns, slot, *record));
        true
    }

    fn alarm(&mut self, _transition: &AlarmTransition) {}
}

/// An engine of listeners in simulated time, with one input of one signal that all of them measure.
struct Bench {
    engine: Engine,
    records: Records,
    told: Vec<Arc<Mutex<Vec<Told>>>>,
}

impl Bench {
    fn new(timings: &[Timing], catch_up_limit: u32) -> Self {
        let told: Vec<Arc<Mutex<Vec<Told>>>> = timings.iter().map(|_| Arc::default()).collect();
        let unit = |(timing, told): (&Timing, &Arc<Mutex<Vec<Told>>>)| DiagnoserUnit {
            diagnoser: Box::new(Listener {
                description: Description {
                    method: "listener",
                    channels: vec![],
                    faults: vec![],
                    measurement_count: 1,
                    command_count: 0,
                    packets: None,
                },
                told: Arc::clone(told),
            }),
            timing: *timing,
            measurements: vec![SignalReference { input: 0, element: 0 }],
            commands: vec![],
            command_delay_steps: 0,
            rules: Rules::default(),
            enabling: Enabling::default(),
        };
        let input = InboxOptions {
            signal_count: 1,
            buffer_samples: 64,
            max_ahead_ns: 1_000 * MILLISECOND,
        };
        let units = timings.iter().zip(&told).map(unit).collect();
        Self {
            engine: Engine::new(EPOCH_NS, catch_up_limit, &[input], units),
            records: Records {
                now_ns: 0,
                list: Vec::new(),
            },
            told,
        }
    }

    /// Sends the sample at the epoch with which the time of every diagnoser begins.
    fn begin(&mut self) {
        self.send(0, 0, 0.0);
    }

    /// Lets the engine do what is due at `after_ns` after the epoch.
    fn wake_at(&mut self, after_ns: u64) {
        self.records.now_ns = EPOCH_NS + after_ns;
        self.engine.step_due(EPOCH_NS + after_ns, || 0, &mut self.records);
    }

    /// Wakes the engine whenever it asks for it, until `after_ns` after the epoch.
    fn run_until(&mut self, after_ns: u64) {
        while let Some(due_ns) = self
            .engine
            .next_due_ns()
            .filter(|&due| due <= EPOCH_NS + after_ns)
        {
            self.wake_at(due_ns - EPOCH_NS);
        }
    }

    fn send(&mut self, sequence: u64, after_ns: u64, value: f64) {
        let header = SampleHeader {
            sequence,
            timestamp_ns: EPOCH_NS + after_ns,
        };
        self.engine.accept(0, 1, header, &[value], EPOCH_NS + after_ns);
    }

    /// (when it was stepped, its sampling instant), both after the epoch, of the diagnoser in `slot`.
    fn steps(&self, slot: usize) -> Vec<(u64, u64)> {
        let of_slot = self.records.list.iter().filter(|(_, of, _)| *of == slot);
        of_slot
            .map(|(now, _, record)| (now - EPOCH_NS, record.instant_ns - EPOCH_NS))
            .collect()
    }
}

fn timing(period_ms: u64, phase_ms: u64, margin_ms: u64, priority: i32) -> Timing {
    Timing {
        period_ns: period_ms * MILLISECOND,
        phase_ns: phase_ms * MILLISECOND,
        margin_ns: margin_ms * MILLISECOND,
        priority,
    }
}

#[test]
fn each_diagnoser_steps_at_its_own_instants_after_its_own_margin() {
    let timings = [timing(10, 0, 2, 0), timing(25, 5, 0, 0), timing(7, 6, 11, 0)];
    let mut bench = Bench::new(&timings, 10);
    bench.run_until(200 * MILLISECOND);
    for (slot, timing) in timings.iter().enumerate() {
        let due = |step: u64| timing.phase_ns + step * timing.period_ns + timing.margin_ns;
        let expected: Vec<(u64, u64)> = (0..)
            .map(|step| (due(step), due(step) - timing.margin_ns))
            .take_while(|(due, _)| *due <= 200 * MILLISECOND)
            .collect();
        assert_eq!(bench.steps(slot), expected);
    }
}

#[test]
fn among_steps_due_together_the_priority_decides() {
    let mut bench = Bench::new(
        &[timing(10, 0, 0, -1), timing(20, 0, 0, 5), timing(10, 0, 0, 3)],
        10,
    );
    bench.run_until(20 * MILLISECOND);
    let order: Vec<usize> = bench.records.list.iter().map(|(_, slot, _)| *slot).collect();
    assert_eq!(order, [1, 2, 0, 2, 0, 1, 2, 0]);
}

#[test]
fn a_backlog_within_the_limit_is_caught_up_in_order_and_beyond_it_skipped_told_and_flagged() {
    let mut bench = Bench::new(&[timing(10, 0, 0, 0)], 3);
    bench.begin();
    bench.wake_at(0);
    // Two instants behind: late, but within the limit.
    bench.wake_at(30 * MILLISECOND);
    assert_eq!(bench.records.list.len(), 4);
    // Ten instants are due (40 to 130 ms); the newest one and three before it are stepped, six are given up.
    bench.wake_at(130 * MILLISECOND);
    let instants: Vec<u64> = bench
        .steps(0)
        .iter()
        .map(|(_, instant)| instant / MILLISECOND)
        .collect();
    assert_eq!(instants, [0, 10, 20, 30, 100, 110, 120, 130]);

    let flagged = |flag: u32| -> Vec<bool> {
        let records = bench.records.list.iter();
        records.map(|(_, _, record)| record.flags & flag != 0).collect()
    };
    let skipped = [false, false, false, false, true, false, false, false];
    assert_eq!(flagged(flags::INSTANTS_SKIPPED), skipped);
    // Later than one period: of 30 ms at 10 ms, of 130 ms at 100 and 110 ms.
    let overrun = [false, true, false, false, true, true, false, false];
    assert_eq!(flagged(flags::OVERRUN), overrun);
    let numbers: Vec<u32> = bench
        .records
        .list
        .iter()
        .map(|(_, _, record)| record.skipped_instants)
        .collect();
    assert_eq!(numbers, [0, 0, 0, 0, 6, 0, 0, 0]);
    let steps: Vec<u64> = bench
        .records
        .list
        .iter()
        .map(|(_, _, record)| record.step)
        .collect();
    assert_eq!(steps, [0, 1, 2, 3, 10, 11, 12, 13]);

    let told = bench.told[0].lock().unwrap();
    let skips = told.iter().map(|told| *told == Told::Skip).collect::<Vec<_>>();
    assert_eq!(skips, [[false; 4].as_slice(), &[true; 6], &[false; 4]].concat());
    let counters = *bench.engine.schedule_counters().next().unwrap();
    assert_eq!((counters.steps, counters.skipped, counters.overruns), (8, 6, 3));
    assert_eq!(counters.max_lateness_ns, 30 * MILLISECOND);
}

#[test]
fn a_late_step_still_sees_the_samples_of_its_own_instant() {
    let mut bench = Bench::new(&[timing(10, 0, 0, 0)], 10);
    for k in 0..6 {
        bench.send(k, k * 10 * MILLISECOND, k as f64);
    }
    bench.wake_at(50 * MILLISECOND);
    let told = bench.told[0].lock().unwrap();
    assert_eq!(
        *told,
        (0..6).map(|k| Told::Step(f64::from(k))).collect::<Vec<_>>()
    );
}

#[test]
fn two_diagnosers_with_different_periods_see_the_newest_sample_of_their_own_windows() {
    let mut bench = Bench::new(&[timing(10, 0, 0, 0), timing(30, 5, 0, 0)], 10);
    for k in 0..10 {
        bench.send(k, k * 10 * MILLISECOND, k as f64);
        bench.run_until(k * 10 * MILLISECOND + MILLISECOND);
    }
    bench.run_until(95 * MILLISECOND);
    let measured = |slot: usize| -> Vec<f64> {
        let told = bench.told[slot].lock().unwrap();
        told.iter()
            .map(|told| match told {
                Told::Step(value) => *value,
                Told::Skip => f64::NAN,
            })
            .collect()
    };
    assert_eq!(measured(0), (0..10).map(f64::from).collect::<Vec<_>>());
    // Instants 5, 35, 65, 95 ms.
    assert_eq!(measured(1), [0.0, 3.0, 6.0, 9.0]);
}

#[test]
fn the_time_of_a_diagnoser_begins_with_its_first_sample() {
    let mut bench = Bench::new(&[timing(10, 0, 2, 0)], 10);
    bench.run_until(32 * MILLISECOND);
    assert!(bench.told[0].lock().unwrap().is_empty());
    let waiting: Vec<_> = bench
        .records
        .list
        .iter()
        .map(|(_, _, record)| record.verdict())
        .collect();
    assert_eq!(waiting, [Verdict::Starting; 4]);
    bench.send(0, 45 * MILLISECOND, 1.0);
    bench.run_until(62 * MILLISECOND);
    let told = bench.told[0].lock().unwrap();
    let measured = |told: &Told| matches!(told, Told::Step(value) if *value == 1.0);
    assert_eq!(told.iter().map(measured).collect::<Vec<_>>(), [true, false]);
    // The instants are those of the schedule, counted from the epoch.
    assert_eq!(
        bench.records.list.last().map(|(_, _, record)| record.step),
        Some(6)
    );
}

#[test]
fn an_engine_without_diagnosers_has_nothing_to_do() {
    let mut bench = Bench::new(&[], 10);
    bench.wake_at(1_000 * MILLISECOND);
    assert_eq!(bench.engine.next_due_ns(), None);
    assert!(bench.records.list.is_empty());
}

fn any_timing() -> impl Strategy<Value = Timing> {
    (1_u64..50_000, 0.0..1.0_f64, 0_u64..100_000, -3..4_i32).prop_map(
        |(period, phase, margin_ns, priority)| {
            let period_ns = period * 1_000 + 7;
            Timing {
                period_ns,
                phase_ns: (period_ns as f64 * phase) as u64,
                margin_ns,
                priority,
            }
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn whatever_the_delays_every_instant_is_stepped_or_skipped_exactly_once(
        timings in prop::collection::vec(any_timing(), 1..6),
        limit in 0_u32..12,
        delays_us in prop::collection::vec(0_u64..400_000, 1..40),
    ) {
        let mut bench = Bench::new(&timings, limit);
        bench.begin();
        let mut now_ns = 0;
        for delay_us in delays_us {
            now_ns += delay_us * 1_000;
            bench.wake_at(now_ns);
        }
        for (slot, timing) in timings.iter().enumerate() {
            let mut next = 0;
            for (_, of, record) in bench.records.list.iter().filter(|(_, of, _)| *of == slot) {
                prop_assert_eq!(*of, slot);
                prop_assert_eq!(record.instant_ns, EPOCH_NS + timing.phase_ns + record.step * timing.period_ns);
                // Neither twice nor unaccounted for.
                prop_assert_eq!(record.step, next + u64::from(record.skipped_instants));
                let flagged = record.flags & flags::INSTANTS_SKIPPED != 0;
                prop_assert_eq!(flagged, record.skipped_instants > 0);
                next = record.step + 1;
            }
            // All that was due, and nothing else.
            let first_due = timing.phase_ns + timing.margin_ns;
            let elapsed = if now_ns >= first_due { (now_ns - first_due) / timing.period_ns + 1 } else { 0 };
            prop_assert_eq!(next, elapsed);
            let counters = *bench.engine.schedule_counters().nth(slot).unwrap();
            prop_assert_eq!(counters.steps + counters.skipped, elapsed);
            let told = bench.told[slot].lock().unwrap();
            let skips = told.iter().filter(|told| **told == Told::Skip).count() as u64;
            // The only sample lies at the first instant; a diagnoser that skipped it has never begun.
            let first = bench.records.list.iter().find(|(_, of, _)| *of == slot);
            if first.is_some_and(|(_, _, record)| record.skipped_instants == 0) {
                prop_assert_eq!(skips, counters.skipped);
                prop_assert_eq!(told.len() as u64, elapsed);
            } else {
                prop_assert!(told.is_empty());
            }
        }
        let due = bench.engine.next_due_ns();
        prop_assert!(due.is_some_and(|due| due > EPOCH_NS + now_ns));
    }
}
