//! Asynchronous interacting-multiple-model fusion under packet loss: a bank of Kalman filters, one per mode
//! (normal, fault 1, fault 2, …), on the same time-stamped samples of sensors without a common clock.
//!
//! dx/dt = A x + B u + G w + F f, z = H_s x(t) + v_s, f = D_m φ in mode m. The paper is Hu, Jin, Xue and Sun,
//! "Fault Diagnosis for Networked Systems By Asynchronous IMM Fusion Filtering"; equation numbers in ( ) are the
//! paper's, section numbers the method sheet's.
//!
//! | symbol | here | meaning |
//! |---|---|---|
//! | A, B, F, G Q G' | [`plant::LinearPlant`] | plant, 1/s; G Q G' is a power spectral density |
//! | D_m, q_φ | [`design::Mode`] | direction and random walk of the amplitude φ in mode m |
//! | H_s, R_s, β_s | [`design::Sensor`] | sensor s |
//! | x̂₀, P₀, φ₀, P_φ0, μ₀ | [`design::Prior`] | knowledge at t_0 |
//! | Λ, Γ | [`design::ModeTransition`], [`transition`] | probabilities and rates of mode changes |
//! | Φ, Υ, Ξ, Ω | [`interval::Interval`] | the plant over an interval, common to all modes |
//! | Φ̄_m, Ω̄_m | `transport` | the same for \[x; φ\] in mode m |
//! | x̂^m, P^m, log μ^m | [`state::Posterior`] | mode filters at t_k |
//! | c^m, w_{i\|m} | [`mixing`] | predicted probabilities, mixing weights |
//! | ℓ^m | [`estimator::ImmEstimator::log_likelihood`] | log-likelihood of the samples of an interval |
//! | μ_T, L, κ, W | [`settings::Settings`] | threshold, window, bound of the amplitudes, roll-back |
//!
//! There is no guaranteed bound: mixing is a moment-matched approximation, and every probability is conditional on
//! the modes, Q and R.

mod achieved;
pub mod batch;
mod batch_update;
mod channels;
pub mod checks;
pub mod decision;
pub mod design;
pub mod design_error;
mod diagnoser;
pub mod dyadic;
pub mod estimator;
pub mod exact;
pub mod fusion;
pub mod inputs;
pub mod interval;
mod joseph;
mod joseph_update;
mod memory;
mod method;
pub mod mixing;
pub mod options;
mod options_design;
mod packet_store;
pub mod plant;
pub mod probability;
pub mod propagator;
mod reception;
mod recursion;
mod semidefinite;
mod sensor;
pub mod settings;
mod small_bank;
#[cfg(test)]
mod small_bank_tests;
mod small_transport;
mod square_root;
pub mod state;
mod stepping;
mod time_varying;
pub mod transition;
mod transport;

pub use diagnoser::AsyncImm;
pub use memory::Counters;
