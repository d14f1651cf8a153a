//! Going back to late packets gives the very state of packets that came in order.

use crate::servo::{Arrival, arrivals, servo, settings, step};
use crate::simulation::Draw;
use residual_diagnosis::async_imm::{
    AsyncImm,
    design::{Form, ImmDesign},
    state::Posterior,
};
use residual_diagnosis::diagnoser::{Diagnoser, PacketSource};

const PERIOD_US: i64 = 100_000;
const STEPS: i64 = 30;

/// Packets of the servo with delays of up to `longest_us` (commands at most a period), in order of arrival.
fn delayed(draw: &mut Draw, longest_us: f64) -> Vec<Arrival> {
    let (file, _) = servo();
    let mut packets: Vec<Arrival> = arrivals(&file)
        .into_iter()
        .filter(|arrival| arrival.values.iter().all(|value| value.is_finite()))
        .filter(|arrival| arrival.time_us > 0)
        .collect();
    packets.sort_by_key(|arrival| (arrival.time_us, arrival.sequence));
    packets.dedup_by_key(|arrival| (arrival.time_us, arrival.sequence));
    for arrival in &mut packets {
        let longest_us = match arrival.source {
            PacketSource::Commands => longest_us.min(PERIOD_US as f64),
            PacketSource::Sensor(_) => longest_us,
        };
        arrival.at_us = arrival.time_us + (draw.uniform() * longest_us) as i64;
    }
    packets.sort_by_key(|arrival| arrival.at_us);
    packets
}

/// The fusion instant that receives what comes at `time_us`, or whose interval holds it.
fn interval(time_us: i64) -> i64 {
    (time_us + PERIOD_US - 1) / PERIOD_US
}

/// Runs a diagnoser; the posteriors after every instant.
fn run(design: &ImmDesign, arrivals: &[Arrival], rollback_steps: usize) -> (AsyncImm, Vec<Posterior>) {
    let mut diagnoser = AsyncImm::new(design, settings(design, PERIOD_US, rollback_steps)).unwrap();
    let mut posteriors = Vec::new();
    for k in 1..=STEPS {
        step(&mut diagnoser, arrivals, (k - 1) * PERIOD_US, k * PERIOD_US);
        posteriors.push(diagnoser.posterior().clone());
    }
    (diagnoser, posteriors)
}

/// The same packets without delay.
fn in_order(packets: impl Iterator<Item = Arrival>) -> Vec<Arrival> {
    let mut packets: Vec<_> = packets
        .map(|arrival| Arrival {
            at_us: arrival.time_us,
            ..arrival
        })
        .collect();
    packets.sort_by_key(|arrival| arrival.at_us);
    packets
}

fn forms() -> [ImmDesign; 2] {
    [Form::Sequential, Form::SequentialSquareRoot].map(|form| ImmDesign { form, ..servo().1 })
}

#[test]
fn the_state_is_that_of_the_accepted_packets_in_order_bit_for_bit() {
    let mut compared = 0;
    for (seed, design) in forms().iter().enumerate() {
        for rollback_steps in [0, 1, 3] {
            let mut packets = delayed(&mut Draw::new(seed as u64), 450_000.0);
            if rollback_steps == 0 {
                // A command is used however late it is, but then from the window's begin on: not in order.
                packets.retain(|arrival| matches!(arrival.source, PacketSource::Sensor(_)));
            }
            let (_, posteriors) = run(design, &packets, rollback_steps);
            for k in [5, 17, STEPS] {
                let used = packets.iter().filter(|arrival| {
                    let received = interval(arrival.at_us);
                    received <= k && interval(arrival.time_us) >= received - rollback_steps as i64
                });
                let (_, expected) = run(design, &in_order(used.cloned()), 0);
                assert_eq!(
                    posteriors[k as usize - 1],
                    expected[k as usize - 1],
                    "W = {rollback_steps}, k = {k}"
                );
                compared += 1;
            }
        }
    }
    assert_eq!(compared, 18);
}

#[test]
fn with_delays_within_the_window_the_state_behind_it_is_that_without_delay() {
    for design in &forms() {
        let packets = delayed(&mut Draw::new(9), 200_000.0);
        let (_, ideal) = run(design, &in_order(packets.iter().cloned()), 0);
        let mut diagnoser = AsyncImm::new(design, settings(design, PERIOD_US, 2)).unwrap();
        for k in 1..=STEPS {
            step(&mut diagnoser, &packets, (k - 1) * PERIOD_US, k * PERIOD_US);
            if k > 2 {
                let behind = diagnoser.earlier_posterior(2).unwrap();
                assert_eq!(*behind, ideal[k as usize - 3], "{k}");
            }
        }
        assert_eq!(diagnoser.counters().too_old, 0);
        assert!(diagnoser.counters().late_used > 50);
        assert!(diagnoser.earlier_posterior(4).is_none());
    }
}

#[test]
fn the_order_of_arrival_before_an_instant_does_not_matter() {
    let (_, design) = servo();
    let packets = in_order(delayed(&mut Draw::new(2), 1.0).into_iter());
    let mut shuffled = packets.clone();
    for arrival in &mut shuffled {
        arrival.at_us = interval(arrival.time_us) * PERIOD_US;
    }
    shuffled.reverse();
    let ((_, one), (_, other)) = (run(&design, &packets, 1), run(&design, &shuffled, 1));
    assert_eq!(one, other);
}

#[test]
fn a_saved_state_with_packets_on_their_way_goes_on_to_the_last_bit() {
    let (_, design) = servo();
    let packets = delayed(&mut Draw::new(4), 350_000.0);
    for pause in [1, 7, 20] {
        let mut diagnoser = AsyncImm::new(&design, settings(&design, PERIOD_US, 2)).unwrap();
        let mut other = diagnoser.clone();
        for k in 1..=STEPS {
            let record = step(&mut diagnoser, &packets, (k - 1) * PERIOD_US, k * PERIOD_US);
            if k > pause {
                let again = step(&mut other, &packets, (k - 1) * PERIOD_US, k * PERIOD_US);
                assert!(record.same_bits(&again));
                assert_eq!(diagnoser.posterior(), other.posterior());
            }
            if k == pause {
                let mut state = Vec::new();
                diagnoser.save(&mut state);
                other.restore(&state).unwrap();
            }
        }
        assert_eq!(diagnoser.counters(), other.counters());
    }
}
