//! Models identified from simulated plants whose truth is known.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod covariances;
mod regression;
mod simulation;
mod state_space;
mod structure_mistakes;
