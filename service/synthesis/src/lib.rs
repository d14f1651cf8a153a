//! Off-line design for model-based fault diagnosis: the work that needs a solver.
//!
//! Nothing here runs in real time. [`identify`] finds the bounds of a model from fault-free recordings;
//! [`unknown_input_filter`] the smallest fault that any method can guarantee to detect under given bounds, and the
//! tests that detect it. All are linear programs, solved by an interior-point method; no result is taken from the
//! solver unchecked.

pub mod bounds;
pub mod identify;
pub mod linear_program;
pub mod unknown_input_filter;
