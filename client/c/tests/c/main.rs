//! The C interface, through programs that the system's compiler makes.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

extern crate residual as residual_client;

#[path = "../../../lib/tests/support/dump.rs"]
mod dump;
#[path = "../../../lib/tests/support/front_page.rs"]
mod front_page;
#[path = "../../../lib/tests/support/scenes.rs"]
mod scenes;
#[path = "../../../lib/tests/support/mod.rs"]
mod support;

mod compiler;
mod examples;
mod header;
mod reading;
