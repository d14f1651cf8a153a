//! Gains: the numbers that a synthesis finds, kept in a file and trusted by nobody.
//!
//! A [file](file::GainsFile) holds, for each diagnoser of a configuration, the gains, what they achieve, and where they
//! come from. A diagnoser is constructed from the gains alone; all that they achieve is recomputed then and
//! [compared](file::Entry::verify) with what the file states.

mod compare;
pub mod error;
pub mod file;
mod layout;

use serde::{Deserialize, Serialize};

/// Gains with their origin.
#[derive(Clone, Debug, PartialEq)]
pub struct FoundGains<G> {
    /// The numbers.
    pub gains: G,
    /// The solvers' words, one for each problem that was solved for them.
    pub solver: Vec<SolverRun>,
    /// What was accepted but deserves a second look: fall-backs above all.
    pub warnings: Vec<String>,
}

impl<G> FoundGains<G> {
    /// Gains that no solver was needed for.
    pub fn closed_form(gains: G) -> Self {
        Self {
            gains,
            solver: Vec::new(),
            warnings: Vec::new(),
        }
    }
}

/// The gains of a method that has none: its filters follow from the model alone.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NoGains {}

/// What a solver said of one problem. No certificate: what holds is recomputed from the gains.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SolverRun {
    /// The problem.
    pub problem: String,
    /// The solver and its version.
    pub solver: String,
    /// Its word at the end.
    pub status: String,
    /// Iterations.
    pub iterations: u32,
    /// Objective at the end.
    pub objective: f64,
    /// Dual objective at the end.
    pub dual_objective: f64,
    /// Accuracy asked for.
    pub tolerance: f64,
}
