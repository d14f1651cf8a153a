//! Replay: a recording feeds the inputs instead of sensors.
//!
//! Two ways share everything but the clock: [`simulated`] steps the engine in this process as fast as it can,
//! [`through_daemon`] publishes over iceoryx2 to a running daemon at the recorded pace. Without late samples
//! both give the same records to the last bit. A recording made by `residual record --samples` is replayed in this
//! process ([`recorded`]), at the recorded instants.
//!
//! | module | what |
//! |---|---|
//! | [`recording`] | a CSV file in memory, split into runs |
//! | [`run`] | one run and its times |
//! | [`selection`] | which runs are replayed |
//! | [`injection`] | faults written into a recording |
//! | [`loss`] | packet loss put into a replay |
//! | [`mapping`] | recording → timed samples of the configured inputs |
//! | [`records`] | step records to CSV |
//! | [`alarms`] | alarm transitions to CSV |
//! | [`recorded`], [`comparison`] | an MCAP recording, and whether its records come out again |
//! | [`sequences`] | a run as one diagnoser would see it |
//! | [`outcome`] | what the records of a run say: false alarms, detection, isolation |
//! | [`report`] | the outcomes in words, run by run and in total |
//! | [`detections`] | the outcomes as rows and totals |
//! | [`detection_table`] | these as text, for people and for programs |

pub mod alarms;
pub mod comparison;
pub mod detection_table;
pub mod detections;
pub mod injection;
pub mod loss;
pub mod mapping;
pub mod outcome;
pub mod recorded;
pub mod recording;
pub mod records;
pub mod report;
pub mod run;
pub mod selection;
pub mod sequences;
pub mod simulated;
pub mod through_daemon;
