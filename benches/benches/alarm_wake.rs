//! How soon a sleeping consumer knows of an alarm: from the writing of the transition to the consumer's first
//! instruction, between two processes, beside a bare futex and a bare iceoryx2 event in the same run.
//!
//! ```text
//! cargo bench -p residual-benches --bench alarm_wake [-- --rounds N]
//! ```
//!
//! | way | consumer sleeps on | woken by |
//! |---|---|---|
//! | bare futex | a futex in a shared file | store and FUTEX_WAKE: the least that the kernel asks for |
//! | alarm ring | `TableReader::wait_for_alarm`, read-only map | `TableWriter::raise` |
//! | iceoryx2 event | `Listener::timed_wait` | `Notifier::notify` |
//!
//! In each round every way has its turn, in rotating order, after a pause that lets the consumer fall asleep: all
//! three see the same load.
#![allow(
    clippy::expect_used,
    missing_docs,
    reason = "a benchmark stops on its first mistake"
)]

use std::env;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::Ordering;
use std::thread::sleep;
use std::time::Duration;

use hdrhistogram::Histogram;
use iceoryx2::port::listener::Listener;
use iceoryx2::prelude::{Node, NodeBuilder, SignalHandlingMode, ipc};
use iceoryx2::service::port_factory::event::PortFactory;
use residual_benches::shared_words::SharedWords;
use residual_shared::alarm::{AlarmState, AlarmTransition};
use residual_shared::bounds_table::{Access, AlarmRead, SlotSpec, TableReader, TableSpec, TableWriter};
use residual_shared::clock::{DaemonTime, monotonic_ns};
use rustix::thread::futex::{self, Flags, Timespec};

const WAYS: [&str; 3] = ["bare futex", "alarm ring", "iceoryx2 event"];

/// Between two wake-ups: long enough to fall asleep.
const PAUSE: Duration = Duration::from_micros(700);

/// A consumer that is not woken for so long gives up.
const PATIENCE: Duration = Duration::from_secs(10);

/// Words of the shared file: the futex, the moment of its wake-up, and that of the event.
const FUTEX: usize = 0;
const FUTEX_STAMP: usize = 8;
const EVENT_STAMP: usize = 16;
/// How often the consumer of each way has been woken.
const WOKEN: [usize; 3] = [24, 32, 40];
const WORDS: usize = 48;

/// Tells a process of this program that it is the consumer of a way; the value is `WAY ROUNDS DIRECTORY`.
const CONSUMER: &str = "RESIDUAL_ALARM_WAKE_CONSUMER";

fn main() {
    if let Ok(consumer) = env::var(CONSUMER) {
        let mut parts = consumer.splitn(3, ' ');
        let mut part = || parts.next().expect("way, rounds, directory").to_owned();
        let (way, rounds, directory) = (part(), part(), PathBuf::from(part()));
        return consume(
            way.parse().expect("a way"),
            rounds.parse().expect("rounds"),
            &directory,
        );
    }
    let arguments: Vec<String> = env::args().collect();
    let rounds = (arguments.iter().position(|argument| argument == "--rounds"))
        .and_then(|index| arguments.get(index + 1)?.parse().ok())
        .unwrap_or(3_000);
    produce(rounds);
}

fn produce(rounds: usize) {
    let directory = tempfile::tempdir_in("/dev/shm").expect("a tmpfs");
    let place = directory.path();
    let file = File::create_new(place.join("words")).expect("a new file");
    file.set_len(8 * WORDS as u64).expect("room");
    let words = SharedWords::open(&place.join("words")).expect("the new file");
    let access = Access {
        group: None,
        mode: 0o600,
    };
    let mut table =
        TableWriter::create(&place.join("bounds"), &specification(), &access).expect("a new table");
    let (_node, events) = event_service(place);
    let notifier = events.notifier_builder().create().expect("a notifier");
    let mut consumers: Vec<Consumer> = (0..WAYS.len())
        .map(|way| Consumer::start(way, rounds, place))
        .collect();

    for round in 0..rounds {
        for turn in 0..WAYS.len() {
            sleep(PAUSE);
            let way = (round + turn) % WAYS.len();
            match way {
                0 => {
                    words.word(FUTEX_STAMP).store(monotonic_ns(), Ordering::Relaxed);
                    let futex = words.half(FUTEX);
                    futex.fetch_add(1, Ordering::Release);
                    futex::wake(futex, Flags::empty(), 1).expect("a wake-up");
                }
                1 => _ = table.raise(&transition()),
                _ => {
                    words.word(EVENT_STAMP).store(monotonic_ns(), Ordering::Release);
                    notifier.notify().expect("a notification");
                }
            }
            while words.word(WOKEN[way]).load(Ordering::Relaxed) <= round as u64 {
                sleep(PAUSE / 10);
            }
        }
    }
    let mut histograms = Vec::new();
    for consumer in &mut consumers {
        histograms.push(consumer.finish());
    }
    report(rounds, &histograms);
}

fn report(rounds: usize, histograms: &[Histogram<u64>]) {
    let load = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    let cores = std::thread::available_parallelism().map_or(0, usize::from);
    println!(
        "{rounds} wake-ups a way, {cores} cores, load average {}",
        load.trim()
    );
    println!(
        "{:<16} {:>9} {:>9} {:>9} {:>9} {:>9}   µs",
        "", "p50", "p90", "p99", "p99.9", "max"
    );
    let quantiles = |histogram: &Histogram<u64>| {
        [0.5, 0.9, 0.99, 0.999, 1.0].map(|quantile| histogram.value_at_quantile(quantile) as f64 / 1e3)
    };
    let bare = quantiles(&histograms[0]);
    for (name, histogram) in WAYS.iter().zip(histograms) {
        let values = quantiles(histogram);
        let shown: String = values.iter().map(|value| format!(" {value:>9.1}")).collect();
        println!("{name:<16}{shown}");
        let ratios: String = values
            .iter()
            .zip(bare)
            .map(|(value, bare)| format!(" {:>9.2}", value / bare))
            .collect();
        println!("{:<16}{ratios}", "  / bare futex");
    }
}

