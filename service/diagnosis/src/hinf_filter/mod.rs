//! Robust fault detection filter: an observer whose residual is weakly driven by disturbances and strongly by faults,
//! with windowed residual energy and thresholds that no fault-free operation within the declared bounds exceeds.
//!
//! | symbol | shape | meaning | where |
//! |---|---|---|---|
//! | A, B, C, D, Bd, Dd, Bf, Df | | continuous plant | [`plant::Plant`] |
//! | Ad, Bud, Bdd, Bfd | | the same, sampled | [`plant::SampledPlant`] |
//! | H, L | n x q | continuous and discrete gain | [`synthesis`], [`certificate::Gain`], [`gains`] |
//! | V | s x q | post-filter, r̃ = V r | [`certificate::Gain`] |
//! | Ac = Ad - LC | n x n | error from instant to instant | [`constants::ErrorFilter`] |
//! | T_rd, T_rf | | from disturbance and fault to the residual | [`certificate::Certificate`] |
//! | X, Π | n x n | Lyapunov matrix and Riccati solution that prove a bound | [`gains`], [`bounded_real`] |
//! | J, W_F | | the paper's objective and reference model | [`paper_objective`] |
//! | γ, μ, κ_j | | norm and memory of the window energy | [`constants::ThresholdConstants`] |
//! | ρ, J, Jth | s, 1, 1 | bound of r̃, root energy of r̃ in the window, its threshold | `bounds`, `filter` |
//! | S_v = Cᵛ(Aᵛ)ᵏ | s x dim | what is left of the initial error | `bounds` |
//! | b, r_g, c | s, 1, s x s | what lost samples may still do | [`gap::GapEnvelope`] |
//!
//! Source: "The design of a robust fault-detection filter: the LMI approach", corrected: the paper's theorem 1 does not
//! bound the filter that it recovers (method sheet 3.6), so every gain is certified anew, whatever its origin.

mod achieved;
mod bank;
pub mod bounded_real;
mod bounds;
pub mod certificate;
mod channels;
pub mod checks;
pub mod claims;
mod combinations;
pub mod conditions;
pub mod constants;
mod construction;
mod diagnoser;
pub mod error;
pub mod faults;
mod filter;
pub mod find;
pub mod gains;
pub mod gap;
mod isolation;
pub mod lower_bound;
mod main_filter;
pub mod method;
pub mod noise;
mod observer;
pub mod options;
pub mod paper_objective;
pub mod plant;
pub mod problem;
mod reading;
pub mod realisation;
mod report;
mod responses;
mod rounding;
mod sensitivity;
pub mod synthesis;
mod verified;
mod window_energy;
mod window_length;

pub use diagnoser::HinfFilter;
pub use main_filter::{Certified, certified};
pub use report::Report;
pub use window_energy::WindowEnergy;
