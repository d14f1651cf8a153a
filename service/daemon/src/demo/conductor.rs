//! Chooses the scenarios, starts their processes, and judges what the client saw.

use std::io;

use clap::Args;
use residual_shared::names::InstanceNameError;

use super::composition::CompositionError;
use super::judge::judge;
use super::scenario::{self, Scenario, Variation};
use super::stage::Stage;

/// Speed of the daemon's time when all methods are shown together.
const SPEED_OF_ALL: f64 = 2.0;

/// What `residuald demo` takes.
#[derive(Debug, Args)]
pub struct DemoArguments {
    /// The method to show; its scenarios follow one another.
    #[arg(long, value_parser = scenario::methods(), default_value = "unknown_input_filter")]
    pub method: String,
    /// All methods together in one daemon, each at its own period.
    #[arg(long, conflicts_with_all = ["method", "scenario"])]
    pub all: bool,
    /// One scenario only, by name.
    #[arg(long, conflicts_with = "method", value_parser = scenario::SCENARIOS.iter().map(|scenario| scenario.name).collect::<Vec<_>>())]
    pub scenario: Option<String>,
    /// Seed and disturbance.
    #[command(flatten)]
    pub variation: Variation,
}

/// Why the demonstration could not be shown, or did not show what it should.
#[derive(Debug, thiserror::Error)]
pub enum DemoError {
    /// A process could not be started or read.
    #[error("cannot {what}: {source}")]
    Process {
        /// What was tried.
        what: &'static str,
        /// The system's reason.
        source: io::Error,
    },
    /// A name for the demonstration's instance could not be made.
    #[error(transparent)]
    Instance(#[from] InstanceNameError),
    /// The configurations of the scenarios could not be put together.
    #[error(transparent)]
    Composition(#[from] CompositionError),
    /// The daemon opened no bounds table.
    #[error("the daemon did not start in time; its messages stand above")]
    NoDaemon,
    /// A process ended with a failure.
    #[error("the {0} failed; its messages stand above")]
    Failed(&'static str),
    /// A process reported something else than agreed.
    #[error("the {0} gave no report")]
    NoReport(&'static str),
    /// A fault was not found as it should, or there were false alarms.
    #[error("the demonstration did not show what it should: {0}")]
    Wrong(String),
}

/// Shows the chosen scenarios; an error if one does not show what it should.
pub fn execute(arguments: &DemoArguments) -> Result<(), DemoError> {
    if arguments.all {
        return show(
            "demo-all",
            &scenario::of_all_methods(),
            SPEED_OF_ALL,
            &arguments.variation,
        );
    }
    let chosen = match &arguments.scenario {
        Some(name) => scenario::named(name).into_iter().collect(),
        None => scenario::of_method(&arguments.method),
    };
    for scenario in chosen {
        show("demo", &[scenario], scenario.speed, &arguments.variation)?;
    }
    Ok(())
}

/// Shows scenarios at the same time, in one daemon.
fn show(name: &str, scenarios: &[&Scenario], speed: f64, variation: &Variation) -> Result<(), DemoError> {
    for scenario in scenarios {
        println!("\n=== {}: {} ===", scenario.method, scenario.title);
    }
    let names: Vec<_> = scenarios.iter().map(|scenario| scenario.name).collect();
    let examples: Vec<_> = scenarios.iter().map(|scenario| scenario.example).collect();
    let instance = format!("{name}-{}", std::process::id());
    let (seen, summary) = Stage::open(&instance, &examples, speed)?.perform(&names, variation)?;
    if judge(scenarios, &seen, &summary) {
        Ok(())
    } else {
        Err(DemoError::Wrong(names.join(", ")))
    }
}