/// A process that sleeps until it is woken, again and again.
struct Consumer {
    process: Child,
    output: BufReader<std::process::ChildStdout>,
}

impl Consumer {
    /// Starts it; it is ready when this returns.
    fn start(way: usize, rounds: usize, place: &Path) -> Self {
        let mut process = Command::new(env::current_exe().expect("this program"))
            .env(CONSUMER, format!("{way} {rounds} {}", place.display()))
            .stdout(Stdio::piped())
            .spawn()
            .expect("a process");
        let mut output = BufReader::new(process.stdout.take().expect("its output"));
        let mut line = String::new();
        output.read_line(&mut line).expect("a sign of readiness");
        Self { process, output }
    }

    /// Its latencies, nanoseconds.
    fn finish(&mut self) -> Histogram<u64> {
        let mut histogram = Histogram::new(3).expect("three digits");
        for line in (&mut self.output).lines() {
            let latency = line.expect("a line").parse().expect("a latency");
            histogram.record(latency).expect("room");
        }
        assert!(
            self.process.wait().expect("an end").success(),
            "a consumer gave up"
        );
        histogram
    }
}

fn consume(way: usize, rounds: usize, place: &Path) {
    let words = SharedWords::open(&place.join("words")).expect("the file");
    let table = TableReader::open(&place.join("bounds")).expect("the table");
    // Only the consumer that waits for it: every listener would be woken.
    let event = (way == 2).then(|| {
        let (node, events) = event_service(place);
        (node, events.listener_builder().create().expect("a listener"))
    });
    println!("ready");
    let mut latencies = Vec::with_capacity(rounds);
    for number in 1..=rounds as u64 {
        latencies.push(match (way, &event) {
            (_, Some((_node, listener))) => by_event(&words, listener),
            (0, None) => by_futex(&words, number),
            _ => by_ring(&table, number),
        });
        words.word(WOKEN[way]).store(number, Ordering::Relaxed);
    }
    for latency in latencies {
        println!("{latency}");
    }
}

fn by_futex(words: &SharedWords, number: u64) -> u64 {
    let futex = words.half(FUTEX);
    let patience = Timespec {
        tv_sec: PATIENCE.as_secs().cast_signed(),
        tv_nsec: 0,
    };
    while futex.load(Ordering::Acquire) < number as u32 {
        let _ = futex::wait(futex, Flags::empty(), number as u32 - 1, Some(&patience));
    }
    monotonic_ns() - words.word(FUTEX_STAMP).load(Ordering::Relaxed)
}

fn by_ring(table: &TableReader, number: u64) -> u64 {
    loop {
        match table.read_alarm(number) {
            AlarmRead::Waiting => table.wait_for_alarm(number - 1, PATIENCE),
            AlarmRead::Transition(transition) => return monotonic_ns() - transition.written_ns,
            AlarmRead::Lost => unreachable!("one at a time"),
        }
    }
}

fn by_event(words: &SharedWords, listener: &Listener<ipc::Service>) -> u64 {
    let mut now = None;
    listener
        .timed_wait(|_| _ = now.get_or_insert_with(monotonic_ns), PATIENCE)
        .expect("a wait");
    let now = now.expect("a notification in time");
    now - words.word(EVENT_STAMP).load(Ordering::Acquire)
}

fn event_service(place: &Path) -> (Node<ipc::Service>, PortFactory<ipc::Service>) {
    use iceoryx2::prelude::{Config, FileName, Path as IceoryxPath, SemanticString};
    let mut config = Config::default();
    let root = place.join("iox2");
    config
        .global
        .set_root_path(&IceoryxPath::new(root.as_os_str().as_encoded_bytes()).expect("a short path"));
    let unique = place.file_name().expect("a name").as_encoded_bytes();
    config.global.prefix = FileName::new(&[unique, b"_"].concat()).expect("a prefix");
    let node = NodeBuilder::new()
        .config(&config)
        .signal_handling_mode(SignalHandlingMode::Disabled)
        .create::<ipc::Service>()
        .expect("a node");
    let name = "alarm_wake".try_into().expect("a name");
    let service = node
        .service_builder(&name)
        .event()
        .open_or_create()
        .expect("a service");
    (node, service)
}

fn specification() -> TableSpec {
    TableSpec {
        instance: "bench".into(),
        slots: vec![SlotSpec {
            name: "bench".into(),
            method: "none".into(),
            period_ns: 1_000_000,
            phase_ns: 0,
            margin_ns: 0,
            channels: Vec::new(),
            faults: Vec::new(),
        }],
        inputs: Vec::new(),
        time: DaemonTime::MONOTONIC,
        schedule_epoch_ns: 0,
        stale_after_periods: 3,
        alarm_capacity: 64,
    }
}

fn transition() -> AlarmTransition {
    AlarmTransition {
        number: Default::default(),
        written_ns: 0,
        instant_ns: 0,
        step: 0,
        slot: 0,
        identity: 0,
        state: AlarmState::Raised,
        flags: 0,
        verdict: 2,
        occurrence: 1,
        certainly_faulty: 0,
        possibly_faulty: 0,
        channel: 0,
        ratio: 1.5,
        fault_estimate: f64::NAN,
        fault_estimate_half_width: f64::NAN,
    }
}
