//! Parity certificates as data: linear combinations of a window of samples that a mode's own faults cannot
//! reach (method sheet 3.4).
//!
//! With λ_{-1} = λ_n = 0, a certificate fulfils λ_{k-1} = A0'λ_k + C'μ_k for k = 0..=n and F'λ_k = 0 for
//! k = 0..n, F being the columns of B of its mode. Whoever made it, these equalities alone make its test sound.

use super::modes::FaultMode;
use crate::model::LinearModel;
use nalgebra::DVector;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Largest violation of an equality, relative to the largest term in it.
const EQUALITY_TOLERANCE: f64 = 1e-9;

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

/// Why a certificate does not belong to a model.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum CertificateError {
    /// Lists of the wrong length.
    #[error("{what} is {actual} but must be {expected}; design the certificate for this model")]
    DimensionMismatch {
        /// Which list.
        what: &'static str,
        /// The length found.
        actual: usize,
        /// The length needed.
        expected: usize,
    },
    /// L outside 1..=n.
    #[error(
        "the fault length L is {length} but must lie between 1 and the {transitions} transitions of lambda"
    )]
    FaultLength {
        /// L.
        length: usize,
        /// n.
        transitions: usize,
    },
    /// An actuator that the model does not have.
    #[error("actuator {actuator} does not exist; the model has {count} actuators, counted from 0")]
    UnknownActuator {
        /// The actuator.
        actuator: usize,
        /// nu.
        count: usize,
    },
    /// The fault to be seen belongs to the mode whose faults must not be seen.
    #[error(
        "the fault {fault} belongs to the mode {mode} itself; a mode can only be falsified by other faults"
    )]
    FaultInMode {
        /// The fault.
        fault: usize,
        /// The mode.
        mode: FaultMode,
    },
    /// Fault columns of the mode that depend on each other.
    #[error("the columns of B of the mode {mode} depend on each other; their faults cannot be told apart")]
    DependentFaults {
        /// The mode.
        mode: FaultMode,
    },
    /// An infinite entry or one that is not a number.
    #[error("{what} has a non-finite entry at instant {instant}; only finite numbers are allowed")]
    NonFinite {
        /// mu or lambda.
        what: &'static str,
        /// Row, from 0.
        instant: usize,
    },
    /// An equality that does not hold: the test would raise false alarms.
    #[error(
        "the equality {equality} is violated at instant {instant} by {residual:e} (relative), more than 1e-9; the \
         certificate was made for another model or was altered, design it again"
    )]
    EqualityViolated {
        /// Which equality.
        equality: &'static str,
        /// k.
        instant: usize,
        /// Violation relative to the largest term.
        residual: f64,
    },
    /// A certificate that does not react to its fault.
    #[error(
        "the response to its fault {fault} is {gain:e}, which is not positive; leave the certificate out"
    )]
    NoResponse {
        /// The fault.
        fault: usize,
        /// Sum of B_j'λ_k over the last L transitions.
        gain: f64,
    },
}

impl ParityCertificate {
    /// n: number of transitions of the window.
    pub fn transitions(&self) -> usize {
        self.lambda.len()
    }

    /// Response to a unit fault that lasts over the last L transitions: Σ B_j'λ_k, in 1/unit of u.
    ///
    /// 0 if the certificate does not fit the model.
    pub fn gain(&self, model: &LinearModel) -> f64 {
        if self.fault >= model.actuator_count() {
            return 0.0;
        }
        let column = model.b().column(self.fault);
        let last = self.lambda.iter().rev().take(self.length);
        last.map(|lambda| lambda.iter().zip(column.iter()).map(|(l, b)| l * b).sum::<f64>())
            .sum()
    }

