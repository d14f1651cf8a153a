//! One step of every diagnoser of the demonstration: from the samples in the inboxes to the finished record, in the
//! real engine with a simulated clock, on the data of its scenario (fault included). Time per step as percentiles.
#![allow(
    clippy::expect_used,
    missing_docs,
    reason = "a benchmark stops on its first mistake"
)]

use hdrhistogram::Histogram;
use residual_shared::alarm::AlarmTransition;
use residual_shared::clock::monotonic_ns;
use residual_shared::record::StepRecord;
use residual_shared::sample::SampleHeader;
use residuald::assembly::assemble;
use residuald::configuration::Configuration;
use residuald::demo::plants::aircraft::Disturbance;
use residuald::demo::plants::{Emission, Merged};
use residuald::demo::scenario::{SCENARIOS, Scenario, Variation};
use residuald::runtime::engine::RecordSink;
use std::collections::HashMap;
use std::hint::black_box;

/// Runs of each scenario; the first one warms up and does not count.
const RUNS: usize = 30;

const EPOCH_NS: u64 = 1_000_000_000_000;

struct Discard;

impl RecordSink for Discard {
    fn publish(&mut self, _slot: usize, record: &StepRecord) -> bool {
        black_box(record);
        true
    }

    fn alarm(&mut self, transition: &AlarmTransition) {
        black_box(transition);
    }
}

fn main() {
    println!(
        "step time, ns; {} cores",
        std::thread::available_parallelism().map_or(0, usize::from)
    );
    println!(
        "{:22} {:22} {:>8} {:>8} {:>8} {:>8} {:>8}",
        "method", "diagnoser", "steps", "p50", "p99", "p99.9", "max"
    );
    for scenario in SCENARIOS {
        let loaded = Configuration::from_text(scenario.name, scenario.example.configuration)
            .expect("a good configuration");
        for expectation in scenario.expectations {
            let times = times(&loaded, scenario, expectation.diagnoser);
            println!(
                "{:22} {:22} {:8} {:8} {:8} {:8} {:8}",
                scenario.method,
                expectation.diagnoser,
                times.len(),
                times.value_at_quantile(0.5),
                times.value_at_quantile(0.99),
                times.value_at_quantile(0.999),
                times.max()
            );
        }
    }
}

/// Step times of one diagnoser of a scenario, alone in its engine.
fn times(loaded: &residuald::configuration::Loaded, scenario: &Scenario, diagnoser: &str) -> Histogram<u64> {
    let mut configuration = loaded.configuration.clone();
    let built = loaded.on_gains(scenario.name, scenario.example.gains);
    let mut built = built.expect("gains of this configuration");
    let slot = configuration
        .diagnosers
        .iter()
        .position(|configured| configured.name == diagnoser);
    let slot = slot.expect("a diagnoser of the configuration");
    configuration.diagnosers = vec![configuration.diagnosers.swap_remove(slot)];
    let built = vec![built.swap_remove(slot)];
    let inputs: HashMap<&str, usize> = configuration
        .inputs
        .iter()
        .enumerate()
        .map(|(place, input)| (input.name.as_str(), place))
        .collect();
    let mut all = Histogram::new(3).expect("three digits");
    for run in 0..RUNS {
        let mut engine = assemble(&configuration, built.clone(), EPOCH_NS, 1.0);
        let mut sequences = vec![0; configuration.inputs.len()];
        for emission in emissions(scenario, run as u64) {
            let now_ns = EPOCH_NS + emission.time_ns;
            while let Some(due_ns) = engine.next_due_ns().filter(|&due_ns| due_ns < now_ns) {
                engine.step_due(due_ns, monotonic_ns, &mut Discard);
            }
            let Some(&input) = inputs.get(emission.input) else {
                continue;
            };
            let header = SampleHeader {
                sequence: sequences[input],
                timestamp_ns: now_ns,
            };
            sequences[input] += 1;
            if let Some(elements) = emission.elements {
                engine.accept(input, 1, header, &elements, now_ns);
            }
        }
        if run > 0 {
            all.add(engine.step_times_ns()).expect("one range");
        }
    }
    all
}

fn emissions(scenario: &Scenario, seed: u64) -> Vec<Emission> {
    let variation = Variation {
        seed,
        disturbance: Disturbance::Sine,
    };
    Merged::new((scenario.plants)(&variation)).collect()
}
