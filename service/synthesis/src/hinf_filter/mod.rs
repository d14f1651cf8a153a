//! Gains of the robust fault detection filter that need a solver.

// A condition is written so that a value that is not a number fails it.
#![allow(clippy::neg_cmp_op_on_partial_ord)]

pub mod lmi;
