//! Many diagnosers of all five methods in one daemon, every one stepped 100 times a second.
//!
//! The examples of `deploy/config` are the five kinds. Those with another period are read as models of 10 ms: a discrete
//! model as it is, the continuous one of the turning target with its time scaled, so that a step does the same work.

use anyhow::{Context, Result, ensure};
use clap::{Args, ValueEnum};
use residual_diagnosis::method::Designed;
use residual_shared::names::{Instance, InstanceName};
use residuald::configuration::{
    Configuration, DiagnoserConfiguration, InputConfiguration, Loaded, SignalReference,
};
use toml::{Table, Value};

/// Period of every diagnoser, nanoseconds.
pub const PERIOD_NS: u64 = 10_000_000;

/// Transport allowance of every diagnoser, seconds.
const MARGIN_S: f64 = 0.004;

/// How much faster than written the time of the turning target runs.
const TARGET_SPEED: f64 = 100.0;

/// Kinds of diagnosers, one for each method.
pub const KINDS: usize = 5;

/// The configurations of the kinds.
const EXAMPLES: [(&str, &str); KINDS] = [
    ("vtol", include_str!("../../../deploy/config/vtol.toml")),
    ("servo", include_str!("../../../deploy/config/servo.toml")),
    (
        "turning_target",
        include_str!("../../../deploy/config/turning_target.toml"),
    ),
    ("two_state", include_str!("../../../deploy/config/two_state.toml")),
    ("vehicle", include_str!("../../../deploy/config/vehicle.toml")),
];

/// Whose samples a diagnoser is fed with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Sharing {
    /// All diagnosers of a kind see the same inputs.
    Shared,
    /// Every diagnoser has inputs of its own.
    Own,
}

/// When in a period the diagnosers are due.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Phases {
    /// All at the same instant.
    Together,
    /// One after the other, evenly over the period.
    Spread,
}

/// How many diagnosers, and how they are arranged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Args)]
pub struct FleetOptions {
    /// Number of diagnosers.
    #[arg(long, default_value_t = 1000)]
    pub diagnosers: usize,
    /// Inputs that diagnosers of a kind share, or inputs of their own.
    #[arg(long, value_enum, default_value = "shared")]
    pub inputs: Sharing,
    /// All due at the same instant, or spread over the period.
    #[arg(long, value_enum, default_value = "together")]
    pub phases: Phases,
}

impl FleetOptions {
    /// As arguments of this program.
    pub fn arguments(&self) -> Vec<String> {
        let name = |value: Option<clap::builder::PossibleValue>| {
            value.map_or_else(String::new, |value| value.get_name().to_owned())
        };
        [
            "--diagnosers".to_owned(),
            self.diagnosers.to_string(),
            "--inputs".to_owned(),
            name(self.inputs.to_possible_value()),
            "--phases".to_owned(),
            name(self.phases.to_possible_value()),
        ]
        .into()
    }

    /// How often the inputs of the five kinds exist.
    pub fn input_sets(&self) -> usize {
        match self.inputs {
            Sharing::Shared => 1,
            Sharing::Own => self.diagnosers.div_ceil(KINDS),
        }
    }
}

/// The five kinds of diagnosers.
#[derive(Debug)]
pub struct Kinds {
    loaded: Vec<Loaded>,
    /// The tables that they were read from, for the plants.
    pub tables: Vec<Table>,
}

impl Kinds {
    /// Reads the examples.
    ///
    /// # Errors
    /// An example is not as expected here.
    pub fn read() -> Result<Self> {
        let (mut loaded, mut tables) = (Vec::new(), Vec::new());
        for (name, text) in EXAMPLES {
            let table = at_ten_milliseconds(text.parse()?).with_context(|| format!("the example {name}"))?;
            loaded.push(Configuration::from_text(name, &toml::to_string(&table)?)?);
            tables.push(table);
        }
        Ok(Self { loaded, tables })
    }

    /// The inputs of all kinds, one after the other.
    pub fn inputs(&self) -> impl Iterator<Item = &InputConfiguration> {
        self.loaded.iter().flat_map(|kind| &kind.configuration.inputs)
    }

    /// The inputs of a kind are those of [`inputs`](Self::inputs) from this one on.
    pub fn first_input(&self, kind: usize) -> usize {
        let before = self.loaded.iter().take(kind);
        before.map(|kind| kind.configuration.inputs.len()).sum()
    }

    /// Finds the gains of each kind and constructs its diagnoser.
    ///
    /// # Errors
    /// There are no gains.
    pub fn design(&self) -> Result<Vec<Designed>> {
        let mut all = Vec::new();
        for kind in &self.loaded {
            all.extend(kind.design(&mut |_, _| {})?.diagnosers);
        }
        Ok(all)
    }

