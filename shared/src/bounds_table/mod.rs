//! The bounds table.
