//! Gains of the robust fault detection filter by matrix inequalities against the reference and the method's claims.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
// `!(a <= b)` also holds for a value that is not a number.
#![allow(clippy::neg_cmp_op_on_partial_ord)]

#[path = "../common/files.rs"]
mod files;

mod assembly;
mod designs;
mod mixed;
mod paper_facts;
mod paper_synthesis;
mod plants;
mod random_plants;
mod refusals;
mod riccati_optimum;
