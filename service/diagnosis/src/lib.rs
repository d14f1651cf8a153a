//! Model-based fault diagnosis: mathematics only.
//!
//! No input or output, no clock, no panic, and no allocation after construction. A method is constructed once
//! from a model and its options and then [stepped](diagnoser::Diagnoser::step) at every sampling instant.

// `!(|r| <= h)` is the alarm rule: unlike `|r| > h` it is never silent for a value that is not a number.
#![allow(clippy::neg_cmp_op_on_partial_ord)]

pub mod achieved;
pub mod async_imm;
mod buffer;
pub mod chi_square;
mod choice;
pub mod covariance;
pub mod decomposition;
pub mod diagnoser;
pub mod discretise;
pub mod factor;
pub mod gains;
pub mod hinf_filter;
pub mod lyapunov;
pub mod matrix;
pub mod method;
pub mod model;
pub mod norms;
pub mod packets;
pub mod reduced_order_observer;
pub mod response;
pub mod riccati;
pub mod rounding;
pub mod spectrum;
pub mod state;
pub mod tables;
pub mod unknown_input_filter;
pub mod zonotope;
