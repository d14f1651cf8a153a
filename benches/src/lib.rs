//! Benchmarks of residuald: how fast a step is, how late a bound, how soon an alarm, how many diagnosers fit on a core,
//! and how that compares with what a user would take instead.
//!
//! Two kinds: `cargo bench -p residual-benches` are the small ones, of single functions; the program `residual-bench`
//! measures processes, with percentiles, peers in the same run, and writes the report.
//!
//! | module | what |
//! |---|---|
//! | [`percentiles`] | times as p50, p90, p99, p99.9, max |
//! | [`results`] | what a subcommand measured: findings against aims, tables, charts; one JSON file each |
//! | [`machine`] | what it was measured on, and under which load |
//! | [`processor`] | pinning to a core, real-time priority |
//! | [`process`] | other processes of the program itself: publishers, daemons, readers |
//! | [`path`] | the ways of samples, bounds and alarms between processes |
//! | [`peers`] | the same work done by what a user would take instead |
//! | [`report`] | all results as one Markdown file with charts |
//! | [`steps`] | single steps of every method: time, instructions, floating-point operations |
//! | [`load`] | how many diagnosers a core carries, and what they need |
//! | [`shared_words`] | bare shared memory, the peer of the bounds table |

pub mod load;
pub mod machine;
pub mod path;
pub mod peers;
pub mod percentiles;
pub mod process;
pub mod processor;
pub mod report;
pub mod results;
pub mod shared_words;
pub mod steps;
