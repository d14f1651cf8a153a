//! The demonstration: publisher, daemon and polling client as three processes, with nothing to prepare.
//!
//! | module | process | what |
//! |---|---|---|
//! | [`scenario`] | all | which examples there are, and what each must show |
//! | [`plants`] | publisher | the simulated plants with their sensors |
//! | [`publisher`] | publisher | publishes what the sensors of the chosen scenarios say, each at its time |
//! | [`client`], [`view`] | client | polls the bounds table, shows what it reads, reports alarms and isolations |
//! | [`conductor`], [`stage`] | the one that was started | starts the three and waits for them |
//! | [`composition`] | the one that was started | one configuration and one gains file out of those of the chosen scenarios |
//! | [`judge`] | the one that was started | compares what was seen with what must be, prints the summary |

use std::path::PathBuf;

use clap::Args;
use residual_shared::names::{Instance, InstanceName};

pub mod client;
pub mod composition;
pub mod conductor;
pub mod judge;
pub mod plants;
pub mod publisher;
pub mod scenario;
pub mod stage;
pub mod view;

/// Configuration and gains of an example in `deploy/config`, by its name.
macro_rules! example {
    ($name:literal) => {
        $crate::demo::composition::Example {
            configuration: include_str!(concat!("../../../../deploy/config/", $name, ".toml")),
            gains: include_str!(concat!("../../../../deploy/config/", $name, ".gains.toml")),
        }
    };
}
pub(crate) use example;

/// Where and when a process of the demonstration plays its part.
#[derive(Clone, Debug, Args)]
pub struct Part {
    /// Instance of the daemon.
    #[arg(long)]
    pub instance: InstanceName,
    /// Runtime directory of the instance.
    #[arg(long)]
    pub runtime_directory: PathBuf,
    /// The scenarios that are shown at the same time.
    #[arg(long = "scenario", required = true)]
    pub scenarios: Vec<String>,
    /// Moment at which all plants start, nanoseconds of the daemon's time.
    #[arg(long)]
    pub start_ns: u64,
}

impl Part {
    /// The daemon's instance at its place.
    pub fn instance(&self) -> Instance {
        Instance::new(self.instance.clone(), &self.runtime_directory)
    }
}
