//! Listening to alarms over the lives of a daemon, played by a table writer.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[path = "../support/mod.rs"]
mod support;

mod lives;
mod model;
mod waiting;
