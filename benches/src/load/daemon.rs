//! The daemon with a fleet, in a process of its own: residuald's own `run`, on a configuration that needs no file.

use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use clap::Args;
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use residual_shared::bounds_table::TableReader;
use residual_shared::names::{Instance, InstanceName};
use residuald::commands::run::{RunOptions, run};
use residuald::configuration::RealtimeSection;
use residuald::logging;
use residuald::summary::Summary;

use super::fleet::{FleetOptions, Kinds, diagnosers};
use super::usage::scheduling;
use crate::process::{Process, wait_until_asked_to_end};

/// How long the daemon may take until its bounds table is there.
const START_LIMIT: Duration = Duration::from_secs(120);

/// How the step thread shall be scheduled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Args)]
pub struct RealTimeOptions {
    /// The only core of the step thread.
    #[arg(long)]
    pub core: Option<usize>,
    /// Its SCHED_FIFO priority.
    #[arg(long)]
    pub fifo: Option<u8>,
}

/// The role of the daemon.
#[derive(Clone, Debug, Args)]
pub struct DaemonRole {
    #[command(flatten)]
    fleet: FleetOptions,
    #[command(flatten)]
    real_time: RealTimeOptions,
    /// Its instance, in the runtime directory of the environment.
    #[arg(long)]
    instance: InstanceName,
}

/// Plays the role: runs until asked to end, then says its summary.
///
/// # Errors
/// The daemon does not run.
pub fn play(role: &DaemonRole) -> Result<()> {
    let kinds = Kinds::read()?;
    let diagnosers = diagnosers(&kinds.design()?, &role.fleet);
    let mut configuration = kinds.configuration(&role.fleet, &role.instance);
    let place = Instance::from_environment(role.instance.clone());
    configuration.daemon.runtime_directory = place.runtime_directory;
    configuration.realtime = RealtimeSection {
        fifo_priority: role.real_time.fifo,
        cpu: role.real_time.core,
        lock_memory: true,
    };
    let (_log, log) = logging::start("error")?;
    std::thread::spawn(|| {
        wait_until_asked_to_end();
        // The daemon's own handler stops it in good order.
        let _ = kill(Pid::this(), Signal::SIGTERM);
    });
    let options = RunOptions {
        source: None,
        speed: 1.0,
        log,
    };
    let summary = run(configuration, diagnosers, options)?;
    println!("{}", serde_json::to_string(&summary)?);
    Ok(())
}

/// A running daemon.
#[derive(Debug)]
pub struct Daemon {
    /// Its instance.
    pub instance: Instance,
    process: Process,
    table: TableReader,
}

impl Daemon {
    /// Starts it and waits until its bounds table is there.
    ///
    /// # Errors
    /// It does not start.
    pub fn start(fleet: &FleetOptions, real_time: &RealTimeOptions, instance: Instance) -> Result<Self> {
        let mut arguments = vec![
            "load-daemon".to_owned(),
            "--instance".to_owned(),
            instance.name.to_string(),
        ];
        arguments.extend(fleet.arguments());
        for (name, value) in [
            ("--core", real_time.core.map(|core| core.to_string())),
            ("--fifo", real_time.fifo.map(|priority| priority.to_string())),
        ] {
            arguments.extend(value.into_iter().flat_map(|value| [name.to_owned(), value]));
        }
        let process = Process::start(arguments)?;
        let begin = Instant::now();
        while begin.elapsed() < START_LIMIT {
            if let Ok(table) = TableReader::open(&instance.bounds_path())
                && table.directory().pid == process.id()
            {
                return Ok(Self {
                    instance,
                    process,
                    table,
                });
            }
            anyhow::ensure!(
                std::path::Path::new("/proc")
                    .join(process.id().to_string())
                    .join("fd")
                    .exists(),
                "the daemon has ended"
            );
            std::thread::sleep(Duration::from_millis(10));
        }
        bail!("the daemon did not start within {START_LIMIT:?}")
    }

    /// Its process number, which is that of its step thread.
    pub fn id(&self) -> u32 {
        self.process.id()
    }

    /// Its bounds table.
    pub fn table(&self) -> &TableReader {
        &self.table
    }

    /// How its step thread is scheduled, for people.
    pub fn scheduling(&self) -> String {
        scheduling(self.id())
    }

    /// Sums of its counters now.
    ///
    /// # Errors
    /// Its table cannot be read.
    pub fn counts(&self) -> Result<Counts> {
        let spec = &self.table.directory().spec;
        let mut counts = Counts::default();
        for slot in 0..spec.slots.len() {
            let counters = self.table.read_schedule_counters(slot)?;
            counts.steps += counters.steps;
            counts.overruns += counters.overruns;
            counts.skipped += counters.skipped;
            counts.input_missing += counters.input_missing;
            counts.records_dropped += counters.records_dropped;
        }
        for input in 0..spec.inputs.len() {
            let counters = self.table.read_input_counters(input)?;
            counts.samples += counters.accepted;
            counts.late += counters.late;
            counts.lost += counters.lost + counters.overwritten;
        }
        Ok(counts)
    }

    /// Stops it and takes its summary.
    ///
    /// # Errors
    /// It failed.
    pub fn stop(mut self) -> Result<Summary> {
        self.process.ask_to_end();
        let summary = self.process.said().context("the daemon's summary")?;
        self.process.end()?;
        for path in [self.instance.bounds_path(), self.instance.lock_path()] {
            // They are nobody's any more.
            let _ = std::fs::remove_file(path);
        }
        Ok(summary)
    }
}

/// Sums over all diagnosers and inputs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Steps done.
    pub steps: u64,
    /// Steps that began more than a period late.
    pub overruns: u64,
    /// Instants given up.
    pub skipped: u64,
    /// Steps that missed an element of their input.
    pub input_missing: u64,
    /// Records that recorders did not get.
    pub records_dropped: u64,
    /// Samples accepted.
    pub samples: u64,
    /// Of them, those that came after their step.
    pub late: u64,
    /// Samples lost.
    pub lost: u64,
}

impl Counts {
    /// What has come since `earlier`.
    pub fn since(&self, earlier: &Self) -> Self {
        Self {
            steps: self.steps - earlier.steps,
            overruns: self.overruns - earlier.overruns,
            skipped: self.skipped - earlier.skipped,
            input_missing: self.input_missing - earlier.input_missing,
            records_dropped: self.records_dropped - earlier.records_dropped,
            samples: self.samples - earlier.samples,
            late: self.late - earlier.late,
            lost: self.lost - earlier.lost,
        }
    }

    /// Instants whose step did not begin in time.
    pub fn missed(&self) -> u64 {
        self.overruns + self.skipped
    }
}
