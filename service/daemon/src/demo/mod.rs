//! The demonstration: publisher, daemon and polling client as three processes, with nothing to prepare.
//!
//! | module | process | what |
//! |---|---|---|
//! | [`plant`] | publisher | the aircraft of the paper's example |
//! | [`publisher`] | publisher | simulates it and publishes at 100 Hz |
//! | [`client`] | client | polls the bounds table and shows what it reads |
//! | [`conductor`] | the one that was started | starts the three, injects a fault, judges the result |

use std::path::PathBuf;

use clap::Args;
use residual_shared::names::{Instance, InstanceName};

pub mod client;
pub mod conductor;
pub mod plant;
pub mod publisher;

/// Where and when a process of the demonstration plays its part.
#[derive(Clone, Debug, Args)]
pub struct Part {
    /// Instance of the daemon.
    #[arg(long)]
    pub instance: InstanceName,
    /// Runtime directory of the instance.
    #[arg(long)]
    pub runtime_directory: PathBuf,
    /// Which actuator fails: 1 or 2.
    #[arg(long)]
    pub case: u8,
    /// Moment of the measurement y_0, CLOCK_MONOTONIC nanoseconds.
    #[arg(long)]
    pub start_ns: u64,
}

impl Part {
    /// The daemon's instance at its place.
    pub fn instance(&self) -> Instance {
        Instance::new(self.instance.clone(), &self.runtime_directory)
    }
}
