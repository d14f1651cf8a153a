//! What two processes of residuald must agree on, and nothing else.
//!
//! | module | what |
//! |---|---|
//! | [`record`] | what a diagnoser says at one sampling instant |
//! | [`alarm`] | the life of a fault: states and numbered transitions |
//! | [`counters`] | what was received, rejected, lost, late or skipped |
//! | [`bounds_table`] | the shared-memory segment in which clients poll the records |
//! | [`sample`], [`transport`] | a sensor sample and its iceoryx2 service (feature `transport`) |
//! | [`control`] | requests to a running daemon and their answers (feature `transport`) |
//! | [`names`] | paths and service names of an instance |
//! | [`clock`] | CLOCK_MONOTONIC nanoseconds and the daemon's time |
//!
//! This crate knows neither the daemon nor the diagnosis methods.

pub mod alarm;
pub mod bounds_table;
pub mod clock;
#[cfg(feature = "transport")]
pub mod control;
pub mod counters;
pub mod names;
pub mod record;
#[cfg(feature = "transport")]
pub mod sample;
#[cfg(feature = "transport")]
pub mod transport;
