//! The identified model and what can be said of it.

use super::{Plant, Prediction};
use nalgebra::{DMatrix, DVector};

/// Ratio of the root mean squares of predictions of unseen and of seen runs from which on a model counts as overfitted.
pub(in crate::identify) const OVERFITTED: f64 = 1.1;

/// One unknown of the search.
#[derive(Clone, Debug, PartialEq)]
pub struct FoundParameter {
    /// Its name, or its place in the structure.
    pub name: String,
    /// Its value; of the diagonal of a factor of a covariance the logarithm.
    pub value: f64,
    /// Its standard error; 0 at an end of its range.
    pub standard_error: f64,
    /// Whether it ended at an end of its range, so that it might be better outside.
    pub at_limit: bool,
}

/// The standard deviation of a disturbance or of the noise of a measurement.
#[derive(Clone, Debug, PartialEq)]
pub struct FoundDeviation {
    /// What it is of.
    pub name: String,
    /// Root of the diagonal entry of the covariance; where it sank to the end of its range, that end.
    pub value: f64,
    /// Its standard error, relative to it; `None` where the deviation follows from several unknowns.
    pub relative_error: Option<f64>,
    /// Whether the deviation itself sank to the end of its range.
    pub at_lower_limit: bool,
}

/// A model from recordings, with its figures.
#[derive(Clone, Debug, PartialEq)]
pub struct IdentifiedModel {
    /// The matrices of the structure, rounded, per step or per second as there.
    pub matrices: Plant,
    /// The same per step.
    pub plant: Plant,
    /// The free entries and named parameters.
    pub parameters: Vec<FoundParameter>,
    /// Unknowns of Q and R: logarithms of the diagonals of their factors, and what stands below these.
    pub noise: Vec<FoundParameter>,
    /// Standard deviations of the disturbances and of the noise that were sought.
    pub deviations: Vec<FoundDeviation>,
    /// Q: covariance of the disturbances of a step, nd x nd.
    pub disturbance_covariance: DMatrix<f64>,
    /// R: covariance of the measurement noise, ny x ny, positive definite.
    pub measurement_noise_covariance: DMatrix<f64>,
    /// Mean and covariance of the state at the start of a run, as assumed.
    pub initial_state: (DVector<f64>, DMatrix<f64>),
    /// Log-likelihood of the training runs.
    pub log_likelihood: f64,
    /// Iterations of the search.
    pub iterations: usize,
    /// Number of training runs.
    pub runs: usize,
    /// One-step predictions of the training runs.
    pub training: Prediction,
    /// Of each training run by a model from other runs.
    pub cross_validation: Prediction,
    /// Number of validation runs.
    pub validation_runs: usize,
    /// Of the validation runs, if there are any.
    pub validation: Option<Prediction>,
}

impl IdentifiedModel {
    /// Largest ratio, over the outputs, of the root mean square of the innovations in cross-validation to that of the
    /// training; the root of the ratio of the normalised squares counts as an output.
    pub fn cross_validation_ratio(&self) -> f64 {
        let normalised = self.cross_validation.normalised_square / self.training.normalised_square;
        let ratios = self.cross_validation.rms.iter().zip(&self.training.rms);
        ratios
            .map(|(left_out, own)| left_out / own)
            .fold(normalised.sqrt(), f64::max)
    }

    /// Whether unseen runs are predicted so much worse than those of the fit that the model has too many free entries.
    pub fn is_overfitted(&self) -> bool {
        let ratio = self.cross_validation_ratio();
        ratio > OVERFITTED || ratio.is_nan()
    }
}
