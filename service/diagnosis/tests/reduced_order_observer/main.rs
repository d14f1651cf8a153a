//! The reduced-order observer against the reference files, the facts of its method sheet and its own promises.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[path = "../support/mod.rs"]
mod support;

mod claims;
mod design_facts;
mod fixtures;
mod gains;
mod mistakes;
mod noise_missing_reference;
mod properties;
mod servo_reference;
mod simulation;
mod vehicle_reference;
mod zonotope_reference;
