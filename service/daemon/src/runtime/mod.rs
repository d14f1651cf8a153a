//! The daemon at work: from samples to records.
//!
//! ```text
//! subscribers ─▶ inbox ─▶ assembler ─▶ diagnoser ─▶ record ─▶ bounds table (step thread)
//!                └────────── engine ──────────┘        └▶ queue ─▶ companion thread ─▶ recorders, log
//! ```
//!
//! | module | what |
//! |---|---|
//! | [`inbox`] | the door of one input: checks, counts, keeps |
//! | [`assembler`] | samples of one sampling instant → step input |
//! | [`schedule`] | sampling instants and who is next |
//! | [`engine`] | all of it without clock and thread, shared with `replay` |
//! | [`live`] | the step thread: waits, obeys commands, receives, steps, publishes |
//! | [`command`] | commands to the step thread, and their replies |
//! | [`companion`] | everything slow: recorders, log, control requests, cleaning |
//! | [`real_time`] | scheduling policy, processor, locked memory |
//! | [`lock`] | one daemon per instance |

pub mod assembler;
pub mod command;
pub mod companion;
pub mod engine;
pub mod inbox;
pub mod live;
pub mod lock;
pub mod real_time;
pub mod schedule;
