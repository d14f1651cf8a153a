//! What the subcommands do.

pub mod check;
pub mod replay;
pub mod run;