    /// The configuration of a fleet in the daemon of `instance`.
    pub fn configuration(&self, options: &FleetOptions, instance: &InstanceName) -> Configuration {
        let mut fleet = self.loaded[0].configuration.clone();
        fleet.daemon.instance = instance.clone();
        fleet.daemon.gains_file = None;
        fleet.daemon.record_queue = options.diagnosers.max(1024) * 2;
        fleet.replay = None;
        fleet.inputs.clear();
        for set in 0..options.input_sets() {
            fleet.inputs.extend(self.inputs().map(|input| InputConfiguration {
                name: input_name(&input.name, set),
                ..input.clone()
            }));
        }
        let inputs_of_set = self.inputs().count();
        let diagnoser = |number: usize| {
            let kind = number % KINDS;
            let set = match options.inputs {
                Sharing::Shared => 0,
                Sharing::Own => number / KINDS,
            };
            let configured = &self.loaded[kind].configuration.diagnosers[0];
            let first = set * inputs_of_set + self.first_input(kind);
            let moved = |signals: &[SignalReference]| {
                let moved = signals.iter().map(|signal| SignalReference {
                    input: first + signal.input,
                    ..*signal
                });
                moved.collect()
            };
            DiagnoserConfiguration {
                name: format!("{}_{number}", configured.name),
                phase_ns: match options.phases {
                    Phases::Together => 0,
                    Phases::Spread => number as u64 * PERIOD_NS / options.diagnosers as u64,
                },
                measurements: moved(&configured.measurements),
                commands: moved(&configured.commands),
                ..configured.clone()
            }
        };
        fleet.diagnosers = (0..options.diagnosers).map(diagnoser).collect();
        fleet
    }
}

/// The diagnosers of a fleet, in the order of its configuration.
pub fn diagnosers(kinds: &[Designed], options: &FleetOptions) -> Vec<Designed> {
    (0..options.diagnosers)
        .map(|number| kinds[number % KINDS].clone())
        .collect()
}

/// Name of the input of this name in one of the sets.
pub fn input_name(name: &str, set: usize) -> String {
    format!("{name}_{set}")
}

/// An instance for this process alone, in memory.
///
/// # Errors
/// The name is not possible.
pub fn instance(what: &str) -> Result<Instance> {
    let name = format!("{what}-{}", std::process::id()).parse()?;
    Ok(Instance::from_environment(name))
}

/// The example with a period of 10 ms.
fn at_ten_milliseconds(mut example: Table) -> Result<Table> {
    let diagnosers = example.get_mut("diagnoser").and_then(Value::as_array_mut);
    let [diagnoser] = diagnosers.context("no diagnoser")?.as_mut_slice() else {
        anyhow::bail!("more than one diagnoser");
    };
    let diagnoser = diagnoser.as_table_mut().context("no table")?;
    if diagnoser.get("method").and_then(Value::as_str) == Some("async_imm") {
        faster(diagnoser, TARGET_SPEED)?;
    }
    diagnoser.insert("sample_time_s".to_owned(), Value::Float(PERIOD_NS as f64 / 1e9));
    diagnoser.insert("margin_s".to_owned(), Value::Float(MARGIN_S));
    let daemon = example.get_mut("daemon").and_then(Value::as_table_mut);
    daemon.context("no daemon")?.remove("gains_file");
    Ok(example)
}

/// dx/dt = A x + B u + G w + F f in a time that runs `speed` times as fast: rates and densities of noise grow by it,
/// times shrink.
fn faster(diagnoser: &mut Table, speed: f64) -> Result<()> {
    let mut scaled = 0;
    for (section, keys, factor) in [
        ("plant", &["A", "B", "F", "process_noise_psd"][..], speed),
        ("transition", &["stay_period_s"], 1.0 / speed),
    ] {
        let table = diagnoser.get_mut(section).and_then(Value::as_table_mut);
        let table = table.with_context(|| format!("no {section}"))?;
        for key in keys {
            scale(table.get_mut(*key).with_context(|| format!("no {key}"))?, factor);
            scaled += 1;
        }
    }
    let ahead = diagnoser.get_mut("max_ahead_ms").context("no max_ahead_ms")?;
    scale(ahead, 1.0 / speed);
    ensure!(scaled == 5, "a key is missing");
    Ok(())
}

fn scale(value: &mut Value, factor: f64) {
    match value {
        Value::Float(number) => *number *= factor,
        Value::Integer(number) => *value = Value::Float(*number as f64 * factor),
        Value::Array(entries) => entries.iter_mut().for_each(|entry| scale(entry, factor)),
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const OPTIONS: FleetOptions = FleetOptions {
        diagnosers: 12,
        inputs: Sharing::Shared,
        phases: Phases::Together,
    };

    #[test]
    fn a_fleet_has_all_methods_at_100_hz_on_inputs_that_are_there() {
        let kinds = Kinds::read().unwrap();
        for inputs in [Sharing::Shared, Sharing::Own] {
            let options = FleetOptions { inputs, ..OPTIONS };
            let fleet = kinds.configuration(&options, &"fleet".parse().unwrap());
            assert_eq!(fleet.diagnosers.len(), 12);
            assert_eq!(fleet.inputs.len(), 13 * options.input_sets());
            let mut methods: Vec<_> = fleet.diagnosers.iter().map(|d| d.method.name()).collect();
            methods.sort_unstable();
            methods.dedup();
            assert_eq!(methods.len(), KINDS);
            for diagnoser in &fleet.diagnosers {
                assert_eq!(diagnoser.period_ns, PERIOD_NS);
                for signal in diagnoser.measurements.iter().chain(&diagnoser.commands) {
                    assert!(signal.element < fleet.inputs[signal.input].signals.len());
                }
            }
        }
    }

    #[test]
    fn spread_phases_lie_evenly_within_the_period() {
        let options = FleetOptions {
            phases: Phases::Spread,
            ..OPTIONS
        };
        let fleet = Kinds::read()
            .unwrap()
            .configuration(&options, &"fleet".parse().unwrap());
        let phases: Vec<u64> = fleet.diagnosers.iter().map(|d| d.phase_ns).collect();
        assert!(
            phases
                .windows(2)
                .all(|pair| (833_333..=833_334).contains(&(pair[1] - pair[0]))),
            "{phases:?}"
        );
    }
}
