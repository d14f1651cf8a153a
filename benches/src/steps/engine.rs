//! Steps in the real engine with a simulated clock: from the samples in the inboxes to the finished record.
//!
//! The diagnosers of the demonstration run on the data of its scenarios, fault included; besides, the cases of this module
//! that stand for their methods, with 4 and 6 states.

use std::collections::BTreeMap;
use std::hint::black_box;

use anyhow::{Context, Result};
use hdrhistogram::Histogram;
use residual_diagnosis::diagnoser::PacketSource;
use residual_diagnosis::method::Designed;
use residual_shared::alarm::AlarmTransition;
use residual_shared::clock::monotonic_ns;
use residual_shared::record::StepRecord;
use residual_shared::sample::SampleHeader;
use residuald::assembly::assemble;
use residuald::configuration::Configuration;
use residuald::demo::plants::Merged;
use residuald::demo::plants::aircraft::Disturbance;
use residuald::demo::scenario::{SCENARIOS, Scenario, Variation};
use residuald::runtime::engine::RecordSink;
use toml::{Table as Toml, Value};

use super::recording::Sample;
use super::{Case, Watched, cases};
use crate::percentiles::{Percentiles, duration, times};
use crate::results::{Finding, Results, Table};

const EPOCH_NS: u64 = 1_000_000_000_000;

/// A sample on its way to an inbox.
struct Arrival {
    time_ns: u64,
    input: usize,
    /// `None`: lost on the way; its number is used up all the same.
    elements: Option<Vec<f64>>,
}

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

/// Measures the diagnosers of all five methods, and adds tables and findings.
///
/// # Errors
/// A configuration is refused.
pub fn all_five(results: &mut Results, quick: bool) -> Result<()> {
    let mut table = Table::of_percentiles(
        "Steps in the engine: diagnosers of the demonstration",
        &["method", "diagnoser"],
    );
    let mut dearest: BTreeMap<&str, u64> = BTreeMap::new();
    for scenario in SCENARIOS.iter().filter(|scenario| scenario.in_all) {
        for expectation in scenario.expectations {
            let times = Percentiles::of(&of_scenario(
                scenario,
                expectation.diagnoser,
                if quick { 5 } else { 30 },
            )?);
            table.percentiles([scenario.method, expectation.diagnoser], &times);
            let so_far = dearest.entry(scenario.method).or_default();
            *so_far = times.p50.max(*so_far);
        }
    }
    let plants = "demonstration's own plants, the dearest diagnoser of each method";
    total(results, &mut table, plants, dearest.values().sum());
    results.tables.push(table);
    let title = "Steps in the engine: every method as configured without options";
    let mut table = Table::of_percentiles(title, &["case", "states"]);
    for states in [4, 6] {
        let mut total_ns = 0;
        for case in cases()
            .iter()
            .filter(|case| case.is_default && case.states == states)
        {
            let times = Percentiles::of(&of_case(case, if quick { 40 } else { 400 })?);
            table.percentiles([case.name(), states.to_string()], &times);
            total_ns += times.p50;
        }
        total(
            results,
            &mut table,
            &format!("plants with {states} states"),
            total_ns,
        );
    }
    results.tables.push(table);
    Ok(())
}

fn total(results: &mut Results, table: &mut Table, plants: &str, total_ns: u64) {
    let mut row = vec![
        "all five".to_owned(),
        plants.to_owned(),
        String::new(),
        duration(total_ns as f64),
    ];
    row.resize(table.columns.len(), String::new());
    table.row(row);
    let what = format!("one step of all five diagnosers in the engine, {plants}: sum of the p50");
    results
        .findings
        .push(Finding::at_most(what, total_ns as f64 / 1e3, 10.0, "µs"));
}

/// Step times of one diagnoser of a scenario, alone in its engine; the first run warms up and does not count.
fn of_scenario(scenario: &Scenario, diagnoser: &str, runs: u64) -> Result<Histogram<u64>> {
    let loaded = Configuration::from_text(scenario.name, scenario.example.configuration)?;
    let mut built = loaded.on_gains(scenario.name, scenario.example.gains)?;
    let mut configuration = loaded.configuration.clone();
    let mut slots = configuration.diagnosers.iter();
    let slot = slots.position(|configured| configured.name == diagnoser);
    let slot = slot.with_context(|| format!("{} has no diagnoser {diagnoser}", scenario.name))?;
    configuration.diagnosers = vec![configuration.diagnosers.swap_remove(slot)];
    let built = built.swap_remove(slot);
    let mut all = times();
    for seed in 0..=runs {
        let variation = Variation {
            seed,
            disturbance: Disturbance::Sine,
        };
        let arrivals = Merged::new((scenario.plants)(&variation)).filter_map(|emission| {
            let mut inputs = configuration.inputs.iter();
            Some(Arrival {
                time_ns: emission.time_ns,
                input: inputs.position(|input| input.name == emission.input)?,
                elements: emission.elements,
            })
        });
        let of_run = step_times(&configuration, built.clone(), arrivals);
        if seed > 0 {
            all.add(of_run)?;
        }
    }
    Ok(all)
}

