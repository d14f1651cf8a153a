//! Which packets are used, dropped or rejected, and what the record says of it.

use crate::servo::{Arrival, servo, settings, step};
use residual_diagnosis::async_imm::{AsyncImm, Counters, settings::Settings};
use residual_diagnosis::diagnoser::{Diagnoser, PacketSource, StepRecord, Verdict, flags};

const PERIOD_US: i64 = 100_000;

/// An encoder packet that arrives with the next step.
fn encoder(sequence: u64, time_us: i64) -> Arrival {
    Arrival {
        at_us: 0,
        source: PacketSource::Sensor(0),
        sequence,
        time_us,
        values: vec![0.01],
    }
}

fn command(sequence: u64, time_us: i64, value: f64) -> Arrival {
    Arrival {
        source: PacketSource::Commands,
        values: vec![value],
        ..encoder(sequence, time_us)
    }
}

struct Bench(AsyncImm);

impl Bench {
    fn new(rollback_steps: usize, change: impl FnOnce(&mut Settings)) -> Self {
        let (_, design) = servo();
        let mut settings = settings(&design, PERIOD_US, rollback_steps);
        settings.max_ahead_ns = 150_000_000;
        change(&mut settings);
        Self(AsyncImm::new(&design, settings).unwrap())
    }

    /// The step number `k` with these packets.
    fn step(&mut self, k: i64, packets: &[Arrival]) -> StepRecord {
        let instant = k * PERIOD_US;
        let arrivals = packets.iter().cloned().map(|packet| Arrival {
            at_us: instant,
            ..packet
        });
        step(&mut self.0, &arrivals.collect::<Vec<_>>(), instant - 1, instant)
    }

    fn counters(&self) -> Counters {
        *self.0.counters()
    }
}

#[test]
fn damaged_packets_and_those_of_unknown_sources_are_rejected() {
    let mut bench = Bench::new(0, |_| {});
    let wrong = [vec![f64::NAN], vec![f64::INFINITY], vec![], vec![1.0, 2.0]];
    let mut packets: Vec<Arrival> = wrong
        .into_iter()
        .map(|values| Arrival {
            values,
            ..encoder(1, 50_000)
        })
        .collect();
    packets.push(Arrival {
        source: PacketSource::Sensor(2),
        ..encoder(1, 50_000)
    });
    packets.push(command(1, 50_000, f64::NAN));
    let record = bench.step(1, &packets);
    assert_eq!(
        bench.counters(),
        Counters {
            non_finite: 6,
            ..Counters::default()
        }
    );
    assert_eq!(record.verdict(), Verdict::NotEvaluated);
    assert_eq!(record.inputs_valid, 0);
}

#[test]
fn packets_from_before_the_start_or_the_window_are_too_old() {
    for rollback_steps in [0, 1] {
        let mut bench = Bench::new(rollback_steps, |_| {});
        bench.step(5, &[encoder(1, 400_000), encoder(2, 400_001)]);
        assert_eq!(
            bench.counters(),
            Counters {
                too_old: 1,
                ..Counters::default()
            }
        );
        let late = rollback_steps as u64;
        let record = bench.step(6, &[encoder(3, 499_999)]);
        assert_eq!(
            (bench.counters().too_old, bench.counters().late_used),
            (2 - late, late)
        );
        // Late or not, it says nothing about the interval of this instant.
        assert_eq!(record.verdict(), Verdict::NotEvaluated);
        assert_eq!(bench.0.recomputed_from(), 2 - late);
        bench.step(7, &[encoder(4, 500_000)]);
        assert_eq!(bench.counters().too_old, 3 - late);
    }
}

