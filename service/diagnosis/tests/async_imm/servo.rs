//! `servo_late_packets.json`: the diagnoser with late, duplicate, reordered, lost, damaged and early packets.

use crate::fixture::{dense, design, file, instants};
use crate::support::{assert_close, integers, numbers, rows};
use residual_diagnosis::async_imm::{
    AsyncImm,
    decision::DecisionRule,
    design::{ImmDesign, ModeTransition},
    fusion::Fusion,
    settings::Settings,
};
use residual_diagnosis::diagnoser::{Diagnoser, PacketHeader, PacketSource, Packets, StepInput, StepRecord};
use serde_json::Value;

/// One packet on its way: arrival (µs) and content.
#[derive(Clone, Debug)]
pub struct Arrival {
    pub at_us: i64,
    pub source: PacketSource,
    pub sequence: u64,
    pub time_us: i64,
    pub values: Vec<f64>,
}

/// Settings for these tests.
pub fn settings(design: &ImmDesign, period_us: i64, rollback_steps: usize) -> Settings {
    let (_, inputs, channels) = design.plant.sizes();
    Settings {
        period_ns: period_us * 1000,
        decision: DecisionRule {
            threshold: 0.9,
            window_steps: 2,
        },
        amplitude_bound_standard_deviations: 2.0,
        startup_steps: 0,
        rollback_steps,
        max_packets_per_step: 64,
        max_ahead_ns: 2_000_000_000,
        initial_command: vec![0.0; inputs],
        channels: (0..channels)
            .map(|c| (format!("channel {c}"), String::new()))
            .collect(),
    }
}

/// Steps at `instant_us` with everything that arrived in (`since_us`, `instant_us`].
pub fn step(diagnoser: &mut AsyncImm, arrivals: &[Arrival], since_us: i64, instant_us: i64) -> StepRecord {
    let mut headers = Vec::new();
    let mut values = Vec::new();
    for arrival in arrivals
        .iter()
        .filter(|arrival| since_us < arrival.at_us && arrival.at_us <= instant_us)
    {
        headers.push(PacketHeader {
            source: arrival.source,
            sequence: arrival.sequence,
            time_ns: arrival.time_us as u64 * 1000,
            start: values.len(),
            length: arrival.values.len(),
        });
        values.extend_from_slice(&arrival.values);
    }
    let mut record = StepRecord::new(diagnoser.description().channels.len());
    let input = StepInput {
        instant_ns: instant_us as u64 * 1000,
        measurements: &[],
        commands: &[],
        packets: Packets::new(&headers, &values),
    };
    diagnoser.step(&input, &mut record);
    record
}

/// The design of the file, with its rates.
pub fn servo() -> (Value, ImmDesign) {
    let file = file("servo_late_packets.json");
    let mut design = design(&file, "default");
    design.transition = ModeTransition::Rate(dense(&file["mode_transition_rate_per_second"]));
    (file, design)
}

/// The packets of the file in order of arrival, and its commands, which are known in time.
pub fn arrivals(file: &Value) -> Vec<Arrival> {
    let packets = &file["packets"];
    let [at, sensor, sequence, time] =
        ["arrival_time_us", "sensor", "sequence", "time_us"].map(|key| integers(&packets[key]));
    let values = rows(&packets["value"]);
    let changes = integers(&file["input"]["change_time_us"]);
    let inputs = rows(&file["input"]["value"]);
    let command = |(i, time): (usize, &usize)| Arrival {
        at_us: (*time).max(1) as i64,
        source: PacketSource::Commands,
        sequence: i as u64,
        time_us: *time as i64,
        values: inputs[i].clone(),
    };
    let packet = |i: usize| Arrival {
        at_us: at[i] as i64,
        source: PacketSource::Sensor(sensor[i]),
        sequence: sequence[i] as u64,
        time_us: time[i] as i64,
        values: values[i].clone(),
    };
    let mut all: Vec<Arrival> = changes.iter().enumerate().map(command).collect();
    all.extend((0..at.len()).map(packet));
    all.sort_by_key(|arrival| arrival.at_us);
    all
}

#[test]
fn late_duplicate_damaged_and_early_packets_reproduce() {
    let (file, design) = servo();
    let mut diagnoser = AsyncImm::new(&design, settings(&design, 100_000, 2)).unwrap();
    let (arrivals, expected) = (arrivals(&file), &file["expected"]["default"]);
    let mut fusion = Fusion::new(&design);
    let mut since = 0;
    for (row, instant) in instants(&file).into_iter().enumerate() {
        let record = step(&mut diagnoser, &arrivals, since, instant);
        since = instant;
        let (what, list) = (format!("instant {}", row + 1), |key: &str| {
            numbers(&expected[key][row])
        });
        let posterior = diagnoser.posterior();
        let mu = fusion.read_probability(posterior).to_vec();
        for (mu, expected) in mu.iter().zip(list("mode_probability")) {
            assert!((mu - expected).abs() < 1e-11, "{what}: {mu} {expected}");
        }
        let (mean, covariance) = fusion.fuse(posterior);
        assert_close(&what, mean, &list("fused_state"), 1e-10);
        let variance = covariance.to_dense().diagonal();
        assert_close(&what, variance.as_slice(), &list("fused_variance"), 1e-10);
        assert_eq!(
            diagnoser.declared_mode(),
            integers(&expected["declared_mode"])[row],
            "{what}"
        );
        assert_eq!(
            diagnoser.fault_detected(),
            expected["fault_detected"][row].as_bool().unwrap()
        );
        let from = integers(&expected["recomputed_from_step"])[row] as u64;
        assert_eq!(diagnoser.recomputed_from(), from, "{what}");
        let amplitude = record.channels()[2];
        assert_close(&what, &[amplitude.residual], &list("amplitude"), 1e-10);
        let half_width = [(amplitude.upper - amplitude.lower) / 4.0];
        assert_close(&what, &half_width, &list("amplitude_standard_deviation"), 1e-10);
    }
    let counts = &expected["counts"];
    let counters = diagnoser.counters();
    for (actual, key) in [
        (counters.non_finite, "non_finite"),
        (counters.duplicate, "duplicate"),
        (counters.too_old, "too_old"),
        (counters.late_used, "late_used"),
    ] {
        assert_eq!(actual, counts[key].as_u64().unwrap(), "{key}");
    }
    let last = instants(&file).last().copied().unwrap();
    let rest = arrivals.iter().filter(|arrival| arrival.at_us > last).count();
    assert_eq!(rest as u64, counts["arrived_after_last_step"].as_u64().unwrap());
    let final_mu = numbers(&expected["final_mode_probability_of_in_order_filter"]);
    assert_close("in order", fusion.probability(), &final_mu, 1e-11);
    let final_state = numbers(&expected["final_fused_state_of_in_order_filter"]);
    assert_close(
        "in order",
        fusion.fuse(diagnoser.posterior()).0,
        &final_state,
        1e-11,
    );
}
