//! An engine goes on with what another one did: after a restart from a snapshot, and after a take-over.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[path = "../counting_allocator/mod.rs"]
mod counting_allocator;
mod fixture;
mod take_over;
mod warm_start;
