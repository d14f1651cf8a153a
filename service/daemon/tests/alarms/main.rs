//! Alarms: what the engine makes of records, and what of it reaches other processes.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[path = "../support/mod.rs"]
mod support;

mod engine;
mod processes;
