//! Recordings of a residuald daemon: what they hold, how they are written, read and made.
//!
//! A recording is an [MCAP](https://mcap.dev) file with JSON messages and a JSON schema for each topic, which
//! Foxglove, PlotJuggler and the libraries of MCAP open. It is of one bounds table of one daemon, so of one epoch.
//!
//! | topic | messages | schema |
//! |---|---|---|
//! | `/INSTANCE/records/DIAGNOSER` | every step record | [`message::record`] |
//! | `/INSTANCE/alarms` | every alarm transition | [`message::alarm`] |
//! | `/INSTANCE/samples/INPUT` | every sample of an input, when asked for | [`message::sample`] |
//!
//! | metadata | what | in the file |
//! |---|---|---|
//! | `residual.recording` | [`header::Header`]: instance, epoch, diagnosers, inputs, times | at the beginning |
//! | `residual.totals` | [`totals::Totals`]: what was recorded and what was lost | at the end |
//!
//! # Numbers
//! Every number comes back with the bits it had. JSON knows neither NaN nor infinity: see [`number`].
//!
//! # Times
//! | time | what |
//! |---|---|
//! | `instant_ns`, `timestamp_ns`, `received_ns`, … in messages | the daemon's time, nanoseconds |
//! | publish time of a message | the sampling instant, or the sample's stamp, on the wall clock |
//! | log time of a message | when the recorder received it, on the wall clock |
//!
//! The wall clock is compared with CLOCK_MONOTONIC once, at the beginning, so that its being set does not tear the
//! recording; the header holds the difference ([`header::Header::wall_clock_offset_ns`]).
//!
//! # Crashes
//! What the recorder has received reaches the file at the latest a second later ([`recorder`]). A recorder that is
//! killed leaves a file without end; [`reader::Reader`] reads it up to its last whole chunk and says so.

pub mod columns;
pub mod header;
pub mod message;
pub mod number;
pub mod reader;
pub mod recorder;
mod schema;
pub mod topic;
pub mod totals;
pub mod writer;

pub use header::Header;
pub use message::{RecordMessage, SampleMessage};
pub use reader::{Event, ReadError, Reader};
pub use totals::Totals;
pub use writer::{WriteError, Writer};
