//! The method `hinf_filter` against its reference files, its claims and its guarantee.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
// `!(a <= b)` also holds for a value that is not a number.
#![allow(clippy::neg_cmp_op_on_partial_ord)]

#[path = "../support/mod.rs"]
mod support;

mod achieved;
mod claims;
mod detection_times;
mod gains;
mod guarantee;
mod kernels;
mod lower_bound;
mod mistakes;
mod paper;
mod paper_facts;
mod paper_runs;
mod papers_example;
mod properties;
mod sampled;
mod theorem_1;
mod vehicle;
