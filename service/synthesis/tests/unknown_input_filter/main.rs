//! Gains of a bank of unknown-input filters: certificates, floors, the way through a gains file, what is achieved.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[path = "../common/reference.rs"]
mod reference_files;

mod achieved;
mod altered;
mod certificates;
mod floors;
mod gains_file;
mod support;
