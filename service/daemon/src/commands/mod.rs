//! What the subcommands do.

mod achieved;
pub mod check;
mod descriptions;
pub mod design;
pub mod explain;
#[cfg(feature = "synthesis")]
pub mod identify;
mod lines;
pub mod replay;
mod replay_recorded;
pub mod run;
