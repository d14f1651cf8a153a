//! Bank of zonotopic unknown-input set-membership filters (method sheet 1 to 4).

pub mod certificate;
mod decoupling;
mod filter;
mod gain;
mod missing;
pub mod modes;
pub mod options;
pub mod options_error;
mod options_validate;
mod outcome;
mod outward;
mod plant;
mod prediction;
mod state;
