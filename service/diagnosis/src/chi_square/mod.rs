//! State and residual chi-square tests, generalised likelihood ratio and cumulative sums on one Kalman filter.
//!
//! x(k) = Φ x(k-1) + B u(k-1) + w(k), z(k) = H x(k) + D u(k) + v(k) + f(k), with white Gaussian w and v. Every
//! statistic is a function of the whitened innovations e, which are independent and of unit variance without fault.
//!
//! | symbol | shape | meaning | name in the code |
//! |---|---|---|---|
//! | x̂, z, u | n, m, p | estimate, measurement, known input | `estimate`, `z`, `u` |
//! | Φ, B, H, D | n x n, n x p, m x n, m x p | matrices of the instant | `transition`, `input`, `measurement`, `feedthrough` |
//! | G | n x r | noise factor, G G' = Γ Q Γ' | `noise_factor` |
//! | R | m x m | covariance of v | `measurement_noise` |
//! | L_P | n x n | lower factor of the covariance P of x̂ | `covariance_factor` |
//! | a | m_k | rows that arrived at instant k | `rows` |
//! | ν, S, L_S | m_k, m_k x m_k | innovation, its covariance, S = L_S L_S' | `innovation`, `innovation_factor` |
//! | e | m_k | whitened innovation L_S⁻¹ ν | `whitened` |
//! | K̄, γ | n x m_k, n | normalised gain K L_S, correction K̄ e | `gain`, `correction` |
//! | β, T, L_T | n, n x n | propagator minus filter, its covariance, T = L_T L_T' | `difference`, `factor` |
//! | λ, t_d, h | 1 | statistic, threshold for d degrees of freedom, calibrated threshold | `value`, `thresholds` |
//! | N, L | steps | window, reset interval of the propagator pair | `window_steps`, `reset_steps` |
//! | M, s, θ | steps | window, onset stride and onset of the likelihood ratio | `window_steps`, `stride`, `onset` |
//! | F, A, E | n x q, q, q | sensitivity of the state, score, energy of an onset | `sensitivity`, `score`, `energy` |
//! | `tri(A)` | n x n | lower triangular L, L L' = A A' | [`triangularise`](crate::matrix::triangularise) |
//!
//! The guarantee is statistical: without fault a chi-square statistic exceeds t_d with the configured probability
//! at each instant, a calibrated one with the configured probability over a run, provided that model and noise
//! covariances are right.

mod achieved;
mod admissibility;
mod alarm;
mod calibration;
mod channel_writer;
mod channels;
mod construction;
mod cusum;
mod design;
mod diagnoser;
mod engine;
mod error;
mod filter;
mod finite;
mod glr;
mod glr_best;
mod glr_modes;
mod glr_table;
#[cfg(test)]
mod held_tests;
mod inputs;
mod instant;
mod method;
mod model_options;
mod non_centrality;
mod options;
mod plant;
mod power;
mod propagator;
mod quadratic_form;
mod quantile;
mod random;
mod sensitivity;
mod settled;
mod stability;
mod state;
mod steady;
mod step_model;
mod thresholds;
mod validate;
mod window;

pub use calibration::Calibration;
pub use design::{Design, DesignReport, InsensitiveWindow, InseparableModes};
pub use diagnoser::ChiSquareDiagnoser;
pub use engine::{Outcome, Statistic};
pub use error::ChiSquareError;
pub use glr::LikelihoodRatio;
pub use glr_modes::{FaultMode, FaultProfile};
pub use model_options::{MatricesOptions, ModelOptions, Schedule};
pub use non_centrality::non_centrality;
pub use options::{
    AlarmOptions, ChiSquareOptions, CusumOptions, ExclusionCheck, GlrOptions, NumericsOptions, OnIsolation,
    Signature, StabilityGuard, StatisticKind, StatisticsOptions, ThresholdMode, ThresholdOptions,
};
pub use quadratic_form::QuadraticForm;
pub use quantile::chi_square_upper_quantile;
pub use stability::{GuardVerdict, Stability, stability};
pub use steady::SteadyState;
pub use step_model::{SetModelError, StepModel};
pub use thresholds::Thresholds;
