//! Replays of recordings with known faults, simulated and of real vehicles, and what is stated about them.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[path = "../recordings/mod.rs"]
mod recordings;
#[path = "../support/mod.rs"]
mod support;

mod labelled;
mod recorded_car;
mod recorded_drive;
mod recorded_flights;
