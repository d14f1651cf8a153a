//! `residual-bench peers`: residuald beside what a user would take instead, in one run, on the same data.
//!
//! | module | what |
//! |---|---|
//! | [`environment`] | which peers are there, and what to install for the others |
//! | [`agreement`] | that two programs did the same work: their numbers agree |
//! | [`contender`] | who steps: a diagnoser of this process, or a peer in a process of its own |
//! | [`cases`] | the diagnosers, their plants and the problems as the peers read them |
//! | [`timing`] | processor times of repeated rounds |
//! | [`steps`] | step times of all methods beside numpy, filterpy and Eigen |
//! | [`samples`] | latency of a sample beside Cyclone DDS and zenoh |
//! | [`records`] | a record through the bounds table beside string diagnostics in the style of ROS |
//!
//! A peer that is not installed is left out and named; everything else runs.

pub mod agreement;
pub mod cases;
pub mod contender;
mod diagnostics;
pub mod environment;
pub mod records;
pub mod samples;
pub mod steps;
pub mod timing;

use std::time::Duration;

use anyhow::Result;
use clap::{Args, ValueEnum};

use crate::results::Results;
use environment::Environment;

/// Arguments of `peers`.
#[derive(Args)]
pub struct Options {
    /// Only this part.
    #[arg(long)]
    only: Option<Part>,
}

/// A part of the comparison.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Part {
    /// Step times beside numpy, filterpy and Eigen.
    Steps,
    /// Latency of a sample beside Cyclone DDS and zenoh.
    Samples,
    /// A record beside string diagnostics.
    Records,
}

const ABOUT: &str = "Every comparison runs both sides in turn, in this one run, on the same data; before any time counts \
    the numbers of both sides are compared. A peer that is not installed is named below; \
    `benches/peers/install.sh` installs all of them.";

/// Runs the comparisons.
///
/// # Errors
/// This side fails, or a peer that is there does not give the same numbers.
pub fn run(options: &Options, quick: bool) -> Result<Results> {
    let mut results = Results::begin("peers", "Beside other programs", ABOUT, quick);
    let environment = Environment::find()?;
    let wanted = |part| options.only.is_none_or(|only| only == part);
    if wanted(Part::Steps) {
        steps::compare(&environment, budget(quick, 600, 3000), &mut results)?;
    }
    if wanted(Part::Samples) {
        samples::compare(&environment, quick, &mut results)?;
    }
    if wanted(Part::Records) {
        records::compare(budget(quick, 1000, 4000), &mut results)?;
    }
    Ok(results)
}

fn budget(quick: bool, short_ms: u64, long_ms: u64) -> Duration {
    Duration::from_millis(if quick { short_ms } else { long_ms })
}
