//! What the subcommands do.

pub mod replay;
pub mod run;
