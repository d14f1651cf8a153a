//! Gains of the reduced-order observer by semidefinite and linear programs, against the facts of its method sheet.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[path = "../common/files.rs"]
mod files;
#[allow(dead_code)]
#[path = "../../../diagnosis/tests/reduced_order_observer/simulation.rs"]
mod simulation;

mod choice;
mod directions;
mod facts;
mod fixtures;
mod random_plants;
mod verdicts;
