//! The daemon at work: from samples to records.
//!
//! ```text
//! subscribers ─▶ inbox ─▶ assembler ─▶ diagnoser ─▶ record ─▶ bounds table (step thread)
//!                └────────── engine ──────────┘        ├▶ alarm ring of the table ─▶ companion thread ─▶ log, events
//!                                                      └▶ queue ─────────────────▶ companion thread ─▶ recorders
//! ```
//!
//! | module | what |
//! |---|---|
//! | [`inbox`] | the door of one input: checks, counts, keeps |
//! | [`assembler`] | samples of one sampling instant → step input |
//! | [`schedule`] | sampling instants and who is next |
//! | [`unit`] | one diagnoser at its instants |
//! | [`engine`] | all of it without clock and thread, shared with `replay` |
//! | [`checkpoint`] | the file that holds them |
//! | [`snapshot`], [`warm_start`] | the engine's states as bytes, and a new life that goes on from them |
//! | [`take_over`] | one engine goes on with what another one did |
//! | [`live`] | the step thread: waits, obeys commands, receives, steps, publishes |
//! | [`command`] | commands to the step thread, and their replies |
//! | [`exchange`] | the step thread goes on with another configuration |
//! | [`upkeep`], [`reload`] | the long tasks: checkpoint, reload |
//! | [`running`], [`life`] | the configuration in force; where a life of the daemon begins |
//! | [`companion`] | everything slow: recorders, log, control requests, cleaning |
//! | [`resume`] | alarms go on over a restart |
//! | [`real_time`] | scheduling policy, processor, locked memory |
//! | [`lock`] | one daemon per instance |

pub mod assembler;
pub mod checkpoint;
pub mod command;
pub mod companion;
pub mod engine;
pub mod exchange;
pub mod inbox;
pub mod life;
pub mod live;
pub mod lock;
pub mod real_time;
pub mod reload;
pub mod resume;
pub mod running;
pub mod schedule;
pub mod snapshot;
pub mod take_over;
pub mod unit;
pub mod upkeep;
pub mod warm_start;