#[test]
fn the_same_number_of_the_same_sensor_counts_once_in_an_interval() {
    let mut bench = Bench::new(1, |_| {});
    bench.step(
        1,
        &[
            encoder(7, 40_000),
            encoder(7, 40_000),
            encoder(7, 41_000),
            command(7, 40_000, 1.0),
        ],
    );
    assert_eq!(
        bench.counters(),
        Counters {
            duplicate: 2,
            ..Counters::default()
        }
    );
    // Again while it can still be used: known; in another interval: a number that its publisher used twice.
    bench.step(2, &[encoder(7, 40_000), encoder(7, 140_000)]);
    assert_eq!(
        bench.counters(),
        Counters {
            duplicate: 3,
            ..Counters::default()
        }
    );
}

#[test]
fn early_packets_wait_for_their_interval_and_far_ones_are_rejected() {
    let mut bench = Bench::new(0, |_| {});
    let record = bench.step(1, &[encoder(1, 250_000), encoder(2, 250_001)]);
    assert_eq!(
        bench.counters(),
        Counters {
            ahead: 1,
            ..Counters::default()
        }
    );
    assert_eq!(record.verdict(), Verdict::NotEvaluated);
    assert_eq!(bench.step(2, &[]).verdict(), Verdict::NotEvaluated);
    let record = bench.step(3, &[]);
    assert_eq!(record.verdict(), Verdict::Nominal);
    assert_eq!(record.inputs_valid, 0b001);
}

#[test]
fn what_exceeds_the_room_is_dropped() {
    let mut bench = Bench::new(0, |settings| settings.max_packets_per_step = 3);
    let packets: Vec<Arrival> = (0..5).map(|i| encoder(i, 10_000 + i as i64)).collect();
    bench.step(1, &packets);
    assert_eq!(
        bench.counters(),
        Counters {
            overflow: 2,
            ..Counters::default()
        }
    );
    let commands: Vec<Arrival> = (0..4).map(|i| command(i, 110_000 + i as i64, 0.0)).collect();
    bench.step(2, &commands);
    assert_eq!(bench.counters().overflow, 3);
    // The future has room for as many periods as packets may be ahead: two.
    let early: Vec<Arrival> = (10..20).map(|i| encoder(i, 310_000 + i as i64)).collect();
    bench.step(3, &early);
    assert_eq!(bench.counters().overflow, 3 + 4);
}

#[test]
fn a_record_tells_which_sensors_and_commands_were_heard() {
    let mut bench = Bench::new(0, |_| {});
    let tachometer = Arrival {
        source: PacketSource::Sensor(1),
        ..encoder(1, 30_000)
    };
    let all = bench.step(
        1,
        &[encoder(1, 20_000), tachometer.clone(), command(1, 10_000, 0.0)],
    );
    assert_eq!((all.inputs_valid, all.flags & flags::INPUT_MISSING), (0b111, 0));
    let half = bench.step(
        2,
        &[Arrival {
            time_us: 130_000,
            sequence: 2,
            ..tachometer
        }],
    );
    assert_eq!((half.inputs_valid, half.flags), (0b010, flags::INPUT_MISSING));
    let none = bench.step(3, &[]);
    assert_eq!((none.inputs_valid, none.flags), (0, flags::INPUT_MISSING));
    assert_eq!(none.verdict(), Verdict::NotEvaluated);
    assert!(none.channels()[..2].iter().all(|channel| !channel.is_evaluated()));
    assert!(none.channels()[2].is_evaluated());
}

#[test]
fn a_command_acts_from_its_own_stamp_on() {
    let (_, design) = servo();
    let moved = |commands: &[Arrival]| {
        let mut bench = Bench::new(0, |_| {});
        bench.step(1, commands);
        bench.0.posterior().modes[0].mean.clone()
    };
    let rest = moved(&[]);
    assert_eq!(
        rest,
        design
            .prior
            .state
            .iter()
            .chain(&[0.0])
            .copied()
            .collect::<Vec<_>>()
    );
    // dv/dt = -2 v + 8 u.
    for (since, h) in [(-1, 0.1), (25_000, 0.075), (99_000, 0.001)] {
        let mean = moved(&[command(1, since.max(0), 1.0)]);
        let speed = 4.0 * (1.0 - (-2.0_f64 * h).exp());
        assert!((mean[1] - speed).abs() < 1e-12, "{since}: {} {speed}", mean[1]);
    }
    let two = moved(&[command(2, 50_000, 0.0), command(1, 0, 1.0)]);
    let speed = 4.0 * (1.0 - (-0.1_f64).exp()) * (-0.1_f64).exp();
    assert!((two[1] - speed).abs() < 1e-12);
}

