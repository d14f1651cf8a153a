//! All methods together in one engine, and samples of their plants.

use std::path::Path;
use std::sync::{LazyLock, Mutex};

use residual_diagnosis::method::Designed;
use residual_shared::alarm::AlarmTransition;
use residual_shared::record::StepRecord;
use residual_shared::sample::SampleHeader;
use residuald::assembly::assemble;
use residuald::configuration::{Configuration, SignalReference};
use residuald::demo::composition::compose;
use residuald::demo::plants::Merged;
use residuald::demo::plants::aircraft::Disturbance;
use residuald::demo::scenario::{self, Variation};
use residuald::runtime::engine::{Engine, RecordSink};

/// The simulated epoch.
pub const EPOCH_NS: u64 = 1_000_000_000_000;
/// One second.
pub const SECOND_NS: u64 = 1_000_000_000;

/// A configuration with its diagnosers.
#[derive(Clone)]
pub struct Setup {
    pub configuration: Configuration,
    pub diagnosers: Vec<Designed>,
}

/// One sample on its way to the engine.
pub struct Sample {
    pub now_ns: u64,
    pub input: &'static str,
    pub header: SampleHeader,
    pub elements: Vec<f64>,
}

/// The record of a diagnoser.
pub struct Said {
    pub diagnoser: String,
    pub record: StepRecord,
}

/// Everything that the engine of a setup has said since the last look.
#[derive(Default)]
pub struct Records {
    pub names: Vec<String>,
    pub list: Vec<Said>,
    /// Transitions of alarms, by diagnoser.
    pub alarms: Vec<(String, AlarmTransition)>,
}

impl RecordSink for Records {
    fn publish(&mut self, slot: usize, record: &StepRecord) -> bool {
        self.list.push(Said {
            diagnoser: self.names[slot].clone(),
            record: *record,
        });
        true
    }

    fn alarm(&mut self, transition: &AlarmTransition) {
        self.alarms.push((
            self.names[transition.slot as usize].clone(),
            AlarmTransition {
                slot: 0,
                ..*transition
            },
        ));
    }
}

static ALL: LazyLock<Mutex<Setup>> = LazyLock::new(|| {
    let examples: Vec<_> = scenario::of_all_methods()
        .iter()
        .map(|scenario| scenario.example)
        .collect();
    let composed = compose(&examples, &"all".parse().unwrap(), Path::new("all.gains.toml")).unwrap();
    let loaded = Configuration::from_text("all", &composed.configuration).unwrap();
    Mutex::new(Setup {
        diagnosers: loaded.on_gains("all.gains.toml", &composed.gains).unwrap(),
        configuration: loaded.configuration,
    })
});

impl Setup {
    /// All methods.
    pub fn all() -> Self {
        ALL.lock().unwrap().clone()
    }

    /// The inputs and some of the diagnosers of this one, each in the given order.
    pub fn arranged(&self, inputs: &[usize], diagnosers: &[usize]) -> Self {
        let mut configuration = self.configuration.clone();
        configuration.inputs = inputs
            .iter()
            .map(|&input| self.configuration.inputs[input].clone())
            .collect();
        configuration.diagnosers = diagnosers
            .iter()
            .map(|&slot| self.configuration.diagnosers[slot].clone())
            .collect();
        let renumber = |signals: &mut Vec<SignalReference>| {
            for signal in signals {
                signal.input = inputs.iter().position(|&input| input == signal.input).unwrap();
            }
        };
        for diagnoser in &mut configuration.diagnosers {
            renumber(&mut diagnoser.measurements);
            renumber(&mut diagnoser.commands);
            for condition in &mut diagnoser.lifecycle.enable {
                condition.signal.input = inputs
                    .iter()
                    .position(|&input| input == condition.signal.input)
                    .unwrap();
            }
        }
        Self {
            configuration,
            diagnosers: diagnosers
                .iter()
                .map(|&slot| self.diagnosers[slot].clone())
                .collect(),
        }
    }

    /// An engine of it.
    pub fn engine(&self) -> Engine {
        assemble(&self.configuration, self.diagnosers.clone(), EPOCH_NS, 1.0)
    }

    /// What takes its records.
    pub fn records(&self) -> Records {
        Records {
            names: (self.configuration.diagnosers.iter())
                .map(|diagnoser| diagnoser.name.clone())
                .collect(),
            ..Records::default()
        }
    }

    /// The longest transport allowance, nanoseconds.
    pub fn longest_margin_ns(&self) -> u64 {
        let margins = self.configuration.diagnosers.iter().map(|d| d.margin_ns);
        margins.max().unwrap()
    }

    /// Hands a sample to an engine of it, after every step that is due before.
    pub fn feed(&self, engine: &mut Engine, sample: &Sample, records: &mut Records) {
        step_before(engine, sample.now_ns, records);
        let input = (self.configuration.inputs.iter()).position(|input| input.name == sample.input);
        if let Some(input) = input {
            engine.accept(input, 1, sample.header, &sample.elements, sample.now_ns);
        }
    }
}

/// Does every step that is due before `now_ns`, each at its own time.
pub fn step_before(engine: &mut Engine, now_ns: u64, records: &mut Records) {
    while let Some(due_ns) = engine.next_due_ns().filter(|&due_ns| due_ns < now_ns) {
        engine.step_due(due_ns, || 0, records);
    }
}

/// The samples of all plants in the first `seconds`, some late, some doubled, some not finite.
pub fn samples(seed: u64, seconds: u64) -> Vec<Sample> {
    let variation = Variation {
        seed,
        disturbance: Disturbance::Sine,
    };
    let plants = (scenario::of_all_methods().into_iter()).flat_map(|scenario| (scenario.plants)(&variation));
    let mut sequences = std::collections::HashMap::new();
    let mut samples = Vec::new();
    for emission in Merged::new(plants.collect()) {
        if emission.time_ns > seconds * SECOND_NS {
            break;
        }
        let now_ns = EPOCH_NS + emission.time_ns;
        let sequence: &mut u64 = sequences.entry(emission.input).or_default();
        let number = samples.len();
        let (late, doubled) = (number % 43 == 42, number % 61 == 60);
        let header = SampleHeader {
            sequence: *sequence - u64::from(doubled && *sequence > 0),
            timestamp_ns: now_ns - if late { 15_000_000 } else { 0 },
        };
        *sequence += 1;
        let Some(mut elements) = emission.elements else {
            continue;
        };
        if number % 37 == 36 {
            elements[0] = f64::NAN;
        }
        samples.push(Sample {
            now_ns,
            input: emission.input,
            header,
            elements,
        });
    }
    samples
}

/// Fails unless both lists hold the same records, bit for bit.
pub fn assert_same(what: &str, one: &[Said], other: &[Said]) {
    for (number, (one, other)) in one.iter().zip(other).enumerate() {
        assert_eq!(one.diagnoser, other.diagnoser, "{what}, record {number}");
        assert!(
            one.record.same_bits(&other.record),
            "{what}, record {number} of {}: {:?}\n{:?}",
            one.diagnoser,
            one.record,
            other.record
        );
    }
    assert_eq!(one.len(), other.len(), "{what}");
}
