//! The demonstration: publisher, daemon and polling client as three processes, with nothing to prepare.
//!
//! | module | process | what |
//! |---|---|---|
//! | [`plant`] | publisher | the aircraft of the paper's example |
//! | [`publisher`] | publisher | simulates it and publishes at 100 Hz |
//! | [`client`] | client | polls the bounds table and shows what it reads |
//! | [`conductor`] | the one that was started | starts the three, injects a fault, judges the result |

pub mod client;
pub mod conductor;
pub mod plant;
pub mod publisher;
