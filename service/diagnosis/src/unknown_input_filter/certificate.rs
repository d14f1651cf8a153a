//! Parity certificates as data: linear combinations of a window of samples that a mode's own faults cannot
//! reach (method sheet 3.4).

use super::modes::FaultMode;
use serde::{Deserialize, Serialize};

/// A linear combination r = Σ μ_k' y_k - Σ λ_k' B u_k over a window of n transitions that is small while `mode`
/// holds, whatever the mode's own faults do.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ParityCertificate {
    /// The mode that it can falsify, as a list of actuators.
    pub mode: FaultMode,
    /// The foreign actuator it was designed to see; r > 0 for a positive fault.
    pub fault: usize,
    /// L: number of last transitions over which that fault was assumed to last.
    #[serde(rename = "L")]
    pub length: usize,
    /// μ_k for the samples k = 0..=n, oldest first, each of length ny; in 1/unit of y.
    pub mu: Vec<Vec<f64>>,
    /// λ_k for the transitions k = 0..n, oldest first, each of length nx; in 1/unit of x.
    pub lambda: Vec<Vec<f64>>,
}
