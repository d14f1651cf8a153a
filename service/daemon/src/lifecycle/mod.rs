//! The life of a fault, one for all methods: from the records of a diagnoser to the transitions of its alarm.
//!
//! ```text
//!             violation                n of m violate              the faulty components are known
//!   Cleared ─────────────▶ Pending ─────────────────▶ Raised ─────────────────────────────────▶ Isolated
//!      ▲                      │                          │                                         │
//!      └──────────────────────┴───── c quiet steps ──────┴─────────────────────────────────────────┘
//!       no violation in m steps   and, if latched, acknowledged
//! ```
//!
//! No clock, no input or output, and no allocation after construction: a live daemon and a replay make the same
//! transitions of the same records.
//!
//! | symbol | key of `[diagnoser.lifecycle]` | meaning |
//! |---|---|---|
//! | n | `raise_steps` | violations that raise the alarm … |
//! | m | `raise_window` | … among so many evaluated steps, n ≤ m ≤ 64 |
//! | c | `clear_steps` | quiet evaluated steps in a row that clear it |
//! | ρ | `clear_ratio` | a quiet step has no enabled channel with a ratio above it, 0 < ρ ≤ 1 |
//! | s | `startup_suppression_s` | violations so soon after the first evaluated step raise nothing |
//!
//! | word | meaning |
//! |---|---|
//! | evaluated step | the verdict is neither `Starting` nor `NotEvaluated`; other steps change nothing |
//! | enabled channel | all conditions `[[diagnoser.lifecycle.enable]]` on it hold ([`Enabling`]) |
//! | faulty step | the verdict is `Fault`, `Isolated` or `GuaranteeLost`, and it is not excused |
//! | excused verdict | every channel beyond its bound (ratio > 1) is disabled; a verdict that goes on without any channel beyond its bound, latched by the method, is what it was at the last step that had one |
//! | violation | a faulty step that start-up suppression does not cover |
//! | quiet step | an evaluated step that is not faulty and has no enabled channel with a ratio above ρ |
//!
//! | module | what |
//! |---|---|
//! | `rules` | n, m, c, ρ, s, and what they mean for the delay |
//! | `enabling` | which channels count |
//! | `machine` | the states and their transitions |
//! | `state` | what survives a restart, whole or as far as the bounds table shows it |
//! | `transition` | from a change of state to the alarm transition that clients see |

mod enabling;
mod machine;
#[cfg(test)]
mod reference;
mod rules;
mod state;
#[cfg(test)]
mod tests;
mod transition;

pub use enabling::{EnableCondition, Enabling};
pub use machine::{Change, Changes, Lifecycle};
pub use rules::{MAX_WINDOW, Rules};
pub use state::LifecycleState;
pub use transition::transition;

/// Every channel of a record, as a set with one bit each.
pub const ALL_CHANNELS: u64 = u64::MAX;
