//! Bank of zonotopic unknown-input set-membership filters (method sheet 1 to 4).

mod achieved;
mod bank;
pub mod certificate;
mod channels;
pub mod checks;
mod construction;
pub mod decision;
mod decoupling;
mod design_words;
pub mod error;
mod few_states;
mod filter;
pub mod fixed_gain;
mod fixed_step;
mod floors;
mod gain;
pub mod gains;
pub mod gains_check;
mod gains_complete;
mod kalman;
pub mod lti;
mod missing;
mod mode_filter;
pub mod modes;
pub mod options;
mod options_counts;
pub mod options_error;
mod options_validate;
mod outcome;
mod outward;
mod paper;
pub mod parity;
pub mod parity_window;
mod plant;
mod prediction;
mod reset;
mod sensitivity;
mod settled;
mod state;
mod strip_reset;
pub mod tables;
mod thresholds;
mod workspace;

pub use bank::UnknownInputFilterBank;

#[cfg(test)]
mod facts_tests;
