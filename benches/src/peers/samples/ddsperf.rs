//! Round trips of Cyclone DDS with its own `ddsperf`, which tells half round trips of every second.

use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result};

use super::Latency;
use crate::process::Process;

/// What `ddsperf ping` says of one second; times in nanoseconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Second {
    p50: f64,
    p90: f64,
    p99: f64,
    max: f64,
    count: u64,
}

/// Pings for so many seconds; in the first one the two processes find each other.
///
/// # Errors
/// `ddsperf` does not start.
pub fn run(program: &Path, bytes: usize, seconds: u32) -> Result<Vec<Second>> {
    // A domain of its own, so that others on the network do not answer.
    let domain = (20 + std::process::id() % 200).to_string();
    let mut pong = Command::new(program);
    pong.args(["-i", &domain, "pong"]);
    let pong = Process::start_command(pong)?;
    let mut ping = Command::new(program);
    ping.args([
        "-i",
        &domain,
        "-D",
        &(seconds + 1).to_string(),
        "ping",
        "size",
        &bytes.to_string(),
    ]);
    let output = ping.output().context("ddsperf does not start")?;
    drop(pong);
    let text = String::from_utf8_lossy(&output.stdout);
    Ok(text.lines().filter_map(parse).collect())
}

/// A line such as `[7] 2.0  host:8 size 80 mean 13.3us min 7.2us 50% 7.6us 90% 8.6us 99% 92.7us max 2197.3us cnt 37324`;
/// `None` for all others.
fn parse(line: &str) -> Option<Second> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let after = |name: &str| {
        let place = words.iter().position(|word| *word == name)?;
        words.get(place + 1).copied()
    };
    let time = |name| Some(after(name)?.strip_suffix("us")?.parse::<f64>().ok()? * 1e3);
    Some(Second {
        p50: time("50%")?,
        p90: time("90%")?,
        p99: time("99%")?,
        max: time("max")?,
        count: after("cnt")?.parse().ok()?,
    })
}

/// All seconds as one: the medians of their percentiles, the largest maximum; `None` of no second at all.
pub fn together(seconds: &[Second]) -> Option<Latency> {
    let median = |of: fn(&Second) -> f64| {
        let mut values: Vec<f64> = seconds.iter().map(of).collect();
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied()
    };
    Some(Latency {
        samples: seconds.iter().map(|second| second.count).sum(),
        p50: median(|second| second.p50)?,
        p90: median(|second| second.p90)?,
        p99: median(|second| second.p99)?,
        p999: None,
        max: seconds.iter().map(|second| second.max).fold(0.0, f64::max),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As version 0.10.2 writes it.
    const OUTPUT: &str = "[2217] participant vm:2217: new (self)
[2217] participant vm:2218: new
[2217] 2.000  vm:2218 size 80 mean 13.319us min 7.240us 50% 7.616us 90% 8.637us 99% 92.743us max 2197.289us cnt 37324
[2217] 2.000  rss:7.6MB vcsw:19575 ivcsw:18584 recvUC:8%+22%
[2217] 3.000  vm:2218 size 80 mean 14.053us min 7.090us 50% 7.606us 90% 8.768us 99% 93.305us max 2465.421us cnt 35386
";

    #[test]
    fn the_lines_of_round_trips_are_read_and_the_others_left_out() {
        let seconds: Vec<Second> = OUTPUT.lines().filter_map(parse).collect();
        assert_eq!(seconds.len(), 2);
        let first = Second {
            p50: 7616.0,
            p90: 8637.0,
            p99: 92743.0,
            max: 2197289.0,
            count: 37324,
        };
        let close = |a: f64, b: f64| (a - b).abs() < 1e-6;
        assert!(close(seconds[0].p50, first.p50) && close(seconds[0].p90, first.p90));
        assert!(close(seconds[0].p99, first.p99) && close(seconds[0].max, first.max));
        assert_eq!(seconds[0].count, first.count);
    }

    #[test]
    fn seconds_together_have_the_median_percentiles_and_the_largest_maximum() {
        let seconds: Vec<Second> = OUTPUT.lines().filter_map(parse).collect();
        let all = together(&seconds).unwrap();
        assert_eq!(all.samples, 37324 + 35386);
        assert!((all.max - 2_465_421.0).abs() < 1e-6 && all.p999.is_none());
        assert!(together(&[]).is_none());
    }
}
