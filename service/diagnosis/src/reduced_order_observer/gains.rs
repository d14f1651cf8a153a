//! The numbers that a design finds and the diagnoser runs on.
//!
//! All test rows are among them, so that nothing is searched for when a diagnoser is constructed. None of them is
//! trusted: `verification` checks every one against the plant.

use super::{certificate::Certificate, observer_design::ObserverDesign, source::Source};
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// Gains, test rows and certificate of all observers, in the coordinates x' = T_c x of method sheet 2.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReducedOrderObserverGains {
    /// The observer that detects.
    pub main: MainGains,
    /// The observers that do not react to one actuator, at most one per actuator.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub members: Vec<MemberGains>,
    /// The observers whose residual is the fault of one actuator, at most one per actuator.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub estimators: Vec<EstimatorGains>,
}

/// The main observer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MainGains {
    /// Which design K comes from, in words.
    pub source: Source,
    /// K, nz x p, with K D1 + D2 = 0.
    #[serde(rename = "K")]
    pub k: Vec<Vec<f64>>,
    /// M, p x p, Schur.
    #[serde(rename = "M")]
    pub m: Vec<Vec<f64>>,
    /// W, nw x p: test rows of length 1, the first p of them the outputs.
    #[serde(rename = "W")]
    pub w: Vec<Vec<f64>>,
    /// P, n x n: (A + L C)'P(A + L C) - P < 0 and D'P N_c = 0 with the L that belongs to K and M (method sheet 3.6);
    /// none where F or M is too near to instability for one.
    #[serde(rename = "P", default, skip_serializing_if = "Option::is_none")]
    pub p: Option<Vec<Vec<f64>>>,
}

/// An isolation member; M = 0.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MemberGains {
    /// The actuator i whose fault the rows do not see, from 0.
    pub actuator: usize,
    /// Whether U = \[b_i D\], else U = b_i.
    pub decouples_disturbance: bool,
    /// K, nz x p, with K U1 + U2 = 0.
    #[serde(rename = "K")]
    pub k: Vec<Vec<f64>>,
    /// W, nw x p: test rows of length 1 with W U1 = 0.
    #[serde(rename = "W")]
    pub w: Vec<Vec<f64>>,
}

/// A fault estimator; M = 0.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EstimatorGains {
    /// The actuator i whose fault is estimated, from 0.
    pub actuator: usize,
    /// Whether U = \[b_i D\], else U = b_i.
    pub decouples_disturbance: bool,
    /// K, nz x p, with K U1 + U2 = 0.
    #[serde(rename = "K")]
    pub k: Vec<Vec<f64>>,
    /// φ, length p, with φ U1 = \[1 0 ... 0\].
    #[serde(rename = "phi")]
    pub phi: Vec<f64>,
}

impl MainGains {
    /// The gains of a designed observer.
    pub fn new(design: &ObserverDesign, source: Source, certificate: Option<&Certificate>) -> Self {
        Self {
            source,
            k: rows(&design.observer.k),
            m: rows(&design.observer.m),
            w: rows(&design.tests),
            p: certificate.map(|certificate| rows(&certificate.p)),
        }
    }
}

impl MemberGains {
    /// The gains of a designed member of an actuator.
    pub fn new(design: &ObserverDesign, actuator: usize) -> Self {
        Self {
            actuator,
            decouples_disturbance: design.observer.decoupled.disturbances,
            k: rows(&design.observer.k),
            w: rows(&design.tests),
        }
    }
}

impl EstimatorGains {
    /// The gains of a designed estimator of an actuator.
    pub fn new(design: &ObserverDesign, actuator: usize) -> Self {
        Self {
            actuator,
            decouples_disturbance: design.observer.decoupled.disturbances,
            k: rows(&design.observer.k),
            phi: design.tests.row(0).iter().copied().collect(),
        }
    }
}

/// A matrix as a list of rows.
fn rows(matrix: &DMatrix<f64>) -> Vec<Vec<f64>> {
    matrix
        .row_iter()
        .map(|row| row.iter().copied().collect())
        .collect()
}
