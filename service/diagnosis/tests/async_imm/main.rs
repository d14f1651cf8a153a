//! Asynchronous fusion under packet loss against the method's facts.
//!
//! | module | what |
//! |---|---|
//! | `fixture` | designs, packets and runs from the reference files |
//! | `discretisation`, `units`, `scenarios`, `servo` | the reference files |
//! | `simulation` | the paper's example with random numbers of its own |
//! | `paper`, `long_run` | what the paper and the method sheet claim of it |
//! | `properties`, `rollback`, `packets`, `recovery` | what must hold for any plant and any packets |
//! | `configuration`, `mistakes` | tables, and what is refused in them |
//! | `allocation` | no allocation after construction |
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, unsafe_code)]

#[path = "../support/mod.rs"]
mod support;

mod allocation;
mod configuration;
mod discretisation;
mod fixture;
mod long_run;
mod mistakes;
mod packets;
mod paper;
mod properties;
mod random;
mod recovery;
mod rollback;
mod scenarios;
mod servo;
mod simulation;
mod units;
