//! How many diagnosers a core carries, what they need while they run, and how fast recordings are replayed.
//!
//! | module | what |
//! |---|---|
//! | [`fleet`] | the configuration: any number of diagnosers of all methods at 100 Hz |
//! | [`plants`] | what their sensors say |
//! | [`simulated`] | the daemon's engine and publication on a simulated clock |
//! | [`daemon`], [`publishers`] | the daemon and its sensors as processes |
//! | [`with_faults`](mod@with_faults) | both, with plants that are faulty now and then |
//! | [`usage`] | what the kernel knows of a process: processor time, memory, page faults |
//! | [`throughput`], [`soak`], [`steady`], [`replay`] | the subcommands |

pub mod daemon;
pub mod fleet;
pub mod plants;
pub mod publishers;
pub mod replay;
pub mod simulated;
pub mod soak;
pub mod steady;
pub mod throughput;
pub mod usage;
pub mod with_faults;
