//! Off-line design for model-based fault diagnosis: the work that needs a solver.
//!
//! Nothing here runs in real time. One module a method finds its gains: [`unknown_input_filter`] by linear programs,
//! [`reduced_order_observer`] and [`hinf_filter`] by matrix inequalities; [`identify`] finds models, their bounds and
//! covariances in recordings. [Linear programs](linear_program) and [semidefinite programs](semidefinite) are solved by
//! one [interior-point method](conic); no result is taken from the solver unchecked.

pub mod bounds;
pub mod conic;
pub mod hinf_filter;
pub mod identify;
mod lapack;
pub mod linear_program;
pub mod reduced_order_observer;
pub mod semidefinite;
pub mod unknown_input_filter;
