//! One step of every method in every mode, on random stable plants with 2, 4, 6 and 12 states.
//!
//! A [`Case`] is a method in one mode on one plant. Its plant and what the sensors said are drawn from a fixed seed, so
//! that every run, on any machine, steps through the same numbers. What was recorded repeats without a seam: it is one
//! period of a plant in its periodic steady state, so a diagnoser can be stepped through it again and again without
//! ever seeing anything that the plant could not have done.
//!
//! | module | what |
//! |---|---|
//! | [`plant`] | random plants and their periodic runs |
//! | [`recording`] | what the sensors said |
//! | `unknown_input_filter`, … | the cases of one method each |
//! | [`stepper`] | steps a case |
//! | [`single`] | `residual-bench steps`: single steps as percentiles, scaling curves |
//! | [`engine`] | steps in the real engine: the demonstration's diagnosers and cases of this module |
//! | [`instructions`] | `residual-bench instructions`: instructions and floating-point operations of a step |

mod async_imm;
mod chi_square;
pub mod engine;
mod hinf_filter;
pub mod instructions;
pub mod plant;
pub mod recording;
mod reduced_order_observer;
pub mod single;
pub mod stepper;
mod unknown_input_filter;

use anyhow::{Context, Result};
use residual_diagnosis::method::Designed;
use residuald::configuration::method::MethodConfiguration;
use toml::Table;

use recording::Recording;

/// Numbers of states.
pub const STATES: [usize; 4] = [2, 4, 6, 12];

/// A plant as a method's tables describe it, and what its sensors said.
#[derive(Clone, Debug)]
pub struct Watched {
    /// The tables of the diagnoser, without the options of the mode.
    pub tables: Table,
    /// What the sensors said, over one period.
    pub recording: Recording,
}

/// From the tables of a diagnoser to its method.
type Read = fn(Table) -> Result<MethodConfiguration, toml::de::Error>;

/// From the number of states to a plant.
type PlantOf = fn(usize) -> Result<Watched>;

/// One method in one mode on one plant.
#[derive(Clone, Debug)]
pub struct Case {
    /// The method.
    pub method: &'static str,
    /// The mode, in words.
    pub mode: &'static str,
    /// States of the plant.
    pub states: usize,
    /// Generator order, for methods that compute with zonotopes at every step.
    pub generators: Option<usize>,
    /// Whether it is the method as configured without options.
    pub is_default: bool,
    read: Read,
    plant: PlantOf,
    options: String,
}

/// All cases, method after method.
pub fn cases() -> Vec<Case> {
    [
        unknown_input_filter::cases(),
        reduced_order_observer::cases(),
        async_imm::cases(),
        chi_square::cases(),
        hinf_filter::cases(),
    ]
    .concat()
}

/// The case of this name.
///
/// # Errors
/// There is none.
pub fn case_named(name: &str) -> Result<Case> {
    let mut all = cases().into_iter();
    all.find(|case| case.name() == name)
        .with_context(|| format!("no case \"{name}\"; `residual-bench steps --list` shows them"))
}

impl Case {
    /// Method, mode, states and generators.
    pub fn name(&self) -> String {
        let generators = self.generators.map(|order| format!(" s={order}"));
        format!(
            "{} {} n={}{}",
            self.method,
            self.mode,
            self.states,
            generators.unwrap_or_default()
        )
    }

    /// Tables and recording.
    ///
    /// # Errors
    /// The tables are no tables.
    pub fn watched(&self) -> Result<Watched> {
        let mut watched = (self.plant)(self.states)?;
        let options: Table = self.options.parse()?;
        for (key, value) in options {
            match (watched.tables.get_mut(&key), value) {
                (Some(toml::Value::Table(there)), toml::Value::Table(more)) => there.extend(more),
                (_, value) => {
                    watched.tables.insert(key, value);
                }
            }
        }
        Ok(watched)
    }

    /// Finds the gains and constructs the diagnoser.
    ///
    /// # Errors
    /// The method refuses the case.
    pub fn design(&self, watched: &Watched) -> Result<Designed> {
        let method = (self.read)(watched.tables.clone()).with_context(|| self.name())?;
        let sample_time_s = watched.recording.period_ns as f64 * 1e-9;
        let designed = method
            .find_gains(sample_time_s, &mut |_| ())
            .and_then(|found| method.with_gains(sample_time_s, &found.gains));
        designed.with_context(|| self.name())
    }
}
