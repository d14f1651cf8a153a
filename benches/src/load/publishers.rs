//! Sensors in a process of their own: the samples of the plants over iceoryx2, at the sampling instants.

use anyhow::Result;
use clap::Args;
use residual_shared::bounds_table::TableReader;
use residual_shared::clock::{DaemonTime, monotonic_ns, sleep_until_monotonic};
use residual_shared::names::{Instance, InstanceName};
use residual_shared::transport::{self, SamplePublisher};
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use super::fleet::{FleetOptions, KINDS, Kinds, PERIOD_NS, input_name};
use super::plants::Plants;
use crate::process::{Process, wait_until_asked_to_end};
use crate::processor::{pin, real_time};

/// The role of a publisher.
#[derive(Clone, Debug, Args)]
pub struct PublisherRole {
    #[command(flatten)]
    fleet: FleetOptions,
    /// Instance of the daemon, in the runtime directory of the environment.
    #[arg(long)]
    instance: InstanceName,
    /// Number of this publisher, from 0.
    #[arg(long)]
    number: usize,
    /// How many there are: each has every so many-th plant.
    #[arg(long)]
    of: usize,
    /// Whether something is wrong with the plants now and then.
    #[arg(long)]
    faults: bool,
    /// The only core of the publisher.
    #[arg(long)]
    core: Option<usize>,
    /// Its SCHED_FIFO priority.
    #[arg(long)]
    fifo: Option<u8>,
}

/// What a publisher has done.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Published {
    /// Samples sent.
    pub samples: u64,
    /// Periods of which the last sample was sent more than the transport allowance after the instant.
    pub late_periods: u64,
    /// Longest time from a sampling instant to the last sample of it, nanoseconds.
    pub longest_ns: u64,
}

/// Plays the role: publishes at every sampling instant until asked to end, then says what it has done.
///
/// # Errors
/// There is no daemon, or a sample cannot be sent.
pub fn play(role: &PublisherRole) -> Result<()> {
    if let Some(core) = role.core {
        pin(core)?;
    }
    if let Some(priority) = role.fifo
        && let Err(error) = real_time(priority)
    {
        eprintln!("{error:#}");
    }
    let instance = Instance::from_environment(role.instance.clone());
    let spec = TableReader::open(&instance.bounds_path())?
        .directory()
        .spec
        .clone();
    let margin_ns = spec.slots.first().map_or(0, |slot| slot.margin_ns);
    let kinds = Kinds::read()?;
    let mut plants = Plants::new(&kinds, role.faults, 1)?;
    let node = transport::open_node(&instance)?;
    // By input of a set, then by set.
    let mut publishers = Vec::new();
    for (number, input) in kinds.inputs().enumerate() {
        let kind = (0..KINDS).rev().find(|kind| kinds.first_input(*kind) <= number);
        let own = |set: &usize| (kind.unwrap_or(0) + set) % role.of == role.number;
        let sets = (0..role.fleet.input_sets()).filter(own);
        let open = |set| SamplePublisher::open(&node, &instance, &input_name(&input.name, set));
        publishers.push(sets.map(open).collect::<Result<Vec<_>, _>>()?);
    }
    let stop = Arc::new(AtomicBool::new(false));
    let asked = Arc::clone(&stop);
    std::thread::spawn(move || {
        wait_until_asked_to_end();
        asked.store(true, Ordering::Relaxed);
    });
    println!("ready");
    let time: DaemonTime = spec.time;
    let first = (time.now_ns() - spec.schedule_epoch_ns.min(time.now_ns())) / PERIOD_NS + 2;
    let mut published = Published::default();
    for period in first.. {
        if stop.load(Ordering::Relaxed) {
            break;
        }
        let samples = plants.period();
        let instant_ns = spec.schedule_epoch_ns + period * PERIOD_NS;
        sleep_until_monotonic(instant_ns);
        for sample in &samples {
            for publisher in &mut publishers[sample.input] {
                match &sample.elements {
                    Some(elements) => publisher.send(instant_ns - sample.age_ns, elements)?,
                    None => publisher.skip(),
                }
                published.samples += u64::from(sample.elements.is_some());
            }
        }
        let taken_ns = monotonic_ns().saturating_sub(instant_ns);
        published.late_periods += u64::from(taken_ns > margin_ns);
        published.longest_ns = published.longest_ns.max(taken_ns);
    }
    println!("{}", serde_json::to_string(&published)?);
    Ok(())
}

/// How many publishers, and how they run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PublisherOptions {
    /// Number of processes.
    pub processes: usize,
    /// Whether something is wrong with the plants now and then.
    pub faults: bool,
    /// The only core of all of them.
    pub core: Option<usize>,
    /// Their SCHED_FIFO priority.
    pub fifo: Option<u8>,
}

/// Running publishers.
#[derive(Debug)]
pub struct Publishers(Vec<Process>);

impl Publishers {
    /// Starts them and waits until each is connected.
    ///
    /// # Errors
    /// One does not start.
    pub fn start(fleet: &FleetOptions, instance: &InstanceName, options: &PublisherOptions) -> Result<Self> {
        let mut processes = Vec::new();
        for number in 0..options.processes {
            let mut arguments = vec![
                "load-publisher".to_owned(),
                "--instance".to_owned(),
                instance.to_string(),
            ];
            arguments.extend(fleet.arguments());
            for (name, value) in [
                ("--number", Some(number)),
                ("--of", Some(options.processes)),
                ("--core", options.core),
                ("--fifo", options.fifo.map(usize::from)),
            ] {
                arguments.extend(
                    value
                        .into_iter()
                        .flat_map(|value| [name.to_owned(), value.to_string()]),
                );
            }
            if options.faults {
                arguments.push("--faults".to_owned());
            }
            processes.push(Process::start(arguments)?);
        }
        for process in &mut processes {
            process.line()?;
        }
        Ok(Self(processes))
    }

    /// Stops them; what all of them have done.
    ///
    /// # Errors
    /// One failed.
    pub fn stop(mut self) -> Result<Published> {
        self.0.iter_mut().for_each(Process::ask_to_end);
        let mut all = Published::default();
        for mut process in self.0 {
            let one: Published = process.said()?;
            all.samples += one.samples;
            all.late_periods = all.late_periods.max(one.late_periods);
            all.longest_ns = all.longest_ns.max(one.longest_ns);
            process.end()?;
        }
        Ok(all)
    }
}
