//! Asynchronous fusion under packet loss against the method's facts.
//!
//! | module | what |
//! |---|---|
//! | `fixture`, `random`, `simulation` | reference files, random designs, and the paper's example with random numbers |
//! | `discretisation`, `units`, `scenarios`, `servo` | the reference files |
//! | `stacked` | Theorem 1 against the covariance of all samples |
//! | `paper`, `long_run`, `options` | what the paper and the method sheet claim |
//! | `properties`, `rollback`, `packets`, `recovery` | what must hold for any plant and any packets |
//! | `configuration`, `mistakes`, `achieved` | tables, what is refused in them, and what a design states |
//! | `allocation` | no allocation after construction |
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, unsafe_code)]

#[path = "../support/mod.rs"]
mod support;

mod achieved;
mod allocation;
mod configuration;
mod discretisation;
mod fixture;
mod long_run;
mod mistakes;
mod options;
mod packets;
mod paper;
mod properties;
mod random;
mod recovery;
mod rollback;
mod scenarios;
mod servo;
mod simulation;
mod stacked;
mod units;
