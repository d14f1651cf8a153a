//! Bank of zonotopic unknown-input set-membership filters (method sheet 1 to 4).

pub mod certificate;
pub mod modes;
pub mod options;
pub mod options_error;
mod options_validate;
