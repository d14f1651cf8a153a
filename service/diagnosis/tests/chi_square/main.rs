//! State and residual chi-square tests, likelihood ratio and cumulative sums, against method sheet and reference.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, unsafe_code)]

#[path = "../support/mod.rs"]
mod support;

mod common;
mod facts;
mod figures;
mod kernels;
mod plant;
mod properties;
mod reference;
mod table;
