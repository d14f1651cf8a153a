//! `alarm`: from the writing of a transition to the first instruction of a consumer in another process.
//!
//! | way | consumer | woken by |
//! |---|---|---|
//! | bare futex | sleeps on a futex in a shared file | store and FUTEX_WAKE: the least that the kernel asks for |
//! | bare iceoryx2 event | `Listener::timed_wait` | `Notifier::notify` |
//! | alarm ring | `TableReader::wait_for_alarm`, read-only map | `TableWriter::raise` |
//! | client library | `AlarmListener::wait` on the ring | the same |
//! | client library, spinning | `AlarmListener::wait_spin_then_sleep`, within its time of spinning | the same |
//! | iceoryx2 event of the alarm | `AlarmEvents::wait` | `raise`, heard by a relay that notifies, as the daemon's companion does |
//!
//! In each round every way has its turn, in rotating order, after a pause that lets the consumer fall asleep: all
//! see the same load.

use std::sync::atomic::Ordering;
use std::thread::sleep;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, ensure};
use residual_shared::bounds_table::TableWriter;
use residual_shared::clock::monotonic_ns;
use residual_shared::names::Instance;
use residual_shared::transport;
use rustix::thread::futex::{self, Flags};

use super::stage::{STEP_CORE, STEP_PRIORITY, Stage, on_own_thread, real_time_refusal};
use super::tables;
use crate::percentiles::{Counts, Percentiles, times_of};
use crate::process::Process;
use crate::processor::{pin, real_time};
use crate::results::{Finding, Results, Table};
use crate::shared_words::SharedWords;
use relay::Relay;

pub mod consumer;
mod relay;

/// Between two wake-ups: long enough to fall asleep.
const PAUSE: Duration = Duration::from_micros(700);

/// A consumer that is not woken for so long gives up, and so does who waits for it.
const PATIENCE: Duration = Duration::from_secs(10);

/// Words of the shared file, each on a line of its own: the futex, the moment of its wake-up, that of the event, and
/// the futex that tells the spinning consumer that its turn has come.
const FUTEX: usize = 0;
const FUTEX_STAMP: usize = 8;
const EVENT_STAMP: usize = 16;
const SPIN: usize = 24;
/// How often the consumer of the first way has been woken; the other ways follow.
const WOKEN: usize = 32;

/// The service of the bare event.
const BARE_EVENT: &str = "bench/alarm/bare";

/// How a consumer is woken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Way {
    /// A futex in a shared file.
    Futex,
    /// An iceoryx2 event.
    Event,
    /// The ring of a bounds table.
    Ring,
    /// The client library on the ring.
    Listener,
    /// The same, looking without pause.
    Spinning,
    /// The iceoryx2 event of the alarm.
    AlarmEvent,
}

const WAYS: [(Way, &str); 6] = [
    (Way::Futex, "bare futex"),
    (Way::Event, "bare iceoryx2 event"),
    (Way::Ring, "alarm ring"),
    (Way::Listener, "client library, asleep on the ring"),
    (Way::Spinning, "client library, spinning before it sleeps"),
    (Way::AlarmEvent, "iceoryx2 event of the alarm"),
];

/// What `alarm` takes.
#[derive(Clone, Debug, clap::Args)]
pub struct Options {
    /// Wake-ups of each way and scheduling; default 2,500, with --quick 500.
    #[arg(long)]
    rounds: Option<u64>,
}

/// Measures all ways.
///
/// # Errors
/// A process fails, or is not woken in time.
pub fn run(options: &Options, quick: bool) -> Result<Results> {
    let about = "From just before the alarm is written (the bare ways: before the wake-up) to the consumer's first \
                 instruction, in another process. In each round every way has its turn, 0.7 ms after the one before. \
                 The iceoryx2 event of an alarm comes by way of the daemon's companion thread, so that the step thread \
                 makes one system call, whoever listens.";
    let mut results = Results::begin("alarm", "From alarm to consumer", about, quick);
    let rounds = options.rounds.unwrap_or(if quick { 500 } else { 2_500 });
    let mut table = Table::of_percentiles("Alarm raised → consumer awake", &["scheduling", "way"]);
    let mut schedulings = vec![("usual", false)];
    match real_time_refusal() {
        None => schedulings.push(("SCHED_FIFO, pinned", true)),
        Some(why) => results.skip("alarms under SCHED_FIFO on cores of their own", why),
    }
    for (scheduling, is_real_time) in schedulings {
        let measured = measure(rounds, is_real_time)?;
        for ((_, name), percentiles) in WAYS.iter().zip(&measured) {
            table.percentiles([scheduling, name], percentiles);
        }
        judge(&mut results, scheduling, &measured);
    }
    results.tables.push(table);
    Ok(results)
}