    /// Checks shapes and equalities.
    ///
    /// # Errors
    /// [`CertificateError`] when the certificate does not belong to this model; such a test must not run.
    pub fn validate(&self, model: &LinearModel) -> Result<(), CertificateError> {
        self.validate_shapes(model)?;
        let (lambda, mu) = (self.lambda_columns(), self.mu_columns());
        let f = self.mode.unknown_input_matrix(model.b());
        let (a_abs, c_abs) = (model.a0().abs(), model.c().abs());
        let zero = DVector::zeros(model.state_count());
        let (mut dynamics, mut own_faults) = (Equality::default(), Equality::default());
        let largest_lambda = lambda.iter().map(|lambda| lambda.amax()).fold(0.0, f64::max);
        for k in 0..=self.transitions() {
            let previous = if k == 0 { &zero } else { &lambda[k - 1] };
            let current = lambda.get(k).unwrap_or(&zero);
            let terms = previous.abs() + a_abs.tr_mul(&current.abs()) + c_abs.tr_mul(&mu[k].abs());
            let residual = previous - model.a0().tr_mul(current) - model.c().tr_mul(&mu[k]);
            dynamics.note(k, residual.amax(), terms.amax());
            if !self.mode.is_empty() {
                own_faults.note(k, f.tr_mul(current).amax(), f.amax() * largest_lambda);
            }
        }
        dynamics.require("lambda[k-1] = A' lambda[k] + C' mu[k]")?;
        own_faults.require("F' lambda[k] = 0")?;
        let gain = self.gain(model);
        if gain > 0.0 {
            Ok(())
        } else {
            Err(CertificateError::NoResponse {
                fault: self.fault,
                gain,
            })
        }
    }

    fn validate_shapes(&self, model: &LinearModel) -> Result<(), CertificateError> {
        let transitions = self.transitions();
        let count = model.actuator_count();
        if let Some(actuator) = self.mode.actuators().chain([self.fault]).find(|&j| j >= count) {
            return Err(CertificateError::UnknownActuator { actuator, count });
        }
        if self.mode.contains(self.fault) {
            return Err(CertificateError::FaultInMode {
                fault: self.fault,
                mode: self.mode,
            });
        }
        if self.length == 0 || self.length > transitions {
            return Err(CertificateError::FaultLength {
                length: self.length,
                transitions,
            });
        }
        let length = |what, actual, expected| {
            if actual == expected {
                Ok(())
            } else {
                Err(CertificateError::DimensionMismatch {
                    what,
                    actual,
                    expected,
                })
            }
        };
        length("the number of rows of mu", self.mu.len(), transitions + 1)?;
        for (what, list, expected) in [
            ("a row of mu", &self.mu, model.output_count()),
            ("a row of lambda", &self.lambda, model.state_count()),
        ] {
            for (instant, row) in list.iter().enumerate() {
                length(what, row.len(), expected)?;
                if row.iter().any(|entry| !entry.is_finite()) {
                    return Err(CertificateError::NonFinite { what, instant });
                }
            }
        }
        Ok(())
    }

    /// The λ_k as vectors, k = 0..n.
    pub(crate) fn lambda_columns(&self) -> Vec<DVector<f64>> {
        self.lambda
            .iter()
            .map(|row| DVector::from_column_slice(row))
            .collect()
    }

    /// The μ_k as vectors, k = 0..=n.
    pub(crate) fn mu_columns(&self) -> Vec<DVector<f64>> {
        self.mu
            .iter()
            .map(|row| DVector::from_column_slice(row))
            .collect()
    }
}

/// The largest violation of an equality over all instants, and the largest term in it.
#[derive(Default)]
struct Equality {
    instant: usize,
    violation: f64,
    largest_term: f64,
}

impl Equality {
    fn note(&mut self, instant: usize, violation: f64, term: f64) {
        if violation > self.violation {
            (self.instant, self.violation) = (instant, violation);
        }
        self.largest_term = self.largest_term.max(term);
    }

    fn require(&self, equality: &'static str) -> Result<(), CertificateError> {
        if self.violation <= EQUALITY_TOLERANCE * self.largest_term {
            return Ok(());
        }
        let residual = self.violation / self.largest_term;
        Err(CertificateError::EqualityViolated {
            equality,
            instant: self.instant,
            residual,
        })
    }
}