/// Step times of a case whose recording is repeated so often.
fn of_case(case: &Case, repetitions: usize) -> Result<Histogram<u64>> {
    let watched = case.watched()?;
    let text = toml::to_string(&configuration(case, &watched)?)?;
    let loaded = Configuration::from_text("case.toml", &text).with_context(|| case.name())?;
    let built = loaded.build_diagnosers().with_context(|| case.name())?;
    let built = built
        .into_iter()
        .next()
        .context("a configuration without diagnoser")?;
    let recording = &watched.recording;
    let samples = recording
        .instants
        .iter()
        .cycle()
        .take(repetitions * recording.instants.len());
    let arrivals = samples.enumerate().flat_map(|(k, sample)| {
        let now_ns = (1 + k as u64) * recording.period_ns;
        arrivals(sample, now_ns)
    });
    let mut all = times();
    all.add(step_times(&loaded.configuration, built, arrivals))?;
    Ok(all)
}

/// Drives one diagnoser through all arrivals.
fn step_times(
    configuration: &Configuration,
    built: Designed,
    arrivals: impl Iterator<Item = Arrival>,
) -> Histogram<u64> {
    let mut engine = assemble(configuration, vec![built], EPOCH_NS, 1.0);
    let mut sequences = vec![0; configuration.inputs.len()];
    for Arrival {
        time_ns,
        input,
        elements,
    } in arrivals
    {
        let now_ns = EPOCH_NS + time_ns;
        while let Some(due_ns) = engine.next_due_ns().filter(|&due_ns| due_ns < now_ns) {
            engine.step_due(due_ns, monotonic_ns, &mut Discard);
        }
        let header = SampleHeader {
            sequence: sequences[input],
            timestamp_ns: now_ns,
        };
        sequences[input] += 1;
        if let Some(elements) = elements {
            engine.accept(input, 1, header, &elements, now_ns);
        }
    }
    engine.step_times_ns().clone()
}

/// The samples of one instant, in order of time. Inputs: the sensors, then the commands.
fn arrivals(sample: &Sample, now_ns: u64) -> Vec<Arrival> {
    if sample.packets.is_empty() {
        let both = [&sample.measurements, &sample.commands].into_iter().enumerate();
        let arrival = |(input, elements): (usize, &Vec<f64>)| Arrival {
            time_ns: now_ns,
            input,
            elements: Some(elements.clone()),
        };
        return both.map(arrival).collect();
    }
    let sensors = sensor_rows(sample).len();
    let packets = sample.packets.iter().map(|packet| Arrival {
        time_ns: now_ns - packet.before_ns,
        input: match packet.source {
            PacketSource::Sensor(sensor) => sensor,
            PacketSource::Commands => sensors,
        },
        elements: Some(packet.values.clone()),
    });
    packets.collect()
}

/// Rows of every sensor; one sensor with all rows where there are no packets.
fn sensor_rows(sample: &Sample) -> Vec<usize> {
    let sensors = sample
        .packets
        .iter()
        .filter(|packet| packet.source != PacketSource::Commands);
    let rows: Vec<usize> = sensors.map(|packet| packet.values.len()).collect();
    if rows.is_empty() {
        vec![sample.measurements.len()]
    } else {
        rows
    }
}

/// The configuration of a daemon with this case as its only diagnoser.
fn configuration(case: &Case, watched: &Watched) -> Result<Toml> {
    let sample = watched.recording.instants.first().context("an empty recording")?;
    let text = |text: String| Value::String(text);
    let mut inputs = Vec::new();
    let mut input = |name: String, signals: usize| {
        let names: Vec<Value> = (0..signals)
            .map(|signal| text(format!("signal_{signal}")))
            .collect();
        let references = (0..signals)
            .map(|signal| text(format!("{name}.signal_{signal}")))
            .collect();
        inputs.push(Value::Table(Toml::from_iter([
            ("name".to_owned(), text(name)),
            ("signals".to_owned(), Value::Array(names)),
        ])));
        Value::Array(references)
    };
    let mut measurements = Vec::new();
    for (number, rows) in sensor_rows(sample).into_iter().enumerate() {
        if let Value::Array(references) = input(format!("sensor_{number}"), rows) {
            measurements.extend(references);
        }
    }
    let commands = input("commands".to_owned(), sample.commands.len());
    let mut diagnoser = Toml::from_iter([
        ("name".to_owned(), text("case".to_owned())),
        ("method".to_owned(), text(case.method.to_owned())),
        (
            "sample_time_s".to_owned(),
            Value::Float(watched.recording.period_ns as f64 * 1e-9),
        ),
        ("measurements".to_owned(), Value::Array(measurements)),
        ("commands".to_owned(), commands),
    ]);
    diagnoser.extend(watched.tables.clone());
    let daemon = Toml::from_iter([("instance".to_owned(), text("steps".to_owned()))]);
    Ok(Toml::from_iter([
        ("daemon".to_owned(), Value::Table(daemon)),
        ("input".to_owned(), Value::Array(inputs)),
        (
            "diagnoser".to_owned(),
            Value::Array(vec![Value::Table(diagnoser)]),
        ),
    ]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cases_run_in_the_engine() {
        for case in cases().iter().filter(|case| case.is_default && case.states == 4) {
            let times = of_case(case, 2).unwrap();
            assert!(times.len() > 120, "{}: {} steps", case.name(), times.len());
        }
    }
}
