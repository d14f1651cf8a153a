//! The commands ahead of a start: `check`, `design` and `identify`, and the gains files between them and the daemon.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[path = "../common/mod.rs"]
mod common;
#[path = "../recordings/mod.rs"]
mod recordings;

mod check;
mod design_plot;
mod examples;
mod file;
mod identify;
