//! Semidefinite programs with known answers, one file for each class of problems.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[path = "../common/files.rs"]
mod files;

mod eigenvalue_bounds;
mod graph_bounds;
mod lyapunov_feasibility;
mod mistakes;
mod norm_minimisation;
mod svec_order;
mod trace_minimisation;
mod unsolvable;
