//! What a configuration may say, and where the daemon finds and leaves its files.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[path = "../common/mod.rs"]
mod common;
#[path = "../support/mod.rs"]
mod support;

mod documentation;
mod method_mistakes;
mod mistakes;
mod places;
mod refusals;
