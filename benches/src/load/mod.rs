//! How many diagnosers a core carries, and what they need while they run.
//!
//! | module | what |
//! |---|---|
//! | [`fleet`] | the configuration: any number of diagnosers of all methods at 100 Hz |
//! | [`plants`] | what their sensors say |
//! | [`simulated`] | the daemon's engine and publication on a simulated clock |

pub mod fleet;
pub mod plants;
pub mod simulated;
