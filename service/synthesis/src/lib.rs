//! Off-line design for model-based fault diagnosis: the work that needs a solver.
//!
//! Nothing here runs in real time. [`identify`] finds models, their bounds and covariances from fault-free recordings;
//! [`floors`] finds the smallest fault that any method can guarantee to detect under given bounds, and [`certificates`] the
//! tests that detect it. Bounds, floors and tests are linear programs, solved by an interior-point method; no result is
//! taken from the solver unchecked.

pub mod bounds;
pub mod certificates;
pub mod floors;
pub mod identify;
pub mod linear_program;
mod window_equalities;
