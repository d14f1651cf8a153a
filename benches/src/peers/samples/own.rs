//! Round trips through residuald's sample transport, between this process and another one of this program.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, anyhow};
use clap::{Args, ValueEnum};
use hdrhistogram::Histogram;
use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::prelude::{ServiceName, ipc};
use residual_shared::clock::monotonic_ns;
use residual_shared::names::Instance;
use residual_shared::transport::{Node, SamplePublisher, SampleSubscriber, open_node, remove_leftovers};

use super::ELEMENTS;
use crate::process::{Process, wait_until_asked_to_end};

/// How a receiver waits for a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Wait {
    /// Looks again and again.
    Polling,
    /// Sleeps until an event of the sender.
    Events,
}

/// Arguments of the process that sends every sample back.
#[derive(Args)]
pub struct EchoOptions {
    #[arg(long)]
    instance: String,
    #[arg(long)]
    directory: PathBuf,
    #[arg(long)]
    wait: Wait,
}

/// Round trips that do not count.
const WARM: usize = 200;
/// After so many looks in vain a receiver that polls lets others have the processor once: the sender may wait for it.
const LOOKS: u32 = 2_000;
/// A sleeping receiver looks after so long whether it should end.
const SLICE: Duration = Duration::from_millis(100);
/// A round trip that takes longer has failed.
const LOST: Duration = Duration::from_secs(10);
/// Longest series: processes that poll get little of a machine that is busy with other work.
const LONGEST: Duration = Duration::from_secs(8);

/// One direction's events.
struct Bell {
    notifier: Notifier<ipc::Service>,
    listener: Listener<ipc::Service>,
}

impl Bell {
    fn open(node: &Node, out: &str, back: &str) -> Result<Self> {
        let service = |name: &str| -> Result<_> {
            let name = ServiceName::new(name).map_err(|error| anyhow!("{name}: {error:?}"))?;
            let service = node.service_builder(&name).event();
            service
                .open_or_create()
                .map_err(|error| anyhow!("{name}: {error:?}"))
        };
        Ok(Self {
            notifier: service(out)?
                .notifier_builder()
                .create()
                .map_err(|error| anyhow!("{out}: {error:?}"))?,
            listener: service(back)?
                .listener_builder()
                .create()
                .map_err(|error| anyhow!("{back}: {error:?}"))?,
        })
    }

    fn ring(&self) -> Result<()> {
        let rung = self
            .notifier
            .notify()
            .map_err(|error| anyhow!("the event is not sent: {error:?}"));
        rung.map(drop)
    }

    fn sleep(&self) -> Result<()> {
        let woken = self.listener.timed_wait(|_| {}, SLICE);
        woken
            .map(drop)
            .map_err(|error| anyhow!("no wait for events: {error:?}"))
    }
}

/// Adds up to `count` half round trips, nanoseconds, to `half_trips`; fewer if they take too long.
///
/// # Errors
/// The transport or the other process fails.
pub fn round_trips(wait: Wait, count: usize, half_trips: &mut Histogram<u64>) -> Result<()> {
    let directory = tempfile::Builder::new().prefix("rb").tempdir_in("/dev/shm")?;
    let name = format!("p{}", std::process::id());
    let instance = Instance::new(name.parse()?, directory.path());
    {
        let node = open_node(&instance)?;
        let answers = SampleSubscriber::create(&node, &instance, "pong", 4, 1)?;
        let bell = (wait == Wait::Events)
            .then(|| Bell::open(&node, "ping", "pong"))
            .transpose()?;
        let mut echo = Process::start([
            "sample-echo".as_ref(),
            "--instance".as_ref(),
            name.as_ref(),
            "--directory".as_ref(),
            directory.path().as_os_str(),
            "--wait".as_ref(),
            if wait == Wait::Polling {
                "polling"
            } else {
                "events"
            }
            .as_ref(),
        ])?;
        echo.line()?;
        let mut samples = SamplePublisher::open(&node, &instance, "ping")?;
        let first = Instant::now();
        for round in (0..WARM + count).take_while(|_| first.elapsed() < LONGEST) {
            let begin = Instant::now();
            samples.send(monotonic_ns(), &[round as f64; ELEMENTS])?;
            if let Some(bell) = &bell {
                bell.ring()?;
            }
            let (mut answered, mut looks) = (false, 0);
            while !answered {
                match &bell {
                    Some(bell) => bell.sleep()?,
                    None => look_again(&mut looks),
                }
                answers.receive(|_, _, elements| answered |= elements == [round as f64; ELEMENTS]);
                anyhow::ensure!(answered || begin.elapsed() < LOST, "a sample came not back");
            }
            if round >= WARM {
                half_trips.record(begin.elapsed().as_nanos() as u64 / 2)?;
            }
        }
        echo.end()?;
    }
    remove_leftovers(&instance)?;
    Ok(())
}

/// Sends every sample back until the standard input is closed.
///
/// # Errors
/// The transport fails.
pub fn echo(options: &EchoOptions) -> Result<()> {
    let instance = Instance::new(options.instance.parse()?, &options.directory);
    let node = open_node(&instance)?;
    let samples = SampleSubscriber::create(&node, &instance, "ping", 4, 1)?;
    let mut answers = SamplePublisher::open(&node, &instance, "pong")?;
    let bell = (options.wait == Wait::Events)
        .then(|| Bell::open(&node, "pong", "ping"))
        .transpose()?;
    println!("ready");
    let ends = Arc::new(AtomicBool::new(false));
    let told = Arc::clone(&ends);
    thread::spawn(move || {
        wait_until_asked_to_end();
        told.store(true, Ordering::Relaxed);
    });
    let mut looks = 0;
    while !ends.load(Ordering::Relaxed) {
        match &bell {
            Some(bell) => bell.sleep()?,
            None => look_again(&mut looks),
        }
        let mut sent = Ok(());
        let received = samples.receive(|_, header, elements| {
            if sent.is_ok() {
                sent = answers.send_with_header(header, elements);
            }
        });
        sent.context("the answer")?;
        if received > 0 {
            looks = 0;
        }
        if let Some(bell) = bell.as_ref().filter(|_| received > 0) {
            bell.ring()?;
        }
    }
    Ok(())
}

fn look_again(looks: &mut u32) {
    *looks += 1;
    if looks.is_multiple_of(LOOKS) {
        thread::yield_now();
    }
}
