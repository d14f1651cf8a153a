//! One step of the bank of the VTOL example (fault-free filter and two single-fault filters), fault-free data.
#![allow(
    clippy::expect_used,
    missing_docs,
    reason = "a benchmark stops on its first mistake"
)]

use criterion::{Criterion, criterion_group, criterion_main};
use residual_diagnosis::diagnoser::{Diagnoser, StepInput, StepRecord};
use residuald::configuration::Configuration;
use residuald::demo::plants::aircraft::{Aircraft, Disturbance};

const CONFIGURATION: &str = include_str!("../../deploy/config/vtol.toml");

/// A change of the configuration's text.
type Edit = fn(String) -> String;

/// The bank of the example configuration after `edit` of its text.
fn bank(edit: Edit) -> Box<dyn Diagnoser> {
    let loaded = Configuration::from_text("vtol.toml", &edit(CONFIGURATION.into()));
    let designed = loaded.and_then(|loaded| loaded.design(&mut |_, _| ()));
    let mut diagnosers = designed.expect("a good configuration").diagnosers;
    diagnosers.remove(0).diagnoser
}

fn step(criterion: &mut Criterion) {
    let mut aircraft = Aircraft::new(1, Disturbance::Sine, 1);
    let samples: Vec<([f64; 4], [f64; 2])> = (0..100)
        .map(|_| {
            let sample = (aircraft.measure(), aircraft.command());
            aircraft.advance();
            sample
        })
        .collect();
    let forms: [(&str, Edit); 3] = [
        ("row-wise gain", |text| text),
        ("fixed gain", |text| {
            text.replace("gain = \"row_wise\"", "gain = \"fixed\"")
        }),
        ("Frobenius gain, 30 generators", |text| {
            text.replace("gain = \"row_wise\"", "gain = \"frobenius\"")
        }),
    ];
    let mut group = criterion.benchmark_group("bank of 3 filters with 4 states");
    for (name, edit) in forms {
        let mut diagnoser = bank(edit);
        let mut record = StepRecord::new(diagnoser.description().channels.len());
        let mut samples = samples.iter().cycle();
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                if let Some((measurements, commands)) = samples.next() {
                    diagnoser.step(&StepInput::new(measurements, commands), &mut record);
                }
            });
        });
    }
    group.finish();
}

criterion_group!(benches, step);
criterion_main!(benches);
