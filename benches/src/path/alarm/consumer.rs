//! The consumer of one way: sleeps until it is woken, again and again, and says how long after the alarm that was.

use std::sync::atomic::Ordering;
use std::time::Duration;

use anyhow::{Context, Result, bail, ensure};
use iceoryx2::port::listener::Listener;
use iceoryx2::prelude::ipc;
use residual_client::{AlarmEvent, AlarmListener, AlarmStart};
use residual_shared::bounds_table::{AlarmRead, TableReader};
use residual_shared::clock::monotonic_ns;
use residual_shared::transport::{self, AlarmEvents};
use rustix::thread::futex::{self, Flags, Timespec};

use super::{BARE_EVENT, EVENT_STAMP, FUTEX, FUTEX_STAMP, PATIENCE, SPIN, WAYS, WOKEN, Way, table_of};
use crate::path::stage::{CLIENT_PRIORITY, OTHER_CORE, Part};
use crate::percentiles::{counts, times};
use crate::process::say;
use crate::shared_words::SharedWords;

/// How long a spinning consumer looks before it sleeps: longer than the pause before its alarm.
const SPIN_TIME: Duration = Duration::from_millis(20);

/// What it is told.
#[derive(Clone, Debug, clap::Args)]
pub struct Options {
    #[command(flatten)]
    part: Part,
    /// How it is woken.
    #[arg(long)]
    way: Way,
    /// How often.
    #[arg(long)]
    rounds: u64,
}

/// Is woken as often as told; says the delays (nanoseconds).
///
/// # Errors
/// It is not woken in time.
pub fn play(options: &Options) -> Result<()> {
    let Options { part, way, rounds } = options;
    let words = part.words()?;
    let mut delays = times();
    let place = WAYS.iter().position(|(other, _)| other == way);
    let woken = words.word(WOKEN + 8 * place.context("no such way")?);
    let mut each = |mut wait: Box<dyn FnMut(u64) -> Result<u64> + '_>| -> Result<()> {
        say(&"ready")?;
        for number in 1..=*rounds {
            delays.saturating_record(wait(number)?);
            woken.store(number, Ordering::Relaxed);
        }
        Ok(())
    };
    let instance = part.instance()?;
    let path = table_of(*way, &instance)?.bounds_path();
    part.take_seat(OTHER_CORE, CLIENT_PRIORITY)?;
    match way {
        Way::Futex => each(Box::new(|number| {
            sleep_on(&words, FUTEX, number)?;
            Ok(monotonic_ns() - words.word(FUTEX_STAMP).load(Ordering::Relaxed))
        }))?,
        Way::Event => {
            let node = transport::open_node(&instance)?;
            let name = BARE_EVENT.try_into().context("the name of the bare event")?;
            let listener = node
                .service_builder(&name)
                .event()
                .open()?
                .listener_builder()
                .create()?;
            each(Box::new(|_| by_event(&words, &listener)))?;
        }
        Way::Ring => {
            let table = TableReader::open(&path)?;
            each(Box::new(|number| by_ring(&table, number)))?;
        }
        Way::Listener | Way::Spinning => {
            let mut listener = AlarmListener::open(&table_of(*way, &instance)?, AlarmStart::Oldest)?;
            each(Box::new(|number| match way {
                Way::Spinning => {
                    sleep_on(&words, SPIN, number)?;
                    by_listener(&mut listener, SPIN_TIME)
                }
                _ => by_listener(&mut listener, Duration::ZERO),
            }))?;
        }
        Way::AlarmEvent => {
            let table = TableReader::open(&path)?;
            let node = transport::open_node(&instance)?;
            let events = AlarmEvents::open(&node, &instance)?;
            each(Box::new(|number| by_alarm_event(&table, &events, number)))?;
        }
    }
    say(&counts(&delays))
}

/// Sleeps until a futex holds `number`.
fn sleep_on(words: &SharedWords, futex: usize, number: u64) -> Result<()> {
    let futex = words.half(futex);
    let patience = Timespec {
        tv_sec: PATIENCE.as_secs().cast_signed(),
        tv_nsec: 0,
    };
    loop {
        let value = futex.load(Ordering::Acquire);
        if u64::from(value) >= number {
            return Ok(());
        }
        match futex::wait(futex, Flags::empty(), value, Some(&patience)) {
            Err(error) if error == rustix::io::Errno::TIMEDOUT => bail!("nobody woke this process"),
            _ => {}
        }
    }
}

fn by_event(words: &SharedWords, listener: &Listener<ipc::Service>) -> Result<u64> {
    let mut now = None;
    listener.timed_wait(|_| _ = now.get_or_insert_with(monotonic_ns), PATIENCE)?;
    let now = now.context("no notification in time")?;
    Ok(now - words.word(EVENT_STAMP).load(Ordering::Acquire))
}

fn by_ring(table: &TableReader, number: u64) -> Result<u64> {
    for _ in 0..100 {
        match table.read_alarm(number) {
            AlarmRead::Waiting => table.wait_for_alarm(number - 1, PATIENCE),
            AlarmRead::Transition(transition) => return Ok(monotonic_ns() - transition.written_ns),
            AlarmRead::Lost => bail!("one alarm at a time, and one was lost"),
        }
    }
    bail!("woken again and again without an alarm")
}

fn by_listener(listener: &mut AlarmListener, spin: Duration) -> Result<u64> {
    let event = listener.wait_spin_then_sleep(spin, PATIENCE);
    let now = monotonic_ns();
    match event {
        Some(AlarmEvent::Transition(alarm)) => Ok(now - alarm.transition.written_ns),
        other => bail!("no alarm in time, but {other:?}"),
    }
}

fn by_alarm_event(table: &TableReader, events: &AlarmEvents, number: u64) -> Result<u64> {
    let mut now = None;
    events.wait(PATIENCE, |_, _| _ = now.get_or_insert_with(monotonic_ns))?;
    let now = now.context("no event in time")?;
    let AlarmRead::Transition(transition) = table.read_alarm(number) else {
        bail!("an event without its alarm");
    };
    ensure!(
        table.newest_alarm() == number,
        "one alarm at a time, and two came"
    );
    Ok(now - transition.written_ns)
}
