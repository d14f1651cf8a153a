//! Latency of one sample between two processes, beside Cyclone DDS and zenoh: half of a round trip, one after the other.

mod ddsperf;
pub mod own;
mod zenoh;

use anyhow::Result;
use hdrhistogram::Histogram;

use super::environment::Environment;
use crate::percentiles::{duration, significant, times};
use crate::results::{Finding, Results, Table};
use own::Wait;

/// Elements of a sample: an inertial measurement unit with temperature and status.
const ELEMENTS: usize = 8;

/// Bytes of a sample: elements, sequence number, time stamp.
const BYTES: usize = 8 * ELEMENTS + 16;

/// Half round trips of one program, nanoseconds; what it does not tell is `None`.
struct Latency {
    samples: u64,
    p50: f64,
    p90: f64,
    p99: f64,
    p999: Option<f64>,
    max: f64,
}

impl Latency {
    fn of(half_trips: &Histogram<u64>) -> Self {
        let quantile = |part| half_trips.value_at_quantile(part) as f64;
        Self {
            samples: half_trips.len(),
            p50: quantile(0.5),
            p90: quantile(0.9),
            p99: quantile(0.99),
            p999: Some(quantile(0.999)),
            max: half_trips.max() as f64,
        }
    }
}

/// Compares the latencies; every program runs in turn, twice unless `quick`.
///
/// # Errors
/// This side fails.
pub fn compare(environment: &Environment, quick: bool, results: &mut Results) -> Result<()> {
    let count = if quick { 5_000 } else { 20_000 };
    let (mut polled, mut woken, mut routed) = (times(), times(), times());
    let mut seconds = Vec::new();
    let zenoh = environment.zenoh();
    let ddsperf = environment.ddsperf();
    let polling_is_fair = results.machine.cores >= 2;
    for _ in 0..if quick { 1 } else { 2 } {
        if polling_is_fair {
            own::round_trips(Wait::Polling, count, &mut polled)?;
        }
        own::round_trips(Wait::Events, count, &mut woken)?;
        if let Ok(program) = &ddsperf {
            seconds.extend(ddsperf::run(program, BYTES, if quick { 3 } else { 6 })?);
        }
        if let Ok(program) = &zenoh {
            zenoh::round_trips(program, BYTES, count / 2, &mut routed)?;
        }
    }
    let dds = ddsperf.and_then(|_| {
        ddsperf::together(&seconds)
            .ok_or_else(|| "ddsperf found no partner on this machine's network".to_owned())
    });
    let zenoh = zenoh.map(|_| Latency::of(&routed));
    let woken = Latency::of(&woken);
    let polled = (polling_is_fair && !polled.is_empty()).then(|| Latency::of(&polled));
    if polled.is_none() {
        results.skip(
            "the latency of a polled sample",
            "two processes that poll need two cores, and a machine without much other work",
        );
    }

    let mut table = Table::new(
        format!("Latency of a sample of {BYTES} bytes between two processes, half of a round trip"),
        &[
            "transport",
            "the receiver",
            "samples",
            "p50",
            "p90",
            "p99",
            "p99.9",
            "max",
            "p50 / ours",
        ],
    );
    let mut row = |name: &str, receiver: &str, latency: &Latency, ours: &Latency| {
        let times = [
            Some(latency.p50),
            Some(latency.p90),
            Some(latency.p99),
            latency.p999,
            Some(latency.max),
        ];
        let times = times.map(|time| time.map_or("not told".to_owned(), duration));
        let (first, last) = (
            [name.to_owned(), receiver.to_owned(), latency.samples.to_string()],
            latency.p50 / ours.p50,
        );
        table.row(first.into_iter().chain(times).chain([significant(last)]));
    };
    if let Some(polled) = &polled {
        row(
            "residuald's samples (iceoryx2)",
            "polls, as the daemon's step thread",
            polled,
            polled,
        );
    }
    row(
        "residuald's samples and an iceoryx2 event",
        "sleeps until the event",
        &woken,
        &woken,
    );
    for (name, latency) in [("Cyclone DDS, `ddsperf`", dds), ("zenoh, peers over TCP", zenoh)] {
        let ours = [("polling", polled.as_ref()), ("sleeping", Some(&woken))];
        match latency {
            Ok(latency) => {
                row(name, "sleeps in the socket, callback", &latency, &woken);
                for (how, ours) in ours.into_iter().filter_map(|(how, ours)| Some((how, ours?))) {
                    let what = format!("latency of a sample at p50: {name} (sleeping) / ours ({how})");
                    results
                        .findings
                        .push(Finding::at_least(what, latency.p50 / ours.p50, 1.0, ""));
                }
            }
            Err(absent) => {
                for (how, _) in ours {
                    let what = format!("latency of a sample at p50: {name} (sleeping) / ours ({how})");
                    results
                        .findings
                        .push(Finding::not_measured(what, "≥ 1", "not installed"));
                }
                results.skip(format!("sample latency of {name}"), absent);
            }
        }
    }
    results.tables.push(table);
    results.notes.push(
        "One sample is under way at a time; the next one is sent when the answer is there. residuald's step thread polls \
         its inputs at the sampling instants and never sleeps for a sample, so that the polled latency is the one that \
         counts there; for like against like the second row sleeps until an iceoryx2 event, as the receivers of the \
         others do. Cyclone DDS as shipped: reliable, keep last 1, its own choice of network interface, UDP, answers \
         from listeners; its iceoryx shared memory needs a daemon (RouDi) and a configuration of its own and is not \
         used. zenoh as in its own z_ping and z_pong: peers, one TCP connection over the loopback interface, express \
         messages, no shared memory. A receiver that sleeps is woken by the scheduler: with other work on the machine \
         all sleeping rows grow."
            .to_owned(),
    );
    Ok(())
}
