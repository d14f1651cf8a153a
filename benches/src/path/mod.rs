//! The ways of samples, bounds and alarms between processes: how late, how soon, at what cost.
//!
//! | module | subcommand | what |
//! |---|---|---|
//! | [`latency`] | `latency` | sampling instant and sample published → bounds readable; jitter beside a bare timer loop |
//! | [`alarm`] | `alarm` | alarm raised → consumer awake, beside a bare futex and a bare iceoryx2 event |
//! | [`read`] | `read` | reading a record with 1 to 64 readers, beside an iceoryx2 blackboard |
//! | [`write`] | `write` | writing a record with 0 to 64 readers, an alarm with 0 to 8 sleepers, a step with both |
//! | [`stage`] | – | where it takes place: directory, instance, daemon, scheduling |
//! | [`crowd`] | – | processes that all do the same while they are told to |
//! | [`tables`] | – | bounds tables without a daemon |
//! | [`role`] | hidden | what the other processes do |

pub mod alarm;
pub mod crowd;
pub mod latency;
pub mod read;
pub mod role;
pub mod stage;
pub mod tables;
pub mod write;
