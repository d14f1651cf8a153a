//! State and residual chi-square tests, likelihood ratio and cumulative sums, against method sheet and reference.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, unsafe_code)]

#[path = "../support/mod.rs"]
mod support;

mod achieved;
mod behaviour;
mod common;
mod examples;
mod facts;
mod figures;
mod isolation;
mod kernels;
mod mistakes;
mod plant;
mod properties;
mod reference;
mod table;
