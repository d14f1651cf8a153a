//! Maximum likelihood of a linear model with Gaussian noise: the prediction-error method with the noise covariances
//! among the unknowns.
//!
//! x_{k+1} = A x_k + B u_k + G d_k, y_k = C x_k + D u_k + v_k, d ~ N(0, Q), v ~ N(0, R), white, x_0 ~ N(m, P_0).
//! The Kalman filter gives the innovations e_k(θ) and their covariances S_k(θ). With all innovations white, the negative
//! log-likelihood is (Åström 1980, "Maximum likelihood and prediction error methods", Automatica 16)
//!
//! ℓ(θ) = ½ Σ_k (e_k' S_k⁻¹ e_k + log det S_k + n_k log 2π).
//!
//! Scoring, which is Gauss and Newton's method for ℓ, takes the gradient and the expected information
//! (Gupta and Mehra 1974, IEEE Transactions on Automatic Control 19)
//!
//! g_i = Σ_k (∂_i e_k' S_k⁻¹ e_k + ½ tr(S_k⁻¹ ∂_i S_k) - ½ e_k' S_k⁻¹ ∂_i S_k S_k⁻¹ e_k),
//! M_ij = Σ_k (∂_i e_k' S_k⁻¹ ∂_j e_k + ½ tr(S_k⁻¹ ∂_i S_k S_k⁻¹ ∂_j S_k)),
//!
//! damped as Levenberg and Marquardt do. M⁻¹ is the covariance of θ (Cramér and Rao's bound, reached with many samples); a
//! direction in which M vanishes is not determined by the data. Q and R are positive by construction: their factors have
//! the diagonal exp(θ).
//!
//! | symbol | meaning |
//! |---|---|
//! | θ | parameters: those of the model, then of Q, then of R |
//! | e_k, S_k | innovation and its covariance |
//! | M | information matrix |
//! | n_k | received elements of y_k |

pub(super) mod derivatives;
pub(super) mod filter;
pub(super) mod maximise;
pub(super) mod noise;
pub(super) mod statistics;

use super::run_data::Piece;
use filter::{Filter, Plant};
use nalgebra::{DMatrix, DVector};
use noise::NoiseForm;

/// One element of θ.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Unknown {
    /// What it is called in messages.
    pub name: String,
    /// Where the search begins.
    pub start: f64,
    /// Smallest and largest value.
    pub range: (f64, f64),
    /// Largest change in one iteration.
    pub largest_step: f64,
}

/// What is maximised.
pub(super) struct Likelihood<'a> {
    /// The model of its parameters; `None` where they make none.
    pub plant: &'a dyn Fn(&[f64]) -> Option<Plant>,
    /// All unknowns: `model_count` of the model, then those of the noise.
    pub unknowns: Vec<Unknown>,
    /// Number of unknowns of the model.
    pub model_count: usize,
    /// Form of Q.
    pub disturbance: NoiseForm,
    /// Form of R.
    pub measurement: NoiseForm,
    /// m and P_0.
    pub initial: (DVector<f64>, DMatrix<f64>),
}

impl Likelihood<'_> {
    /// Q and R of θ.
    pub(super) fn covariances(&self, theta: &[f64]) -> (DMatrix<f64>, DMatrix<f64>) {
        let noise = theta.get(self.model_count..).unwrap_or(&[]);
        let (of_q, of_r) = noise.split_at(self.disturbance.count().min(noise.len()));
        (
            self.disturbance.covariance(of_q),
            self.measurement.covariance(of_r),
        )
    }

    /// The filter of θ; `None` where θ makes no model.
    pub(super) fn filter(&self, theta: &[f64]) -> Option<Filter> {
        let plant = (self.plant)(theta.get(..self.model_count)?)?;
        let (q, r) = self.covariances(theta);
        Some(Filter::new(plant, &q, r, self.initial.clone()))
    }

    /// ℓ(θ) over all pieces; infinite where θ makes no model or the filter fails.
    pub(super) fn value<'p>(&self, theta: &[f64], pieces: impl Iterator<Item = &'p Piece>) -> f64 {
        let Some(mut filter) = self.filter(theta) else {
            return f64::INFINITY;
        };
        let mut value = 0.0;
        for piece in pieces {
            filter.restart();
            for k in 0..piece.transitions() {
                match filter.step(piece, k) {
                    Some(innovation) => value += innovation.cost(),
                    None => return f64::INFINITY,
                }
            }
        }
        if value.is_finite() { value } else { f64::INFINITY }
    }
}
