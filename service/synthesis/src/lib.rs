//! Off-line design for model-based fault diagnosis: the work that needs a solver.
//!
//! Nothing here runs in real time. [`identify`] finds the bounds of a model from fault-free recordings;
//! [`unknown_input_filter`] the smallest fault that any method can guarantee to detect under given bounds, and the
//! tests that detect it. They are [linear programs](linear_program). Gains under matrix inequalities are
//! [semidefinite programs](semidefinite). All are solved by one [interior-point method](conic); no result is taken
//! from the solver unchecked.

pub mod bounds;
pub mod conic;
pub mod identify;
mod lapack;
pub mod linear_program;
pub mod reduced_order_observer;
pub mod semidefinite;
pub mod unknown_input_filter;
