//! Parity certificates: the tests over windows of samples that see the smallest fault any method can guarantee to
//! see (method sheet 3.4).
//!
//! The solver's multipliers fulfil the equalities of a certificate only to its accuracy, and they carry thousands of
//! tiny entries. Here the tiny entries are removed and the others moved onto the equalities, so that the test is
//! sound to rounding; what is lost in sensitivity by that is checked.

use crate::bounds::NoiseBounds;
use crate::unknown_input_filter::floors::{FloorError, FloorQuestion, FloorSolution, solve, threshold_of};
use crate::unknown_input_filter::window_equalities::{Multipliers, WindowEqualities};
use nalgebra::{DMatrix, DVector};
use residual_diagnosis::gains::SolverRun;
use residual_diagnosis::model::LinearModel;
use residual_diagnosis::unknown_input_filter::certificate::{CertificateError, ParityCertificate};
use residual_diagnosis::unknown_input_filter::modes::FaultMode;
use thiserror::Error;

/// Entries at or below this, relative to the largest one, are removed; λ and μ apart.
const NEGLIGIBLE: f64 = 1e-7;

/// How often multipliers are moved onto the equalities, against rounding.
const REPETITIONS: usize = 3;

/// Largest miss of an equality, relative to the largest multiplier.
const EXACT: f64 = 1e-13;

/// Largest share of the solver's gain that may be lost.
const GAIN_LOSS: f64 = 1e-6;

/// Which windows certificates are designed for.
#[derive(Clone, Debug, PartialEq)]
pub struct CertificateOptions {
    /// Fault durations L, in samples, each at least 1; one that is listed twice counts once.
    pub lengths: Vec<usize>,
    /// Transitions before the fault that every window contains.
    pub pre_samples: usize,
    /// x_nom: typical |x|, length nx, state units, >= 0. It decides between certificates; all of them are sound for
    /// every state.
    pub nominal_state: DVector<f64>,
}

/// What the design found, in the order of modes, actuators and lengths.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Designed {
    /// The certificates; while the state is at x_nom their threshold h is 1.
    pub certificates: Vec<ParityCertificate>,
    /// For each certificate the smallest constant fault that is certainly seen while the state is at x_nom.
    pub floors: Vec<CertificateFloor>,
    /// Faults that no test can tell from the mode within the window, however large they are.
    pub not_separable: Vec<FloorQuestion>,
    /// Windows that stay without a certificate for reasons of computation.
    pub failures: Vec<CertificateFailure>,
    /// What the solver said of each program that a certificate comes from.
    pub runs: Vec<SolverRun>,
}

/// The sensitivity of a certificate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CertificateFloor {
    /// Mode, fault and window.
    pub question: FloorQuestion,
    /// 2 / gain: constant fault, in units of u, from which on the mode is certainly falsified within L samples.
    pub floor: f64,
}

/// A window without certificate.
#[derive(Clone, Debug, PartialEq)]
pub struct CertificateFailure {
    /// Mode, fault and window.
    pub question: FloorQuestion,
    /// Why.
    pub reason: FailureReason,
}

/// Why a window has no certificate although the fault may be separable.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum FailureReason {
    /// The linear program failed.
    #[error(transparent)]
    Floor(#[from] FloorError),
    /// The multipliers cannot be made exact.
    #[error(
        "the equalities are missed by {violation:e} (relative), more than 1e-13; scale states, inputs and outputs to \
         comparable size, or shorten the window"
    )]
    Inexact {
        /// Largest miss, relative to the largest multiplier.
        violation: f64,
    },
    /// Exact multipliers see less than the solver promised.
    #[error(
        "exact multipliers see only {share} of what the solver promised; scale states, inputs and outputs to \
         comparable size, or shorten the window"
    )]
    GainLost {
        /// Their gain, relative to the solver's.
        share: f64,
    },
    /// The certificate is refused by the test it is for.
    #[error(transparent)]
    Refused(#[from] CertificateError),
}

