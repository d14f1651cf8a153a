//! What the subcommands do.

pub mod check;
pub mod identify;
pub mod replay;
pub mod run;
