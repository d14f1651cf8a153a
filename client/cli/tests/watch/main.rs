//! `residual watch` on a terminal: what it shows at several sizes, its keys, and its ends.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[path = "../support/mod.rs"]
mod support;

mod alarms;
mod lives;
mod scene;
mod screens;
mod terminal;
