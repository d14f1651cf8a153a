//! Gains of the robust fault detection filter by linear matrix inequalities (method sheet `hinf_filter` 3.3, 3.6).
//!
//! The error of an observer with gain L (or H) obeys e⁺ = (A - LC) e + (Bd - L Dd) d, r = C e + Dd d; ė instead of e⁺
//! in continuous time. With W = X L every condition below is linear in X and W.
//!
//! | symbol | shape | meaning |
//! |---|---|---|
//! | X | n x n | Lyapunov matrix, common to all conditions |
//! | W, Y = W' | n x q, q x n | X times the gain |
//! | Φ, Ψ | n x n, n x m | X A - W C, X Bd - W Dd |
//! | γ₁, γ₂ | | smallest level of stage 1, γ₂ = (1 + slack) γ₁ of stage 2 |
//! | s | | scale of X in stage 2: X / s certifies γ₂ |
//! | δ, T | , n x n | scales of the disturbance and of the state |
//! | He(M) | | M + M' |
//!
//! The solver is not trusted: a gain is returned only with a Lyapunov matrix for which the strict inequality holds,
//! recomputed in the original units, with the poles in the region and with the norm below the bound.

mod certificate;
mod error;
pub mod inequalities;
mod mixed;
mod paper;
mod plant;
mod scaling;
mod stages;
mod two_stage;

pub use error::LmiError;
pub use mixed::{MixedGain, mixed};
pub use paper::{Normalisation, PaperSolution, paper};
pub use plant::{ErrorPlant, Region};
pub use residual_diagnosis::hinf_filter::certificate::Time;
pub use two_stage::{LmiGain, two_stage_continuous, two_stage_discrete};