/// Designs the certificates of all given modes against all other actuators.
///
/// The same model, modes and options give the same certificates to the last bit. `progress` hears of each pair of a
/// mode and an actuator.
///
/// # Errors
/// [`FloorError`] if modes, lengths or x_nom do not fit the model. A window that only its computation fails is no
/// error but listed in [`Designed::failures`].
pub fn design(
    model: &LinearModel,
    modes: &[FaultMode],
    options: &CertificateOptions,
    progress: &mut dyn FnMut(&str),
) -> Result<Designed, FloorError> {
    let mut designed = Designed::default();
    for (position, &mode) in modes.iter().enumerate() {
        if modes[..position].contains(&mode) {
            continue;
        }
        for actuator in mode.other_actuators(model.actuator_count()) {
            progress(&format!(
                "parity certificates of the mode {mode} against actuator {actuator}"
            ));
            for (position, &length) in options.lengths.iter().enumerate() {
                if options.lengths[..position].contains(&length) {
                    continue;
                }
                let question = FloorQuestion {
                    mode,
                    actuator,
                    length,
                    pre_samples: options.pre_samples,
                };
                designed.take(question, certificate(model, &options.nominal_state, question))?;
            }
        }
    }
    Ok(designed)
}

impl Designed {
    fn take(
        &mut self,
        question: FloorQuestion,
        outcome: Result<Option<(ParityCertificate, f64, SolverRun)>, FailureReason>,
    ) -> Result<(), FloorError> {
        match outcome {
            Ok(Some((certificate, gain, run))) => {
                self.certificates.push(certificate);
                self.runs.push(run);
                self.floors.push(CertificateFloor {
                    question,
                    floor: 2.0 / gain,
                });
            }
            Ok(None) => self.not_separable.push(question),
            Err(FailureReason::Floor(error)) if !error.is_of_computation() => return Err(error),
            Err(reason) => self.failures.push(CertificateFailure { question, reason }),
        }
        Ok(())
    }
}

/// The certificate of one window with its gain at threshold 1 and the solver's words; `None` if the fault is not
/// separable.
fn certificate(
    model: &LinearModel,
    nominal_state: &DVector<f64>,
    question: FloorQuestion,
) -> Result<Option<(ParityCertificate, f64, SolverRun)>, FailureReason> {
    let bounds = NoiseBounds::from(model);
    let Some(solution) = solve(model, &bounds, nominal_state, question)? else {
        return Ok(None);
    };
    let equalities = WindowEqualities::new(model, question.mode);
    let finish = |z: Multipliers| -> Result<(ParityCertificate, f64), FailureReason> {
        let violation = equalities.violation(&z) / z.largest();
        let exact = violation <= EXACT;
        if !exact {
            return Err(FailureReason::Inexact { violation });
        }
        let scale = threshold_of(model, &bounds, nominal_state, &z).recip();
        let certificate = ParityCertificate {
            mode: question.mode,
            fault: question.actuator,
            length: question.length,
            mu: rows(&(z.mu * scale)),
            lambda: rows(&(z.lambda * scale)),
        };
        certificate.validate(model)?;
        let gain = certificate.gain(model);
        let share = gain / solution.gain;
        let sensitive = share >= 1.0 - GAIN_LOSS;
        if !sensitive {
            return Err(FailureReason::GainLost { share });
        }
        Ok((certificate, gain))
    };
    let projected = |mut z: Multipliers| {
        equalities.project(&mut z, REPETITIONS);
        z
    };
    let (certificate, gain) =
        finish(projected(support(&solution))).or_else(|_| finish(projected(Multipliers::from(&solution))))?;
    Ok(Some((certificate, gain, solution.run)))
}

impl From<&FloorSolution> for Multipliers {
    fn from(solution: &FloorSolution) -> Self {
        Self {
            lambda: solution.lambda.clone(),
            mu: solution.mu.clone(),
        }
    }
}

/// The multipliers without their negligible entries.
fn support(solution: &FloorSolution) -> Multipliers {
    let strip = |values: &DMatrix<f64>| {
        let limit = NEGLIGIBLE * values.amax();
        values.map(|value| if value.abs() > limit { value } else { 0.0 })
    };
    Multipliers {
        lambda: strip(&solution.lambda),
        mu: strip(&solution.mu),
    }
}

/// The columns as lists, without negative zeros.
fn rows(values: &DMatrix<f64>) -> Vec<Vec<f64>> {
    values
        .column_iter()
        .map(|column| column.iter().map(|value| value + 0.0).collect())
        .collect()
}
