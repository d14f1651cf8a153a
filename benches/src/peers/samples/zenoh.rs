//! Round trips of zenoh messages between two processes of `benches/peers/zenoh`.

use std::net::TcpListener;
use std::path::Path;
use std::process::Command;

use anyhow::Result;
use hdrhistogram::Histogram;

use crate::process::Process;

/// Round trips that do not count.
const WARM: usize = 500;

/// Adds `count` half round trips, nanoseconds, to `half_trips`.
///
/// # Errors
/// One of the processes fails.
pub fn round_trips(
    program: &Path,
    bytes: usize,
    count: usize,
    half_trips: &mut Histogram<u64>,
) -> Result<()> {
    let port = TcpListener::bind("127.0.0.1:0")?.local_addr()?.port();
    let start = |arguments: &[String]| {
        let mut command = Command::new(program);
        command.args(arguments);
        Process::start_command(command)
    };
    let mut pong = start(&["pong".to_owned(), port.to_string()])?;
    pong.line()?;
    let mut ping = start(&[
        "ping".to_owned(),
        port.to_string(),
        bytes.to_string(),
        count.to_string(),
        WARM.to_string(),
    ])?;
    for time in ping.said::<Vec<u64>>()? {
        half_trips.record(time / 2)?;
    }
    ping.end()?;
    pong.end()
}
