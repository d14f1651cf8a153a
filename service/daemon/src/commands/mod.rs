//! What the subcommands do.

mod achieved;
pub mod check;
pub(crate) mod descriptions;
pub mod design;
pub mod explain;
pub mod generate;
#[cfg(feature = "synthesis")]
pub mod identify;
mod lifecycle;
mod lines;
pub mod replay;
mod replay_recorded;
pub mod run;
