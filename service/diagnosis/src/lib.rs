//! Model-based fault diagnosis: mathematics only.
//!
//! No input or output, no clock, no panic, and no allocation after construction. A method is constructed once
//! from a model and its options and then [stepped](diagnoser::Diagnoser::step) at every sampling instant.

pub mod diagnoser;
pub mod discretise;
pub mod model;
pub mod unknown_input_filter;
