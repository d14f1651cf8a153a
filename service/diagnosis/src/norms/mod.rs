//! Norms of linear time-invariant systems G = (A, B, C, D), off-line.
//!
//! | norm | definition | function |
//! |---|---|---|
//! | H∞ | sup σ_max G(jω), over the unit circle in discrete time | [`h_infinity_continuous`], [`h_infinity_discrete`] |
//! | H₋ | inf σ_min G(jω), 0 with more inputs than outputs | [`h_minus_continuous`], [`h_minus_discrete`] |
//! | ℓ1 | Σ_t \|g_ij(t)\|, entry by entry | [`l1_norm`] |
//! | window | memory constant μ of the energy in a window of N samples | [`WindowConstants`] |
//! | initial state | largest energy of the response to a unit initial state | [`initial_error_gain_continuous`], [`initial_error_gain_discrete`] |
//!
//! H∞ and H₋ come from level sets: a level is crossed at the imaginary eigenvalues of a Hamiltonian matrix, so
//! that the search ends with a proof that no frequency lies beyond the level (method sheet 3.5 of `hinf_filter`).

mod frequency;
mod impulse;
mod initial;
mod level;
mod minimum;
mod system;
mod window;

pub use impulse::l1_norm;
pub use initial::{initial_error_gain_continuous, initial_error_gain_discrete, observability_gramian};
pub use level::{h_infinity_continuous, h_infinity_discrete};
pub use minimum::{h_minus_continuous, h_minus_discrete};
pub use system::System;
pub use window::WindowConstants;

/// A norm, and whether the level-set search proved it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Norm {
    /// The norm; infinite if the system is not stable.
    pub value: f64,
    /// It is no smaller than this.
    pub lower: f64,
    /// And no larger: for H∞ the level that nothing crosses.
    pub upper: f64,
    /// False if the eigenvalues of a Hamiltonian did not converge, where the value is the best of a dense grid, or if
    /// the search did not end within its rounds.
    pub confirmed: bool,
}

impl Norm {
    fn proven(value: f64, lower: f64, upper: f64) -> Self {
        Self {
            value,
            lower,
            upper,
            confirmed: true,
        }
    }

    fn unconfirmed(value: f64, lower: f64, upper: f64) -> Self {
        Self {
            value,
            lower,
            upper,
            confirmed: false,
        }
    }

    /// Of a system that is not stable.
    fn infinite() -> Self {
        Self::proven(f64::INFINITY, f64::INFINITY, f64::INFINITY)
    }
}