#[test]
fn a_command_older_than_the_window_acts_from_the_windows_begin_if_it_is_the_newest() {
    let mut bench = Bench::new(0, |_| {});
    for k in 1..4 {
        bench.step(k, &[]);
    }
    bench.step(4, &[command(5, 150_000, 1.0)]);
    let speed = 4.0 * (1.0 - (-0.2_f64).exp());
    assert!((bench.0.posterior().modes[0].mean[1] - speed).abs() < 1e-12);
    bench.step(5, &[command(4, 140_000, -9.0)]);
    assert_eq!(
        bench.counters(),
        Counters {
            too_old: 1,
            ..Counters::default()
        }
    );
    let speed = 4.0 * (1.0 - (-0.4_f64).exp());
    assert!((bench.0.posterior().modes[0].mean[1] - speed).abs() < 1e-12);
}

#[test]
fn a_skipped_instant_takes_its_packets_with_the_next_step_if_the_window_allows() {
    for rollback_steps in [0, 1] {
        let mut bench = Bench::new(rollback_steps, |_| {});
        bench.step(1, &[encoder(1, 50_000)]);
        let mut record = StepRecord::new(3);
        bench.0.skip(&mut record);
        assert_eq!(record.verdict(), Verdict::NotEvaluated);
        assert_eq!(bench.0.posterior().instant_ns, 200_000_000);
        bench.step(3, &[encoder(2, 150_000), encoder(3, 250_000)]);
        let late = rollback_steps as u64;
        assert_eq!(
            (bench.counters().too_old, bench.counters().late_used),
            (1 - late, late)
        );
        assert_eq!(bench.0.posterior().instant_ns, 300_000_000);
    }
}

#[test]
fn before_the_first_step_a_skip_is_only_a_start() {
    let mut bench = Bench::new(0, |_| {});
    let mut record = StepRecord::new(3);
    bench.0.skip(&mut record);
    assert_eq!(record.verdict(), Verdict::Starting);
    bench.step(7, &[encoder(1, 650_000)]);
    assert_eq!(bench.0.posterior().instant_ns, 700_000_000);
    assert_eq!(bench.counters(), Counters::default());
}

#[test]
fn an_instant_that_repeats_takes_packets_but_fuses_nothing() {
    let mut bench = Bench::new(1, |_| {});
    bench.step(1, &[encoder(1, 50_000)]);
    let before = bench.0.posterior().clone();
    let record = bench.step(1, &[encoder(2, 60_000)]);
    assert_eq!(record.verdict(), Verdict::NotEvaluated);
    assert_eq!(*bench.0.posterior(), before);
    bench.step(2, &[]);
    assert_eq!(bench.0.recomputed_from(), 1);
    assert_eq!(
        bench.counters(),
        Counters {
            late_used: 1,
            ..Counters::default()
        }
    );
}

#[test]
fn the_start_up_is_reported_as_such_for_its_steps() {
    let mut bench = Bench::new(0, |settings| settings.startup_steps = 2);
    let verdicts = (1..5).map(|k| bench.step(k, &[encoder(k as u64, k * PERIOD_US)]).verdict());
    let verdicts: Vec<_> = verdicts.collect();
    assert_eq!(
        verdicts,
        [
            Verdict::Starting,
            Verdict::Starting,
            Verdict::Nominal,
            Verdict::Nominal
        ]
    );
}
