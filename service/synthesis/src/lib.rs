//! Off-line design for model-based fault diagnosis: the work that needs a solver.
//!
//! Nothing here runs in real time. [`identify`] finds the bounds of a model from fault-free recordings; [`floors`]
//! finds the smallest fault that any method can guarantee to detect under given bounds, and [`certificates`] the
//! tests that detect it: [linear programs](linear_program). [`hinf_filter`] finds gains under matrix inequalities:
//! [semidefinite programs](semidefinite). All are solved by one [interior-point method](conic); no result is taken
//! from the solver unchecked.

pub mod bounds;
pub mod certificates;
pub mod conic;
pub mod floors;
pub mod hinf_filter;
pub mod identify;
mod lapack;
pub mod linear_program;
pub mod semidefinite;
mod window_equalities;