fn judge(results: &mut Results, scheduling: &str, measured: &[Percentiles]) {
    let of = |way: Way| {
        let place = WAYS.iter().position(|(other, _)| *other == way);
        place.and_then(|place| measured.get(place))
    };
    let mut compare = |what: &str, way: Way, peer: Way, peer_name: &str, limit: f64| {
        if let (Some(own), Some(peer)) = (of(way), of(peer)) {
            let ratio = own.p50 as f64 / peer.p50 as f64;
            results.findings.push(Finding::at_most(
                format!("{what} / {peer_name}, p50, {scheduling}"),
                ratio,
                limit,
                "",
            ));
        }
    };
    compare("alarm ring", Way::Ring, Way::Futex, "bare futex", 1.1);
    compare("client library", Way::Listener, Way::Futex, "bare futex", 1.1);
    compare("spinning", Way::Spinning, Way::Futex, "bare futex", 1.1);
    compare("alarm ring", Way::Ring, Way::Event, "bare iceoryx2 event", 1.0);
}

/// Where the table of a way is.
fn table_of(way: Way, stage: &Instance) -> Result<Instance> {
    let letter = match way {
        Way::Listener => "l",
        Way::Spinning => "s",
        Way::Ring => "r",
        // The one whose iceoryx2 services are used.
        _ => return Ok(stage.clone()),
    };
    let name = format!("{}{letter}", stage.name).parse()?;
    Ok(Instance::new(name, &stage.runtime_directory))
}

fn measure(rounds: u64, is_real_time: bool) -> Result<Vec<Percentiles>> {
    let stage = Stage::open(WOKEN + 8 * WAYS.len())?;
    on_own_thread(|| produce(&stage, rounds, is_real_time))
}

fn produce(stage: &Stage, rounds: u64, is_real_time: bool) -> Result<Vec<Percentiles>> {
    let words = stage.words()?;
    let mut tables = Vec::new();
    for (way, _) in WAYS {
        let path = table_of(way, stage.instance())?.bounds_path();
        let has_table = matches!(way, Way::Ring | Way::Listener | Way::Spinning | Way::AlarmEvent);
        tables.push(has_table.then(|| tables::create(&path, 1, 1)).transpose()?);
    }
    let relay = Relay::start(stage.instance().clone())?;
    let node = transport::open_node(stage.instance())?;
    let name = BARE_EVENT.try_into().context("the name of the bare event")?;
    let event = node.service_builder(&name).event().open_or_create()?;
    let notifier = event.notifier_builder().create()?;
    let mut consumers = Vec::new();
    for (way, _) in WAYS {
        let mut consumer = start(stage, way, rounds, is_real_time)?;
        consumer.line()?;
        consumers.push(consumer);
    }
    if is_real_time {
        pin(STEP_CORE)?;
        real_time(STEP_PRIORITY)?;
    }
    for round in 0..rounds {
        for turn in 0..WAYS.len() {
            let place = (round as usize + turn) % WAYS.len();
            let (way, _) = WAYS[place];
            if way == Way::Spinning {
                wake(&words, SPIN);
            }
            sleep(PAUSE);
            match (way, &mut tables[place]) {
                (Way::Futex, _) => {
                    words.word(FUTEX_STAMP).store(monotonic_ns(), Ordering::Relaxed);
                    wake(&words, FUTEX);
                }
                (Way::Event, _) => {
                    words.word(EVENT_STAMP).store(monotonic_ns(), Ordering::Release);
                    notifier.notify()?;
                }
                (_, Some(table)) => raise(table),
                (_, None) => {}
            }
            wait_until_woken(&words, place, round)?;
        }
    }
    let mut measured = Vec::new();
    for mut consumer in consumers {
        let counts: Counts = consumer.said()?;
        measured.push(Percentiles::of(&times_of(&counts)));
        consumer.end()?;
    }
    relay.end()?;
    Ok(measured)
}

fn start(stage: &Stage, way: Way, rounds: u64, is_real_time: bool) -> Result<Process> {
    use clap::ValueEnum as _;
    let way = way.to_possible_value();
    let way = way.as_ref().map_or("", |way| way.get_name());
    let more = ["--way", way, "--rounds", &rounds.to_string()].map(String::from);
    stage.start("alarm-consumer", is_real_time, &more)
}

/// Adds one to a futex and wakes who sleeps on it.
fn wake(words: &SharedWords, futex: usize) {
    let futex = words.half(futex);
    futex.fetch_add(1, Ordering::Release);
    // It fails for wrong addresses only.
    let _ = futex::wake(futex, Flags::empty(), 1);
}

fn raise(table: &mut TableWriter) {
    // A sign of life as well, without which a client looks for a new daemon.
    table.heartbeat(monotonic_ns());
    table.raise(&tables::transition());
}

fn wait_until_woken(words: &SharedWords, place: usize, round: u64) -> Result<()> {
    let begin = Instant::now();
    while words.word(WOKEN + 8 * place).load(Ordering::Relaxed) <= round {
        sleep(PAUSE / 10);
        let name = WAYS[place].1;
        ensure!(begin.elapsed() < PATIENCE, "{name}: nobody was woken");
    }
    Ok(())
}
